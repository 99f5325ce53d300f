"""The right-hand side of one scene as a straight-line program.

The functions of a formulation are run once with symbols for numbers: what is left is the arithmetic
of this scene. The program takes the place of the right-hand side in a table of functions, with a
projection that first evaluates the general right-hand side where it would read what that leaves.
Bits stay those of the general code.
"""

import inspect
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.formulations import PROJECT
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, constants
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import Item, StraightLine, Symbol
from dap3d_core.kernels.compiler.types import INT, Signature
from dap3d_core.kernels.compiler.units import Entry, Unit
from dap3d_core.kernels.runtime.cache import cache_folder, names_of, run_with_symbols
from dap3d_core.kernels.runtime.loop_modules import python_loop
from dap3d_core.kernels.runtime.source_digest import origin

#: Instructions of a program at most: larger scenes gain less, and take long to compile.
MOST_INSTRUCTIONS = 20_000
#: Arguments of a formulation's functions in LLVM IR.
ARGUMENTS = "double %t, ptr %y, i64 %y.1, ptr %out, i64 %out.1, ptr %system, ptr %loops"

_TEXT = """{needs}
declare void @{rhs}({arguments})
declare void @{project}({arguments})
@failures = internal global i64 0

define void @{symbols[0]}({arguments}) nounwind {{
entry:
{body}
  br i1 {guard}, label %stores, label %general, !prof !1
stores:
{stores}
  ret void
general:
  %count = load i64, ptr @failures
  %next = add i64 %count, 1
  store i64 %next, ptr @failures
  call void @{rhs}({arguments})
  ret void
}}

define void @{symbols[1]}({arguments}) nounwind {{
entry:
  %first = load double, ptr %out, align 8
  %valid = fcmp oeq double %first, 1.0
  br i1 %valid, label %evaluate, label %project
evaluate:
  %rates = alloca [{size} x double], align 8
  call void @{rhs}(double %t, ptr %y, i64 %y.1, ptr %rates, i64 {size}, ptr %system, ptr %loops)
  br label %project
project:
  call void @{project}({arguments})
  ret void
}}

define i64 @{symbols[2]}() nounwind {{
  %count = load i64, ptr @failures
  ret i64 %count
}}
!0 = !{{}}
!1 = !{{!"branch_weights", i32 1000, i32 1}}
"""


def formulation_module(evaluator: Evaluator) -> Any:
    """The module that has the functions of an evaluator's formulation."""
    formulation = evaluator.formulation
    own = formulation.has_own_coordinates
    name = evaluator.coordinates.equations if own else formulation.name
    return import_module(f"dap3d_core.formulations.{name}")


@IGNORE_FLOAT_ERRORS
def write_program(
    evaluator: Evaluator, time: float, state: Floats, symbols: Sequence[str], general: Sequence[str]
) -> str:
    """LLVM IR of right-hand side, projection, and the count of guards that failed.

    Args:
        evaluator: of the scene, as a run begins.
        time, state: where branches on numbers are decided.
        symbols: of the three functions.
        general: those of right-hand side and projection of any scene.

    Raises:
        TraceError: the program would be too long.
    """
    tracer = StraightLine(MOST_INSTRUCTIONS)
    system = SymbolicSystem(evaluator, tracer)
    y = np.array([Item(tracer, (lambda: "%y", k), x) for k, x in enumerate(state.tolist())], object)
    out = np.zeros(state.size, dtype=object)
    loops = [python_loop(write(group.type_info, kind)) for kind, group in evaluator.loop_groups]
    t_now = Symbol(tracer, tracer.at(t.Value(t.FLOAT, ("%t",)), time))
    with run_with_symbols():
        formulation_module(evaluator).rhs(t_now, y, out, system.struct, loops)
    guard = tracer.guard()
    stores = [(lambda: "%out", k, x) for k, x in enumerate(out)]
    body = "\n".join(tracer.lines)
    del tracer.lines[:]
    for pointer, k, x in (*stores, *system.stores()):
        tracer.store(pointer(), k, x)
    return _TEXT.format(
        needs="\n".join(tracer.needs.values()),
        rhs=general[0],
        project=general[1],
        arguments=ARGUMENTS,
        symbols=symbols,
        body=body,
        guard=guard,
        stores="\n".join(tracer.lines),
        size=state.size,
    )


def name_of(evaluator: Evaluator, size: int, numbers: Floats) -> str:
    """Name of the program of an evaluator: a digest of all that decides it.

    Args:
        evaluator: of the scene.
        size: of the state.
        numbers: constants of the program.
    """
    parts: list[str | bytes] = [f"{size} {evaluator.model.input_rows}", numbers.tobytes()]
    parts += [entry.unit.name for entry in _entries(evaluator)]
    for name, array in evaluator.system.walk():
        parts += [f"{name} {array.shape}", b"" if array.dtype == float else array.tobytes()]
    plain = inspect.unwrap(formulation_module(evaluator).rhs)
    return names_of("program", [plain], *parts, *origin([write_program]))[1]


def constant_numbers(evaluator: Evaluator) -> Floats:
    """The numbers of the scene that are constants of its program."""
    arrays = dict(evaluator.system.walk())
    found: Floats = np.concatenate(
        [arrays[name].reshape(-1)[places] for name, places in constants(evaluator)]
    )
    return found


def is_optimised(evaluator: Evaluator) -> bool:
    """True if the general code is what it will stay."""
    return all(entry.unit.is_optimised for entry in _entries(evaluator))


def _entries(evaluator: Evaluator) -> list[Entry]:
    return [*evaluator.functions.entries, *evaluator.loops.entries]


def is_kept(name: str) -> bool:
    """True if the cache folder has a program."""
    folder = cache_folder()
    return folder is not None and (folder / f"{name}.o").exists()


def made(
    name: str, evaluator: Evaluator, time: float, state: Floats
) -> tuple[tuple[int, int], Callable[[], int]]:
    """Addresses of a program's right-hand side and projection, and a count of its failed guards.

    From the cache folder, or compiled now.

    Args:
        name: of the program.
        evaluator: of the scene.
        time, state: where branches are decided.

    Raises:
        TypeError, ValueError, ArithmeticError: the scene has none; says why.
    """
    general = []
    for entry in evaluator.functions.entries[: PROJECT + 1]:
        general.append(entry.unit.symbols[entry.k])
        objects.name_address(general[-1], entry.unit.addresses[entry.k])

    def text(symbols: list[str]) -> tuple[str, list[Any]]:
        return write_program(evaluator, time, state, symbols, general), []

    unit = Unit(name, 3, text, cache_folder(), optimise=True)
    rates, project, _ = unit.addresses
    return (rates, project), Entry(unit, 2, Signature((), INT))
