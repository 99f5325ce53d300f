"""Right-hand side and projection of one scene as straight-line programs.

The functions of a formulation are run once with symbols for numbers: what is left is the arithmetic
of this scene (kernels/compiler/straight_line.py). A program leaves nothing in the arrays of the
system but what outlives an evaluation, so the projection, which may read what the right-hand side
of its state left, computes that itself.
"""

import ctypes
import inspect
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.formulations import OUTCOMES, PROJECT
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.programs.symbolic_arrays import SymbolicSystem, Varied, constants
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.straight_line import Item, StraightLine
from dap3d_core.kernels.compiler.trace import Symbol, TraceError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.cache import cache_folder, names_of, run_with_symbols
from dap3d_core.kernels.runtime.loop_modules import python_loop
from dap3d_core.kernels.runtime.source_digest import origin

#: Instructions of a program at most: larger scenes gain less, and take long to compile.
MOST_INSTRUCTIONS = 20_000
ARGUMENTS = "double %t, ptr %y, i64 %y.1, ptr %out, i64 %out.1, ptr %system, ptr %loops"

_PROGRAM = """
@{counter}.failures = internal global i64 0

define void @{name}({arguments}) nounwind {{
entry:
{head}
program:
{body}
  br i1 {guard}, label %stores, label %general, !prof !1
stores:
{stores}
  ret void
general:
  %count = load i64, ptr @{counter}.failures
  %next = add i64 %count, 1
  store i64 %next, ptr @{counter}.failures
  call void @{general}({arguments})
  ret void
}}

define i64 @{counter}() nounwind {{
  %count = load i64, ptr @{counter}.failures
  ret i64 %count
}}
"""
_HEAD = "  br label %program"
#: Of a projection at a state whose right-hand side was not the last one evaluated.
_PROJECTION_HEAD = """  %first = load double, ptr %out, align 8
  %valid = fcmp oeq double %first, 1.0
  br i1 %valid, label %program, label %alone
alone:
  call void @{project}({arguments})
  ret void"""
#: The general projection behind a general right-hand side, whose program left nothing.
_BEHIND = """
define void @{name}({arguments}) nounwind {{
entry:
{head}
program:
  %rates = alloca [{size} x double], align 8
  call void @{rhs}(double %t, ptr %y, i64 %y.1, ptr %rates, i64 {size}, ptr %system, ptr %loops)
  call void @{project}({arguments})
  ret void
}}
"""
_NONE = "define i64 @{counter}() nounwind {{\n  ret i64 0\n}}\n"
_WEIGHTS = '!0 = !{}\n!1 = !{!"branch_weights", i32 1000, i32 1}\n'


class Program(NamedTuple):
    """A loaded program in place of a function: its address, and how often a guard failed so far."""

    address: int
    failures: Callable[[], int]


def formulation_module(evaluator: Evaluator) -> Any:
    """The module that has the functions of an evaluator's formulation."""
    own = evaluator.formulation.has_own_coordinates
    name = evaluator.coordinates.equations if own else evaluator.formulation.name
    return import_module(f"dap3d_core.formulations.{name}")


def reads_rates(evaluator: Evaluator) -> bool:
    """True if a projection reads what the right-hand side leaves: where there are rows."""
    return evaluator.formulation.needs_joints and evaluator.length_count > 0


@IGNORE_FLOAT_ERRORS
def write_program(
    evaluator: Evaluator,
    time: float,
    state: Floats,
    names: dict[str, str],
    head: str = "",
    varied: Varied = None,
    tracer: StraightLine | None = None,
) -> tuple[str, dict[str, str]]:
    """LLVM IR of one program, and the declarations that it needs.

    Args:
        evaluator: of the scene, as a run begins.
        time, state: where branches on numbers are decided.
        names: of the program, its ``counter``, and the ``general`` function.
        head: of a projection, which is then behind the right-hand side.
        varied: as of ``constants``.
        tracer: records the program; left out, one of at most ``MOST_INSTRUCTIONS``.

    Raises:
        TraceError: the program would be too long.
    """
    tracer = tracer or StraightLine(MOST_INSTRUCTIONS)
    system = SymbolicSystem(evaluator, tracer, varied)
    y = _items(tracer, "%y", state)
    out = rates = np.zeros(state.size, dtype=object)
    loops = python_loops(evaluator)
    t_now = Symbol(tracer, tracer.at(t.Value(t.FLOAT, ("%t",)), time))
    module = formulation_module(evaluator)
    with run_with_symbols():
        module.rhs(t_now, y, rates, system.struct, loops)
        if head:
            first = np.zeros(OUTCOMES + evaluator.length_count)
            first[0] = 1.0
            out = _items(tracer, "%out", first)
            module.project(t_now, y, out, system.struct, loops)
    guard, body = tracer.guard(), tracer.taken_lines()
    for base, numbers in (("%out", out), ("%y", y if head else ())):
        for k, x in enumerate(numbers):
            tracer.store(base, k, x)
    for pointer, k, x in system.stores():
        tracer.store(pointer(), k, x)
    text = _PROGRAM.format(head=head or _HEAD, arguments=ARGUMENTS, body=body, guard=guard,
                           stores=tracer.taken_lines(), **names)  # fmt: skip
    return text, tracer.needs


def python_loops(evaluator: Evaluator) -> list[Callable[..., None]]:
    """The group loops of an evaluator in plain Python."""
    loops = [write(group.type_info, kind) for kind, group in evaluator.loop_groups]
    return [python_loop(loop) for loop in loops if loop is not None]  # all have been compiled


def _items(tracer: StraightLine, base: str, numbers: Floats) -> Any:
    return np.array(
        [Item(tracer, (lambda: base, k), x) for k, x in enumerate(numbers.tolist())], object
    )


def name_of(evaluator: Evaluator, size: int, numbers: Floats, varied: Varied = None) -> str:
    """Name of the programs of an evaluator: a digest of all that decides them.

    Args:
        evaluator: of the scene.
        size: of the state.
        numbers: constants of the programs.
        varied: as of ``constants``.
    """
    parts: list[str | bytes] = [f"{size} {evaluator.model.input_rows}", numbers.tobytes()]
    parts += [entry.unit.name for entry in _entries(evaluator)]
    for name, array in evaluator.system.walk():
        parts += [f"{name} {array.shape}", b"" if array.dtype == float else array.tobytes()]
    parts += [f"{name} {places.tolist()}" for name, places in (varied or {}).items()]
    plain = inspect.unwrap(formulation_module(evaluator).rhs)
    return names_of("program", [plain], *parts, *origin([write_program, constants]))[1]


def constant_parts(evaluator: Evaluator, varied: Varied = None) -> list[tuple[Floats, Integers]]:
    """Arrays of a system, flat, and the places there of constants of its programs."""
    arrays = dict(evaluator.system.walk())
    return [(arrays[name].reshape(-1), places) for name, places in constants(evaluator, varied)]


def constant_numbers(parts: list[tuple[Floats, Integers]]) -> Floats:
    """The numbers that are constants of programs, as they are now."""
    found: Floats = np.concatenate([array[places] for array, places in parts])
    return found


def is_optimised(evaluator: Evaluator) -> bool:
    """True if the general code is what it will stay."""
    return all(entry.unit.is_optimised for entry in _entries(evaluator))


def _entries(evaluator: Evaluator) -> list[Entry]:
    return [*evaluator.functions.entries, *evaluator.loops.entries]


def path_of(name: str) -> Path | None:
    """The object file of programs; None where there is no cache folder."""
    folder = cache_folder()
    return None if folder is None else folder / f"{name}.o"


def write_programs(
    evaluator: Evaluator, name: str, time: float, state: Floats, varied: Varied = None
) -> str:
    """LLVM IR of programs of right-hand side and, where it reads what that leaves, projection.

    Then the general projection behind a right-hand side of its own, for where guards of that
    program fail.

    Args:
        evaluator: of the scene, as a run begins.
        name: of the programs.
        time, state: where branches are decided.
        varied: as of ``constants``.

    Raises:
        TypeError, ValueError, ArithmeticError: the scene has none; says why.
    """
    rhs, project = (_named(entry) for entry in evaluator.functions.entries[: PROJECT + 1])
    symbols, size = symbols_of(evaluator, name), state.size
    names = {"name": symbols[0], "counter": symbols[1], "general": rhs}
    text, needs = write_program(evaluator, time, state, names, varied=varied)
    if len(symbols) > 2:
        head = _PROJECTION_HEAD.format(project=project, arguments=ARGUMENTS)
        names = {"name": symbols[2], "counter": symbols[3], "general": symbols[4]}
        behind = partial(_BEHIND.format, head=head, rhs=rhs, project=project,
                         arguments=ARGUMENTS, size=size)  # fmt: skip
        try:
            other, needed = write_program(evaluator, time, state, names, head, varied)
        except TraceError:  # too long: the right-hand side alone has a program
            other, needed = behind(name=symbols[2]) + _NONE.format(counter=symbols[3]), {}
        text, needs = text + other + behind(name=symbols[4]), needs | needed
    declared = [f"declare void @{symbol}({ARGUMENTS})" for symbol in (rhs, project)]
    return "\n".join([*needs.values(), *declared, text, _WEIGHTS])


def load_programs(evaluator: Evaluator, name: str, code: bytes) -> list[Program]:
    """Programs from their object code, in the order in which they were written."""
    for entry in evaluator.functions.entries[: PROJECT + 1]:
        _named(entry)
    symbols = symbols_of(evaluator, name)
    addresses = objects.load(code, symbols)
    programs = [
        Program(addresses[k], ctypes.CFUNCTYPE(ctypes.c_int64)(addresses[k + 1]))
        for k in range(0, len(symbols) - 1, 2)
    ]
    return [*programs, *(Program(address, int) for address in addresses[4:])]


def symbols_of(evaluator: Evaluator, name: str) -> list[str]:
    """Symbols of programs and their counters, and of the projection behind a right-hand side."""
    return [f"{name.replace('-', '_')}_{k}" for k in range(5 if reads_rates(evaluator) else 2)]


def _named(entry: Entry) -> str:
    """The symbol of a function, which programs find."""
    symbol = entry.unit.symbols[entry.k]
    objects.name_address(symbol, entry.unit.addresses[entry.k])
    return symbol
