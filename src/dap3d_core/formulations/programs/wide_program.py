"""Right-hand side and projection of one scene for several sets of its numbers at once.

They are programs of the scene (scene_program.py), widened (kernels/compiler/lanes.py). Where a
guard fails, the results of that lane are not valid, which ``bound`` says.
"""

from contextlib import suppress

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.programs.scene_program import (
    MOST_INSTRUCTIONS,
    constant_numbers,
    constant_parts,
    formulation_module,
    name_of,
    python_loops,
    reads_rates,
)
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, Varied
from dap3d_core.formulations.wide_rates import SIGNATURE, Rates, WideRates
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import StraightLine
from dap3d_core.kernels.compiler.trace import Symbol, TraceError
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.cache import run_with_symbols
from dap3d_core.kernels.runtime.lanes import wide_unit

_PROGRAM = """
define void @{name}(ptr %rates, ptr %system, ptr %loops) nounwind {{
entry:
{lines}
  ret void
}}
"""
#: What ``bound`` is where all guards hold, and where one fails.
VALID, INVALID = 0.0, 2.0


@IGNORE_FLOAT_ERRORS
def write_wide(
    evaluator: Evaluator, time: float, state: Floats, symbol: str, varied: Varied, projects: bool
) -> str:
    """LLVM IR of a right-hand side, or projection, as a function of ``Rates``, for one set.

    Raises:
        TraceError: the program would be too long.
        CompileError: an evaluation leaves something to the next one.
    """
    tracer = StraightLine(MOST_INSTRUCTIONS)
    system = SymbolicSystem(evaluator, tracer, varied)
    given = Rates.of(time, state, evaluator.length_count)
    rates = system.symbolic(given, lambda: "%rates", "rates.")
    with run_with_symbols():
        module, loops = formulation_module(evaluator), python_loops(evaluator)
        out = np.zeros(state.size, dtype=object)
        module.rhs(rates.t[0], rates.y, out, system.struct, loops)
        if projects:
            outcome = np.array([1.0, *np.zeros(given.outcome.size - 1)], dtype=object)
            module.project(rates.t[0], rates.y, outcome, system.struct, loops)
    if system.stores():
        raise CompileError("an evaluation leaves something to the next one")
    valid: Symbol | float = VALID
    if (guard := tracer.guard()) != "true":
        word = tracer.new(f"select i1 {guard}, double {VALID}, double {INVALID}")
        valid = Symbol(tracer, t.Value(t.FLOAT, (word,)))
    results = {"y": rates.y, "outcome": outcome} if projects else {"out": out}
    members = [name for name, _ in Rates.type_of().members]
    for name, numbers in {**results, "bound": [valid]}.items():
        pointer = system.pointer(lambda: "%rates", 2 * members.index(name))
        for k, x in enumerate(numbers):
            tracer.store(pointer(), k, x)
    text = _PROGRAM.format(name=symbol, lines=tracer.taken_lines())
    return "\n".join([*tracer.needs.values(), text])


def program_rates(
    evaluator: Evaluator, count: int, time: float, state: Floats, varied: Varied
) -> WideRates:
    """Right-hand side and, where it reads what that leaves, projection of ``count`` sets.

    Args:
        evaluator: of the scene.
        count: sets of numbers.
        time, state: where branches are decided; a state as projections are given.
        varied: numbers that differ from set to set (symbolic_arrays.py).

    Raises:
        CompileError, TraceError: the scene has none; says why.
    """
    numbers = constant_numbers(constant_parts(evaluator, varied))
    name = name_of(evaluator, state.size, numbers, varied)

    def entry(projects: bool) -> Entry:
        def text(symbol: str) -> str:
            return write_wide(evaluator, time, state, symbol, varied, projects)

        kind = "projection" if projects else "rates"
        unit = wide_unit(f"{name}-{kind}{count}", count, text, optimise=False)
        return Entry(unit, 0, SIGNATURE)

    functions = [entry(False)]
    if reads_rates(evaluator):
        with suppress(CompileError, TraceError):  # then each set is projected by itself
            functions.append(entry(True))
    names = [name for name, array in evaluator.system.walk() if array.dtype == float]
    loops = evaluator.loops.entries
    return WideRates(evaluator, state.size, count, names, functions, loops)
