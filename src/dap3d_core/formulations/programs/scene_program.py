"""Right-hand side, projection and switches of one scene as straight-line programs.

The functions of a formulation are run once with symbols for numbers: what is left is the arithmetic
of this scene (kernels/compiler/straight_line.py). A program leaves nothing in the arrays of the
system but what outlives an evaluation, so the projection, which may read what the right-hand side
of its state left, computes that itself.
"""

import ctypes
import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.formulations import OUTCOMES, PROJECT, REPORT, RHS, WATCH
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.programs.symbolic_arrays import (
    SymbolicSystem,
    Varied,
    constants,
    word_of,
)
from dap3d_core.formulations.programs.ways import Results, merged
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.derivatives import differentiate
from dap3d_core.kernels.compiler.straight_line import Item, StraightLine
from dap3d_core.kernels.compiler.trace import Symbol, TraceError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.cache import cache_folder, names_of, run_with_symbols
from dap3d_core.kernels.runtime.loop_modules import python_loop
from dap3d_core.kernels.runtime.source_digest import origin

#: Behind the indices of functions: the general projection behind a right-hand side of its own, for
#: where guards of that program fail.
BEHIND = -1
#: Among the indices of what was written: projections take all ways (ways.py).
ALL_WAYS = -2
#: End of the names of programs among which there is one of reports.
REPORTS = "-r"
#: In the names of those whose projection is of a state whose right-hand side is not known, as at
#: the ends of steps of a fixed length. Others have it behind the right-hand side of its state.
ALONE = "-alone"
#: Instructions of a program, and of that of reports, at most: larger scenes gain less, and take
#: long to compile.
MOST_INSTRUCTIONS, MOST_OF_REPORT = 22_000, 10_000
#: Guards of a report at most: where rows depend on each other it decides many ranks.
MOST_GUARDS = 150
#: Rates that are stored at once, as sums of stages load them.
STORED = 4
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
#: Of a right-hand side where switches were read before at this state: it is known.
_WATCHED_HEAD = """  %at = getelementptr inbounds i64, ptr %system, i64 {word}
  %watched = load ptr, ptr %at, align 8
  %time = load double, ptr %watched, align 8
  %valid = fcmp oeq double %time, %t
  br i1 %valid, label %known, label %program
known:
  call void @{rhs}({arguments})
  ret void"""
#: Of a projection, where its right-hand side was the last one evaluated, or was not, and its
#: program is of the other kind.
_PROJECTION_HEAD = """  %first = load double, ptr %out, align 8
  %valid = fcmp oeq double %first, {first}
  br i1 %valid, label %program, label %other
other:
  call void @{project}({arguments})
  ret void"""
#: The general projection, behind a general right-hand side where its program left nothing.
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
_WEIGHTS = '!0 = !{}\n!1 = !{!"branch_weights", i32 1000, i32 1}\n'


class Program(NamedTuple):
    """A loaded program in place of a function: its address, and how often a guard failed so far."""

    address: int
    failures: Callable[[], int]


def reads_rates(evaluator: Evaluator) -> bool:
    """True if a projection reads what the right-hand side leaves: where there are rows."""
    return evaluator.formulation.needs_joints and evaluator.length_count > 0


def results(
    evaluator: Evaluator, k: int, t_now: Any, y: Any, outcome: Any, struct: Any,
    is_behind: bool = True,
) -> Any:  # fmt: skip
    """What function k of an evaluator gives for symbols; a projection changes y, too.

    outcome: of a projection.
    is_behind: it is behind the right-hand side of its state.
    """
    with run_with_symbols():
        function, loops = evaluator.coordinates.function, python_loops(evaluator)
        if k == WATCH:
            values = np.zeros(len(evaluator.switches), dtype=object)
            function(WATCH)(t_now, y, values, struct, loops)
            return values
        if k == REPORT:
            values = np.zeros(evaluator.report_size, dtype=object)
            function(REPORT)(t_now, y, values, struct, loops)
            return values
        rates = np.zeros(y.size, dtype=object)
        if k == RHS or is_behind:
            function(RHS)(t_now, y, rates, struct, loops)
        if k == RHS:
            return rates
        function(PROJECT)(t_now, y, outcome, struct, loops)
        return outcome


@IGNORE_FLOAT_ERRORS
def write_program(
    evaluator: Evaluator,
    k: int,
    time: float,
    state: Floats,
    names: dict[str, str],
    head: str = _HEAD,
    varied: Varied = None,
    tracer: StraightLine | None = None,
    others: Sequence[Floats] | None = None,
    count: int = 1,
    is_behind: bool = True,
) -> tuple[str, dict[str, str]]:
    """LLVM IR of the program of one function, and the declarations that it needs.

    Args:
        evaluator: of the scene, as a run begins.
        k: the function, by its index.
        time, state: where branches on numbers are decided.
        names: of the program, its ``counter``, and the ``general`` function.
        head: the first block of its code.
        varied: as of ``constants``.
        tracer: records the program; left out, one of as many instructions as it may have.
        others: of a projection, as of ``merged`` (ways.py).
        count, is_behind: as of ``write_programs``, ``results``.

    Raises:
        TraceError: the program would be too long, or have too many guards.
    """
    most = MOST_OF_REPORT if k == REPORT else MOST_INSTRUCTIONS
    tracer = tracer or StraightLine(most)
    first = np.array([float(is_behind), *np.zeros(OUTCOMES - 1 + evaluator.length_count)])

    def trace(state: Floats) -> tuple[Results, Any]:
        system = SymbolicSystem(evaluator, tracer, varied)
        y, outcome = _items(tracer, "%y", state), _items(tracer, "%out", first)
        places, modes = mode_states(evaluator, state)
        y[places] = modes
        t_now = Symbol(tracer, tracer.at(t.Value(t.FLOAT, ("%t",)), time))
        out = results(evaluator, k, t_now, y, outcome, system.struct, is_behind)
        stores: list[tuple[Callable[[], str], int, Any]] = [
            *((lambda: "%out", place, x) for place, x in enumerate(out)),
            *((lambda: "%y", place, x) for place, x in enumerate(y if k == PROJECT else ())),
            *system.stores(),
        ]
        return Results([(base, place) for base, place, _ in stores], [x for *_, x in stores]), y

    found, guard = merged(evaluator, tracer, trace, state, others if k == PROJECT else None)
    if k == REPORT and len(tracer.guards) > MOST_GUARDS:
        raise TraceError(f"takes more than {MOST_GUARDS} guards")
    body = tracer.taken_lines()
    together = state.size // STORED * STORED if k == RHS and count == 1 else 0
    for place in range(0, together, STORED):
        tracer.store_together("%out", place, found.numbers[place : place + STORED])
    for (base, place), x in list(zip(found.places, found.numbers, strict=True))[together:]:
        tracer.store(base(), place, x)
    text = _PROGRAM.format(head=head, arguments=ARGUMENTS, body=body, guard=guard,
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


def mode_states(evaluator: Evaluator, state: Floats) -> tuple[Integers, Floats]:
    """Places in a state of constants that contacts have there, and their numbers."""
    if not evaluator.model.contact_count:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    from dap3d_core.formulations.programs import contact_modes

    return contact_modes.mode_states(evaluator, state)


def name_of(evaluator: Evaluator, size: int, numbers: bytes, varied: Varied = None) -> str:
    """Name of the programs of an evaluator: a digest of all that decides them.

    Args:
        evaluator: of the scene.
        size: of the state.
        numbers: constants of the programs, modes of contacts among them.
        varied: as of ``constants``.
    """
    parts: list[str | bytes] = [f"{size} {evaluator.model.input_rows}", numbers]
    parts += [entry.unit.name for entry in _entries(evaluator)]
    for name, array in evaluator.system.walk():
        parts += [f"{name} {array.shape}", b"" if array.dtype == float else array.tobytes()]
    parts += [f"{name} {places.tolist()}" for name, places in (varied or {}).items()]
    plain = inspect.unwrap(evaluator.coordinates.function(RHS))
    return names_of("program", [plain], *parts, *origin([write_program, constants]))[1]


def constant_parts(evaluator: Evaluator, varied: Varied = None) -> list[tuple[Floats, Integers]]:
    """Arrays of a system, flat, and the places there of constants of its programs."""
    arrays = dict(evaluator.system.walk())
    return [(arrays[name].reshape(-1), places) for name, places in constants(evaluator, varied)]


def constant_numbers(parts: list[tuple[Floats, Integers]]) -> bytes:
    """The numbers that are constants of programs, as they are now."""
    return b"".join([array.take(places).tobytes() for array, places in parts])


def is_optimised(evaluator: Evaluator) -> bool:
    """True if the general code is what it will stay."""
    return all(entry.unit.is_optimised for entry in _entries(evaluator))


def _entries(evaluator: Evaluator) -> list[Entry]:
    return [*evaluator.functions.entries, *evaluator.loops.entries]


def path_of(name: str) -> Path | None:
    """The object file of programs; None where there is no cache folder."""
    folder = cache_folder()
    return None if folder is None else folder / f"{name}.o"


def programmed(evaluator: Evaluator) -> list[int]:
    """Indices of the functions that have programs."""
    return [RHS, *([PROJECT] * reads_rates(evaluator)), *([WATCH] * bool(evaluator.switches))]


def write_programs(
    evaluator: Evaluator,
    name: str,
    time: float,
    state: Floats,
    varied: Varied = None,
    others: Sequence[Floats] | None = None,
    count: int = 1,
) -> tuple[str, list[int]]:
    """LLVM IR of the programs of a scene, and the indices of their functions.

    All but the right-hand side are left out where they would be too long. With projections comes
    ``BEHIND``; in differentiated form alone, as a projection that changes no value may change
    slopes, by other ways to other ones.

    Args:
        evaluator: of the scene, as a run begins.
        name: of the programs; ``REPORTS`` and ``ALONE`` in it say which there are.
        time, state: where branches are decided.
        varied: as of ``constants``.
        others: of projections, as of ``merged`` (ways.py), unless that were too long.
        count: numbers for each float of the functions: a value, and its derivatives.

    Raises:
        TypeError, ValueError, ArithmeticError: the scene has none; says why.
    """
    entries = evaluator.functions.entries
    found, general = [*programmed(evaluator), *([REPORT] * name.endswith(REPORTS))], {}
    texts, needs, written = list[str](), dict[str, str](), list[int]()
    first = float(ALONE not in name)
    for k in found:
        general[k] = _named(entries[k])
        head = _rates_head(evaluator, general[k]) if k == RHS else _HEAD
        own = zip(("name", "counter"), symbols_of(name, k), strict=True)
        names = dict(own, general=general[k])
        if k == PROJECT:
            names["general"] = behind = symbols_of(name, BEHIND)[0]
            head = _PROJECTION_HEAD.format(first=1.0, project=general[k], arguments=ARGUMENTS)
            texts.append(_BEHIND.format(name=behind, head=head, rhs=general[RHS], size=state.size,
                                        project=general[k], arguments=ARGUMENTS))  # fmt: skip
            head = _PROJECTION_HEAD.format(first=first, project=behind, arguments=ARGUMENTS)
            written.append(BEHIND)
            if count > 1:
                continue
        of = evaluator, k, time, state, names, head, varied, None
        for ways in (None,) if others is None or k != PROJECT else (others, None):
            try:
                text, needed = write_program(*of, ways, count, first == 1.0)
            except TraceError:
                if k == RHS:
                    raise
                continue
            texts.append(text)
            written += [k] if ways is None else [k, ALL_WAYS]
            needs |= needed
            break
    declared = [f"declare void @{symbol}({ARGUMENTS})" for symbol in general.values()]
    text = "\n".join([*needs.values(), *declared, *texts, _WEIGHTS])
    return text if count == 1 else differentiate(text, count), written


def _rates_head(evaluator: Evaluator, rhs: str) -> str:
    if not evaluator.system.watched.size:
        return _HEAD
    word = word_of(evaluator.system, "watched")
    return _WATCHED_HEAD.format(word=word, rhs=rhs, arguments=ARGUMENTS)


def load_programs(
    evaluator: Evaluator, name: str, written: list[int], code: bytes
) -> dict[int, Program]:
    """Programs from their object code, by the indices that were written."""
    for k in (*programmed(evaluator), REPORT):
        _named(evaluator.functions.entries[k])
    written = [k for k in written if k != ALL_WAYS]
    symbols = [symbols_of(name, k) for k in written]
    addresses = iter(objects.load(code, [symbol for pair in symbols for symbol in pair]))
    programs = {}
    for k, pair in zip(written, symbols, strict=True):
        address, *counter = (next(addresses) for _ in pair)
        count = ctypes.CFUNCTYPE(ctypes.c_int64)(counter[0]) if counter else int
        programs[k] = Program(address, count)
    if BEHIND in programs and PROJECT not in programs:
        programs[PROJECT] = programs.pop(BEHIND)
    return programs


def symbols_of(name: str, k: int) -> list[str]:
    """Symbols of a program and of what counts failures of its guards; ``BEHIND`` has none."""
    symbol = f"{name.replace('-', '_')}_{k if k >= 0 else 'behind'}"
    return [symbol] if k == BEHIND else [symbol, f"{symbol}_failures"]


def _named(entry: Entry) -> str:
    """The symbol of a function, which programs find."""
    symbol = entry.unit.symbols[entry.k]
    objects.name_address(symbol, entry.unit.addresses[entry.k])
    return symbol
