"""The C text that belongs to one model: its memory, tables and variables."""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.metric import METRIC_WIDTH
from dap3d_core.formulations import REPORT
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.jumps.jump_arrays import CROSSING, SIDE, JumpArrays
from dap3d_core.integrators.moreau.step import START_ALONE
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import IntegrationState
from dap3d_core.kernels.compiler.units import Entry, Unit
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, V, W
from dap3d_core.native.run.directions import Directions, PairEntry, PairUnit
from dap3d_core.native.run.elements import Elements
from dap3d_core.native.run.limits import OPEN, Limits
from dap3d_core.native.run.outputs import Output
from dap3d_core.native.run.parameters import mass_numbers
from dap3d_core.native.run.prepared import Advance, ContactCode, PreparedRun
from dap3d_core.simulation.events import contact_jumps
from dap3d_core.study.batch import initial_state

KINDS = ("time", "input", "parameter", "output", "state", "derivative", "indicator", "fixed")
#: Of these those that are parameters: set at any time, and before a run begins.
PARAMETERS = ("parameter", "fixed")
#: Limits of contact_jumps.py that the runtime has as well: gaps that touch; what comes to no end.
LIMITS = ("TOUCHING", "TOUCHING_AT_START", "MOST_CHANGES", "WITHIN", "MOST_JAMS", "RATTLING",
          "MOST_STEPS", "SLOW")  # fmt: skip
#: Units of the quantities of states, but 1; of rates, that are not the unit over s.
STATE_UNITS = {"r": "m", "v": "m/s", "w": "rad/s"}
RATE_UNITS = {"1": "1/s", "m/s": "m/s^2", "rad/s": "rad/s^2"}


@attrs.frozen
class Variable:
    """A variable of an exported model.

    Attributes:
        name, unit, label: as in results.
        kind: one of KINDS.
        first: word of an input; of a parameter 1 where the start depends on it; index of others.
        start: its value at the start.
        words: of a parameter: words of the memory that it is, each with its sign.
        is_mean: an output that is no function of the state, but a mean of a step of contacts.
        limits: of a parameter.
    """

    name: str
    kind: str
    unit: str
    label: str
    first: int
    start: float = 0.0
    words: tuple[tuple[int, float], ...] = ()
    is_mean: bool = False
    limits: Limits = OPEN


def variables_of(
    prepared: PreparedRun, outputs: Sequence[Output], parameters: Sequence[Variable]
) -> list[Variable]:
    """The variables of a model in the order of their references."""
    evaluator, image = prepared.evaluator, prepared.image
    model, F = evaluator.model, evaluator.system.F
    units = [*(STATE_UNITS.get(q, "1") for q in evaluator.coordinates.quantities), "J"]
    found = [Variable("time", "time", "s", "time", 0)]
    for name, row, value in zip(
        model.input_names, model.input_rows.tolist(), model.input_values.tolist(), strict=True
    ):
        word = image.at(F) + row * F.shape[1]
        found.append(Variable(name, "input", "1", f"input {name}", word, value))
    found += parameters
    means = prepared.steps_contacts
    found += [
        Variable(o.name, "output", o.unit, o.label, k, is_mean=means and not o.is_of_state)
        for k, o in enumerate(outputs)
    ]
    y = prepared.run.present.work.state[at.Y].tolist()
    states = list(enumerate(zip(prepared.state_names, units, y, strict=True)))
    found += [Variable(n, "state", unit, n, k, x) for k, (n, unit, x) in states]
    if means:
        return found
    found += [
        Variable(
            f"der({n})", "derivative", RATE_UNITS.get(unit, f"{unit}/s"), f"derivative of {n}", k
        )
        for k, (n, unit, _) in states
    ]
    switches = range(prepared.run.present.work.switches.shape[1])
    return found + [
        Variable(f"switch.{k + 1}", "indicator", "1", f"switch {k + 1}", k) for k in switches
    ]


def symbols_of(unit: Unit | PairUnit) -> list[str]:
    """C names of the functions of a unit in an exported model."""
    name = unit.ready_name or unit.name  # equal files wherever the code is from
    digest = hashlib.sha256(name.encode()).hexdigest()[:16]
    return [f"dap3d_{digest}_{k}" for k in range(len(unit.symbols))]


def symbol_of(entry: Entry | PairEntry) -> str:
    """The C name of a function."""
    return symbols_of(entry.unit)[entry.k]


@attrs.frozen
class CalledUnit:
    """A unit of compiled code that a run calls.

    Attributes:
        unit: the unit.
        kept: numbers of the functions of it that are called.
        is_hot: steps call it.
    """

    unit: Unit | PairUnit
    kept: set[int]
    is_hot: bool


def units_of(prepared: PreparedRun, directions: Directions | None) -> list[CalledUnit]:
    """The units of compiled code that a run calls."""
    image, start = prepared.image, prepared.start
    rare: list[Entry | PairEntry] = [*start.functions.entries] if start else []
    entries: list[Entry | PairEntry] = [e for e in image.functions.values() if e not in rare]
    for one in prepared.advances:
        entries.append(one.entry)
        rare += [] if one.completes is None else [one.completes]
    law = prepared.jumps
    rare += [law.entry] if law else []
    rare += [law.follows] if isinstance(law, ContactCode) and law.follows else []
    rare += directions.entries if directions else []
    kept: dict[str, set[int]] = {}
    for entry in [*rare, *entries]:
        kept.setdefault(entry.unit.name, set()).add(entry.k)
    hot = {entry.unit.name for entry in entries}
    units = {entry.unit.name: entry.unit for entry in [*rare, *entries]}
    return [CalledUnit(unit, kept[name], name in hot) for name, unit in units.items()]


def data_of(
    prepared: PreparedRun,
    variables: Sequence[Variable],
    elements: Elements,
    directions: Directions | None,
) -> str:
    """The text of data.h: what runtime.c takes from one model."""
    lines = _numbers(prepared, variables)
    lines += _enumeration("R", IntegrationState.indices("real"))
    lines += _enumeration("I", IntegrationState.indices("integer"))
    lines += _enumeration("J", JumpArrays.indices("real"))
    lines += _enumeration("JI", JumpArrays.indices("integer"))
    lines += _enumeration("CI", ContactArrays.indices("integer"))
    lines += _memory(prepared)
    lines += _completion(prepared)
    lines += _jumps(prepared)
    lines += _start(prepared, variables)
    lines += _elements(prepared, elements)
    lines += _directions(prepared, elements, directions)
    lines += _table(
        "static const struct { double t; int jumps; double needs; } stops[]",
        (f"{{{s.t.hex()}, {int(s.jumps)}, {s.needs.hex()}}}" for s in prepared.stops)
        if prepared.stops else ["{0.0, 0, 0.0}"],
    )  # fmt: skip
    lines += _variables(variables)
    lines.append(f"void dap3d_outputs({', '.join(['const double *'] * 4)}, double *);")
    text = "\n".join(lines)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    return f"#define IDENTITY 0x{digest}ULL\n{text}\n"


def _numbers(prepared: PreparedRun, variables: Sequence[Variable]) -> list[str]:
    """Sizes and places."""
    image, system = prepared.image, prepared.evaluator.system
    work = prepared.run.present.work
    outputs = sum(v.kind == "output" for v in variables)
    numbers = {
        "WORDS": len(image.words),
        "STATES": work.state.shape[1],
        "ROW": work.rows.shape[1],
        "CAPACITY": len(work.rows),
        "OUTPUTS": outputs,
        "INPUTS": sum(v.kind == "input" for v in variables),
        "VARIABLES": len(variables),
        "SWITCHES": work.switches.shape[1],
        "PROJECTED": len(work.real) - at.PROJECTED,
        "DRIVES": int(prepared.drives),
        "IMPLICIT": int(prepared.run.present.implicit),
        "INTEGRATIONS": len(prepared.advances),
        "STOPS": len(prepared.stops),
        "FUNCTIONS": image.at(prepared.functions),
        "REPORT_CODE": symbol_of(prepared.functions.entries[REPORT]),
        # the iteration for forces on reactions begins with what was reported last
        "REPORTS": int(bool(prepared.evaluator.model.iterated_forces or prepared.jumps)),
        "SYSTEM": image.at(system),
        "LOOPS": image.at(prepared.evaluator.loops),
        "BODIES": image.at(system.body),
        "VALUES": image.at(system.F),
        "BODY_COUNT": prepared.evaluator.model.body_count,
        "ELEMENT_STATES": len(prepared.evaluator.model.initial_states),
        "BODY_WIDTH": BODY_WIDTH,
        "BODY_V": V,
        "BODY_W": W,
        "BODY_A": A,
        "BODY_MASS": MASS,
        "BODY_JP": JP,
    }
    return _defined(numbers)


def _defined(numbers: Mapping[str, Any]) -> list[str]:
    return [f"#define {name} {value}" for name, value in numbers.items()]


def _variables(variables: Sequence[Variable]) -> list[str]:
    """Tables of variables and parameters, with places in one text: addresses take more room."""
    rows, places, first, size = [], [], 0, 0
    starts: dict[str, int] = {}
    for v in variables:
        place = first if v.kind in PARAMETERS else v.first
        first += len(v.words)
        for text in (v.name, v.unit, *(said for *_, said in v.limits.ends if said)):
            if text not in starts:
                starts[text], size = size, size + len(text.encode()) + 1
        texts = f"{starts[v.name]}, {starts[v.unit]}"
        numbers = f"{place}, {len(v.words)}, {int(v.is_mean)}"
        low, high = (f"{x!r}, {starts.get(said, 0)}" for x, _, said in v.limits.ends)
        places += [f"{{{word}, {sign:g}, {low}, {high}}}" for word, sign in v.words]
        rows.append(f"{{{texts}, DAP3D_{v.kind.upper()}, {numbers}}}")
    texts_of = [f'    {c_text(text)} "\\0"' for text in starts]
    head = "static const struct { int name, unit, kind, first, count, is_mean; } variables[]"
    head_of_places = (
        "static const struct {\n    int64_t word;\n    double sign, low;\n    int below;\n"
        "    double high;\n    int above;\n} places[]"
    )
    at = {v.name: k for k, v in enumerate(variables)}
    orders = [
        f"{{{k}, {at[name]}, {int(is_open)}}}"
        for k, v in enumerate(variables) for name, is_open in v.limits.under
    ]  # fmt: skip
    lines = ["static const char texts[] =", *texts_of, ";", *_table(head, rows)]
    lines.append(f"#define ORDERS {len(orders)}")
    lines += _table("static const struct { int low, high, is_open; } orders[]",
                    orders or ["{0, 0, 0}"])  # fmt: skip
    return lines + _table(head_of_places, places or ["{0, 1.0, 0.0, 0, 0.0, 0}"])


def c_text(text: str) -> str:
    """A string literal of C; other characters than those of ASCII by their bytes."""
    escaped = "".join(
        chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in text.encode()
    )
    return f'"{escaped}"'


def _enumeration(prefix: str, indices: dict[str, int]) -> list[str]:
    items = ", ".join(f"{prefix}_{name} = {k}" for name, k in indices.items())
    return [f"enum {{ {items} }};"]


def _table(head: str, rows: Iterable[str]) -> list[str]:
    return [f"{head} = {{", *(f"    {row}," for row in rows), "};"]


def _memory(prepared: PreparedRun) -> list[str]:
    """Content of the memory without its zeros, and its addresses."""
    image = prepared.image
    runs, content = [], []
    filled = np.flatnonzero(image.words).tolist()
    for _, group in groupby(enumerate(filled), lambda pair: pair[1] - pair[0]):
        part = [word for _, word in group]
        runs.append(f"{{{part[0]}, {len(part)}}}")
        content += [f"0x{int(image.words[word]) % 2**64:x}ULL" for word in part]
    rows = [", ".join(content[k : k + 6]) for k in range(0, len(content), 6)]
    lines = _table("static const uint32_t runs[][2]", runs)
    lines += _table("static const uint64_t content[]", rows)
    pairs = sorted(image.addresses.items())
    lines += _table("static const uint32_t addresses[][2]", (f"{{{a}, {b}}}" for a, b in pairs))
    functions = {word: symbol_of(entry) for word, entry in sorted(image.functions.items())}
    lines += [f"void {symbol}(void);" for symbol in dict.fromkeys(functions.values())]
    codes = (f"{{{word}, {symbol}}}" for word, symbol in functions.items())
    lines += _table("static const struct { uint32_t word; void (*code)(void); } codes[]", codes)
    for k, one in enumerate(prepared.advances):
        lines += _loop(prepared, k, one)
    rows = [_integration(prepared, k, one) for k, one in enumerate(prepared.advances)]
    return lines + _table(
        "static const struct {\n    int64_t real, integer, state, times, rows, sides, stops;\n"
        "    int keeps_step;\n    void (*advance)(int64_t *, int64_t);\n} integrations[]",
        rows,
    )


def _loop(prepared: PreparedRun, k: int, one: Advance) -> list[str]:
    """The function advance_K, which calls a compiled loop."""
    symbol = symbol_of(one.entry)
    types = ", ".join(["void *"] * len(one.arguments))
    given = ", ".join(f"w + {prepared.image.at(part)}" for part in one.arguments)
    return [
        f"void {symbol}({types}, int64_t);",
        f"static void advance_{k}(int64_t *w, int64_t budget) {{ {symbol}({given}, budget); }}",
    ]


def _completion(prepared: PreparedRun) -> list[str]:
    """The function complete, which puts means of steps of contacts into a row."""
    one = prepared.advances[0]
    if one.completes is None:
        return ["#define COMPLETES 0"]
    symbol, place, (work, arrays) = symbol_of(one.completes), prepared.image.at, one.arguments[:2]
    s, first = prepared.evaluator.system.states, arrays.first_state
    # modes are of the step as well, and contacts say the rest by them
    takes = f"memcpy(w + {place(s)}, row + {first}, {s.nbytes});" if s.size else ""
    return [
        "#define COMPLETES 1",
        f"#define PUSHED {place(work.pushed)}",
        f"#define STAGE {place(arrays.integer) + arrays.indices('integer')['stage']}",
        f"#define START_ALONE {START_ALONE}",
        f"void {symbol}(void *, void *, double *, int64_t);",
        "static void complete(int64_t *w, double *row)",
        f"{{ {symbol}(w + {place(work)}, w + {place(arrays)}, row, ROW); {takes} }}",
    ]


def _jumps(prepared: PreparedRun) -> list[str]:
    """What happens where velocities jump, and where its arrays are; nothing where they do not."""
    law, place = prepared.jumps, prepared.image.at
    if law is None:
        return ["#define JUMPS 0", "#define CONTACTS 0"]
    switches = prepared.run.present.work.switch_count
    numbers = {
        "CROSSED_BEHIND_SIDES": (at.CROSSED - at.SIDE) * switches,
        "COUNT_BEHIND_SIDES": (at.COUNT - at.SIDE) * switches,
    }
    if isinstance(law, ContactCode):
        return [*_defined(numbers), *_contacts(law, place)]
    j = law.arguments[0]
    numbers |= {
        "JUMPS": 1,
        "CONTACTS": 0,
        "JUMP_REAL": place(j.real),
        "JUMP_INTEGER": place(j.integer),
        "JUMP_Y": place(j.y),
        "JUMP_SIDES": place(j.switches[SIDE]),
        "JUMP_CROSSING": place(j.switches[CROSSING]),
        "JUMP_ACTING": place(j.acting),
        "ELEMENTS": j.acting.size,
        "DOES_JUMP": place(j.jumps),
    }
    return [*_defined(numbers), *_law("void", "jump_law", law.entry, law.arguments, place)]


def _contacts(law: ContactCode, place: Callable[[Any], int]) -> list[str]:
    """The same of contacts that events follow."""
    s = law.arguments[0]
    names = ("y", "integer", "limit", "length", "arm", "ended", "switches", "state")
    numbers: dict[str, Any] = {"JUMPS": 0, "CONTACTS": len(law.names)}
    numbers |= {name: getattr(contact_jumps, name) for name in LIMITS}
    numbers |= {f"CONTACT_{name.upper()}": place(getattr(s, name)) for name in names}
    return [
        *_defined(numbers),
        *_table("static const char *const contact_names[]", map(c_text, law.names)),
        *_law("int64_t", "contact_law", law.entry, law.arguments, place),
        *(
            _law("void", "follow_drivers", law.follows, law.arguments[:3], place)
            if law.follows
            else []
        ),
    ]


def _law(
    result: str, name: str, entry: Entry, arguments: Sequence[Any], place: Callable[[Any], int]
) -> list[str]:
    """A C function that calls a function of time on the arrays of a run."""
    symbol, types = symbol_of(entry), ", ".join(["void *"] * len(arguments))
    given = ", ".join(f"w + {place(part)}" for part in arguments)
    call = f"{'' if result == 'void' else 'return '}{symbol}(t, {given})"
    return [
        f"{result} {symbol}(double, {types});",
        f"static {result} {name}(double t, int64_t *w) {{ {call}; }}",
    ]


def _elements(prepared: PreparedRun, elements: Elements) -> list[str]:
    """Calls of loops for outputs."""
    if not elements.calls:
        return ["#define CALLS 0", "#define VALUES_OF_ELEMENTS 0"]
    system, place, arrays = prepared.evaluator.system, prepared.image.at, elements.arrays
    values, layout = place(arrays.values), prepared.evaluator.model.report_layout["Lam"]
    rows = [
        [place(c.table), c.q, place(c.arrays), *c.group, c.first, c.size, *c.more]
        for c in elements.calls
    ]
    numbers = {
        "CALLS": len(rows),
        "VALUES_OF_ELEMENTS": values,
        "MINUS_LAMBDA": values + elements.minus,
        "COUNTER": values + elements.counter,
        "MULTIPLIERS": layout.stop - layout.start,
        "MULTIPLIER": 1 + prepared.run.present.work.state.shape[1] + layout.start,
        "ROW_OF": place(system.row) if layout.stop > layout.start else 0,
    }
    lines = _defined(numbers)
    head = ("static const struct { int64_t table, q, arrays, i0, p0, out, size, second, third; } "
            "calls[]")  # fmt: skip
    return [*lines, *_table(head, (f"{{{', '.join(map(str, row))}}}" for row in rows))]


def _directions(
    prepared: PreparedRun, elements: Elements, directions: Directions | None
) -> list[str]:
    """The second memory, and differentiated functions."""
    if directions is None:
        return ["#define DIRECTIONS 0"]
    place, arrays, evaluator = prepared.image.at, directions.arrays, prepared.evaluator
    addresses, shapes = directions.tables()
    codes = {word: symbol_of(entry) for word, entry in directions.codes.items()}
    numbers = {
        "DIRECTIONS": 1,
        "ALONG_ROW": place(arrays.row),
        "ALONG_RATES": place(arrays.rates),
        "ALONG_OUT": place(arrays.out),
    }
    lines = _defined(numbers)
    lines += [f"void {symbol}(void);" for symbol in dict.fromkeys(codes.values())]
    lines += _table("static const uint32_t wide_addresses[][3]",
                    (f"{{{a}, {b}, {c}}}" for a, b, c in addresses))  # fmt: skip
    lines += _table("static const uint32_t wide_shapes[][2]", (f"{{{a}, {b}}}" for a, b in shapes))
    lines += _table("static const struct { uint32_t word; void (*code)(void); } wide_codes[]",
                    (f"{{{word}, {symbol}}}" for word, symbol in codes.items()))  # fmt: skip
    four = "void *, void *, void *, void *"
    given = [arrays, prepared.functions, evaluator.system, evaluator.loops]
    for name, entry in (("rates", directions.rates), ("report", directions.report)):
        if entry is None:
            continue
        words, symbol = ", ".join(f"x + {2 * place(part)}" for part in given), symbol_of(entry)
        lines.append(f"void {symbol}({four});")
        lines.append(f"static void {name}_along(double *x) {{ {symbol}({words}); }}")
    lines.append("static void elements_along(double *x)\n{\n    (void)x;")
    for call, one in zip(elements.calls, directions.elements, strict=True):
        parts = arrays, elements.arrays, call.table, call.arrays
        more = [call.q, *call.group, call.first, *call.more]
        all_words = [*(f"x + {2 * place(part)}" for part in parts), *map(str, more)]
        lines.append(f"    void {symbol_of(one)}({four}, {', '.join(['int64_t'] * 6)});")
        lines += ["    x[2 * COUNTER] = 0.0;", f"    {symbol_of(one)}({', '.join(all_words)});"]
    return [*lines, "}", f"void {directions.symbol}({', '.join(['double *'] * 5)});"]


def _start(prepared: PreparedRun, variables: Sequence[Variable]) -> list[str]:
    """Where the start is found anew for parameters that it depends on, if there are any."""
    fixed = [v for v in variables if v.kind == "fixed"]
    if not fixed or prepared.start is None:
        return ["#define FIXED 0"]
    start, system, place = prepared.start, prepared.evaluator.system, prepared.image.at
    body = place(system.body)
    owned = {(w - body) // BODY_WIDTH for v in fixed for w, _ in v.words
             if 0 <= w - body < system.body.size}  # fmt: skip
    numbers = {
        "FIXED": 1,
        "ASSEMBLES": int(start.assembles),
        "GIVEN": place(start.arrays.given),
        "UNIT": place(start.arrays.unit),
        "STARTING": place(start.arrays.starting),
        "STARTING_SIZE": len(start.arrays.starting),
        "START_OPEN": initial_state.OPEN,
        "START_PIVOT": initial_state.LEAST_PIVOT,
        "BEGIN": place(start.functions),
        "METRIC": place(system.metric),
        "METRIC_WIDTH": METRIC_WIDTH,
        **mass_numbers(prepared),
    }
    lines = _defined(numbers)
    lines += _table("static const int heavy[]", map(str, sorted(owned) or [0]))
    moving = [str(k) for k, v in enumerate(variables) if v.kind == "fixed" and v.first]
    return [*lines, *_table("static const int moving[]", moving or ["-1"])]


def _integration(prepared: PreparedRun, k: int, one: Advance) -> str:
    work, place = one.integration.work, prepared.image.at
    arrays: list[Any] = [work.real, work.integer, work.state, work.times, work.rows]
    words = [str(place(array)) for array in arrays]
    words.append(str(place(work.switches[at.SIDE]) if work.switch_count else 0))
    words.append(str(place(work.stops) if prepared.stops else 0))
    return f"{{{', '.join(words)}, {int(one.integration.keeps_step)}, advance_{k}}}"
