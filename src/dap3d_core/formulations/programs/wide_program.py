"""Functions of one scene for several sets of its numbers at once.

They are programs of the scene (scene_program.py), widened (kernels/compiler/lanes.py). Where a
guard fails, the results of that lane are not valid, which ``bound`` says. Trees that are too large
for a program have a right-hand side for several sets of numbers instead (kernels/runtime/lanes.py).
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations import PROJECT, RHS, WATCH
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.joint.equations import apply_forces
from dap3d_core.formulations.joint.half_angles import LARGEST, largest_angle, small_half_angles
from dap3d_core.formulations.joint.place import place_nodes
from dap3d_core.formulations.joint.reduce import reduce_tree
from dap3d_core.formulations.joint.spread import spread_tree
from dap3d_core.formulations.programs import scene_program
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, Varied
from dap3d_core.formulations.programs.ways import Results, merged
from dap3d_core.formulations.wide_rates import SIGNATURE, Rates, WideRates
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import StraightLine
from dap3d_core.kernels.compiler.trace import Symbol, TraceError
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.lanes import wide_function, wide_unit
from dap3d_core.kernels.runtime.loop_modules import build_wide

_PROGRAM = """
define void @{name}(ptr %rates, ptr %system, ptr %loops) nounwind {{
entry:
{lines}
  ret void
}}
"""
#: Members of ``Rates`` for the results of a function.
RESULTS = {RHS: "out", PROJECT: "outcome", WATCH: "switches"}
#: What ``bound`` is where all guards hold, and where one fails.
VALID, INVALID = 0.0, 2.0


@IGNORE_FLOAT_ERRORS
def write_wide(
    evaluator: Evaluator,
    k: int,
    time: float,
    state: Floats,
    others: Sequence[Floats],
    symbol: str,
    varied: Varied,
) -> str:
    """LLVM IR of function k of a formulation as a function of ``Rates``, for one set.

    Raises:
        TraceError: the program would be too long.
        CompileError: an evaluation leaves something to the next one.
    """
    tracer = StraightLine(scene_program.MOST_INSTRUCTIONS)
    members = [name for name, _ in Rates.type_of().members]

    def trace(state: Floats) -> tuple[Results, Any]:
        system = SymbolicSystem(evaluator, tracer, varied)
        given = Rates.of(time, state, evaluator)
        rates = system.symbolic(given, lambda: "%rates", "rates.")
        outcome = np.array([1.0, *np.zeros(given.outcome.size - 1)], dtype=object)
        out = scene_program.results(evaluator, k, rates.t[0], rates.y, outcome, system.struct)
        if system.stores():
            raise CompileError("an evaluation leaves something to the next one")
        found, places = {RESULTS[k]: out} | ({"y": rates.y} if k == PROJECT else {}), []
        for name, numbers in found.items():
            pointer = system.pointer(lambda: "%rates", 2 * members.index(name))
            places += [(pointer, place) for place in range(len(numbers))]
        return Results(places, [x for numbers in found.values() for x in numbers]), rates.y

    (places, numbers), guard = merged(
        evaluator, tracer, trace, state, others if k == PROJECT else None
    )
    valid: Symbol | float = VALID
    if guard != "true":
        word = tracer.new(f"select i1 {guard}, double {VALID}, double {INVALID}")
        valid = Symbol(tracer, t.Value(t.FLOAT, (word,)))
    bound = SymbolicSystem(evaluator, tracer).pointer(lambda: "%rates", 2 * members.index("bound"))
    for (pointer, place), x in zip([*places, (bound, 0)], [*numbers, valid], strict=True):
        tracer.store(pointer(), place, x)
    text = _PROGRAM.format(name=symbol, lines=tracer.taken_lines())
    return "\n".join([*tracer.needs.values(), text])


def _write_some(write: Callable[..., str], others: Sequence[Floats], symbol: str) -> str:
    """A program with the ways of other states; without them where all are too long."""
    try:
        return write(others, symbol)
    except TraceError:
        if not others:
            raise
        return write((), symbol)


def program_rates(
    evaluator: Evaluator,
    count: int,
    time: float,
    state: Floats,
    varied: Varied,
    others: Sequence[Floats] = (),
) -> WideRates:
    """Functions of ``count`` sets: all but the right-hand side are left out where they have none.

    Args:
        evaluator: of the scene.
        count: sets of numbers.
        time, state: where branches are decided; a state as projections are given.
        varied: numbers that differ from set to set (symbolic_arrays.py).
        others: of projections, as of ``merged`` (ways.py).

    Raises:
        CompileError, TraceError: the scene has none; says why.
    """
    numbers = scene_program.constant_numbers(scene_program.constant_parts(evaluator, varied))
    name = scene_program.name_of(evaluator, state.size, numbers, varied)

    functions = {}
    for k in scene_program.programmed(evaluator):
        ways = partial(write_wide, evaluator, k, time, state, varied=varied)
        write = partial(_write_some, ways, others if k == PROJECT else ())
        with nullcontext() if k == RHS else suppress(CompileError, TraceError):
            unit = wide_unit(f"{name}-{k}x{count}", count, write, optimise=False)
            functions[k] = Entry(unit, 0, SIGNATURE)
    return WideRates(evaluator, state.size, count, None, functions, evaluator.loops.entries)


#: Kinds of group loops that it calls, and the arrays of a system that it reads and writes.
LOOPS = ("value", "wrench")
ARRAYS = (
    "body", "F", "par", "force",
    *(f"tree.{name}" for name in ("places", "constants", "work", "half_angles", "scratch")),
)  # fmt: skip


@compiled
def rhs(rates: Rates, system: System, loops: Any) -> None:
    """dy/dt as ``equations.rhs``, for trees without friction and states of elements."""
    t, y, out = rates.t[0], rates.y, rates.out
    sines = system.tree.half_angles[0]
    rates.bound[0] = largest_angle(y, sines.shape[0]) / (2.0 * LARGEST)
    small_half_angles(y, sines, system.tree.half_angles[1])
    place_nodes(y, system)
    apply_forces(t, system, loops)
    power = reduce_tree(system, system.force)
    spread_tree(y, out, system)
    out[out.shape[0] - 1] = power


def tree_rates(evaluator: Evaluator, count: int) -> WideRates:
    """The right-hand side of ``count`` sets of numbers of a tree without states of elements.

    Raises:
        CompileError: kernels of the scene decide by a number.
    """
    loops = _wide_loops(evaluator, count)
    functions = {RHS: wide_function(rhs, SIGNATURE.arguments, count)}
    return WideRates(evaluator, evaluator.coordinates.size + 1, count, ARRAYS, functions, loops)


def _wide_loops(evaluator: Evaluator, count: int) -> list[Entry]:
    """The group loops that a right-hand side calls; of others those of one scene."""
    loops = list(evaluator.loops.entries)
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        loop = write(group.type_info, kind) if kind in LOOPS else None
        if loop is not None:
            try:
                loops[q] = build_wide(loop, count)
            except CompileError as error:
                raise CompileError(f"{loop.name} {error}") from error
    return loops
