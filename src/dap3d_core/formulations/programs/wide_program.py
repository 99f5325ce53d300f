"""Functions of one scene for several sets of its numbers at once.

They are programs of the scene (scene_program.py), widened (kernels/compiler/lanes.py). Where a
guard fails, the results of that lane are not valid, which ``bound`` says.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations import PROJECT, RHS, WATCH
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.programs.scene_program import (
    MOST_INSTRUCTIONS,
    constant_numbers,
    constant_parts,
    name_of,
    programmed,
    results,
)
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, Varied
from dap3d_core.formulations.programs.ways import Results, merged
from dap3d_core.formulations.wide_rates import SIGNATURE, Rates, WideRates
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import StraightLine
from dap3d_core.kernels.compiler.trace import Symbol, TraceError
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.lanes import wide_unit

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
    tracer = StraightLine(MOST_INSTRUCTIONS)
    members = [name for name, _ in Rates.type_of().members]

    def trace(state: Floats) -> tuple[Results, Any]:
        system = SymbolicSystem(evaluator, tracer, varied)
        given = Rates.of(time, state, evaluator)
        rates = system.symbolic(given, lambda: "%rates", "rates.")
        outcome = np.array([1.0, *np.zeros(given.outcome.size - 1)], dtype=object)
        out = results(evaluator, k, rates.t[0], rates.y, outcome, system.struct)
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
    numbers = constant_numbers(constant_parts(evaluator, varied))
    name = name_of(evaluator, state.size, numbers, varied)

    functions = {}
    for k in programmed(evaluator):
        ways = partial(write_wide, evaluator, k, time, state, varied=varied)
        write = partial(_write_some, ways, others if k == PROJECT else ())
        with nullcontext() if k == RHS else suppress(CompileError, TraceError):
            unit = wide_unit(f"{name}-{k}x{count}", count, write, optimise=False)
            functions[k] = Entry(unit, 0, SIGNATURE)
    names = [name for name, array in evaluator.system.walk() if array.dtype == float]
    loops = evaluator.loops.entries
    return WideRates(evaluator, state.size, count, names, functions, loops)
