"""The ways that a projection may take, in one program.

How many passes positions and velocities need depends on the step before. A program computes what
each way gives, most of which they share, and takes that whose guards hold.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import Floats, velocity_offset
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import StraightLine
from dap3d_core.kernels.compiler.trace import Symbol

#: Part of what a state is off its constraints that one pass removes.
NEAR = 1e-2


class Results(NamedTuple):
    """What a trace gives: for each number that is stored an address and an index; the numbers."""

    places: list[tuple[Callable[[], str], int]]
    numbers: list[Any]


Trace = Callable[[Floats], tuple[Results, Any]]


def merged(evaluator: Evaluator, tracer: StraightLine, trace: Trace, state: Floats,
           others: Sequence[Floats] | None) -> tuple[Results, str]:  # fmt: skip
    """Results of a function, and the condition under which they are valid.

    Args:
        evaluator: of the scene.
        tracer: records the program.
        trace: runs the function at a state; gives its results, and the state that it leaves.
        state: as projections are given it.
        others: states whose ways it takes, too, and those of states closer to their constraints;
            None: it takes only that of ``state``.
    """
    (places, numbers), left = trace(state)
    valid, known = tracer.guard(), [tracer.guards]

    def take(other: Floats) -> Any:
        """Take the way of another state, too; the state that it leaves, None if it was taken."""
        nonlocal numbers, valid
        tracer.guards = {}
        found, left = trace(other)
        if tracer.guards in known or len(found.numbers) != len(numbers):
            return None
        known.append(tracer.guards)
        is_first = Symbol(tracer, t.Value(t.BOOL, (valid,)))
        tracer.at(is_first.value, True)
        numbers = [
            tracer.where(is_first, x, y) for x, y in zip(numbers, found.numbers, strict=True)
        ]
        valid = tracer.new(f"or i1 {valid}, {tracer.guard()}")
        return left

    if others is not None:
        for near in _nearer(evaluator, tracer, state, left):
            take(near)
        for other in others:
            left = take(other)
            if left is not None:
                for near in _nearer(evaluator, tracer, other, left):
                    take(near)
    return Results(places, numbers), valid


def _nearer(
    evaluator: Evaluator, tracer: StraightLine, state: Floats, left: Any
) -> tuple[Floats, Floats, Floats]:
    """States near their constraints; on them in positions, and in velocities as well."""
    on = np.array([tracer.number(tracer.value(x)) for x in left], dtype=float)
    if evaluator.formulation.has_own_coordinates:
        rates = evaluator.system.tree.nodes[1:, node.RATE]
        first = int(np.min(rates, where=rates > 0, initial=len(on)))
    else:
        first = velocity_offset(1, evaluator.model.body_count)
    near = on + NEAR * (state - on)
    return near, np.where(np.arange(len(on)) < first, on, state), on
