"""Readers of single values: each returns the value as it is used, or a ``Fault``."""

import math
import re
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

from dap3d_core.interface.fields import FieldSpec
from dap3d_core.registry.suggestions import nearest, some
from dap3d_core.scene.coerce import plain

#: Beyond this size products of two numbers leave double precision.
LARGEST = 1e100
#: A number in quotes, and the length up to which it is recognised.
_NUMBER, LONGEST_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"), 60
#: A number and the name of its unit; units of angles and of their rates, in rad and rad/s.
_ANGLE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z][A-Za-z/ ]*)")
ANGLE_UNITS: dict[str, dict[str, float]] = {
    "rad": {"deg": math.pi / 180.0, "rad": 1.0},
    "rad/s": {"deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "rad/s": 1.0},
}
#: Euler parameters farther from unit length are refused; those farther than the second are noted.
UNIT_TOLERANCE = 1e-6
UNIT_LENGTH_ROUNDING = 1e-9
#: A shorter vector has no direction.
SHORTEST = 1e-12
#: Entries of a list that a message tells the faults of.
MOST_FAULTS = 4
#: An angle beyond a full turn is probably given in degrees.
TURN = 6.283185307179586
MANY_TURNS = "is more than a full turn; angles are in rad"


class Fault(NamedTuple):
    """The fault of a value, its remedy, the nearest right spelling."""

    what: str
    remedy: str = ""
    nearest: str = ""


def number_of(value: Any) -> float | Fault:
    """A finite number as a float; text and truth values are no numbers."""
    if type(value) is float and -LARGEST <= value <= LARGEST:
        return value
    value = plain(value)
    if type(value) in (float, int) and -LARGEST <= value <= LARGEST:
        return float(value)
    return _number_fault(value)


def _number_fault(value: Any) -> Fault:
    should = "should be a number"
    if type(value) is str:
        written = value.strip().replace(",", ".")
        if written.startswith("="):
            return Fault(should, "an expression needs [parameters], and is in no [simulation]")
        remedy, is_short = "", len(written) <= LONGEST_NUMBER
        if is_short and _NUMBER.fullmatch(written):
            remedy = f"write {written} without quotes"
        elif is_short and (number := _NUMBER.match(written)):
            remedy = "write a number without its unit, in SI units"
            if (unit := written[number.end() :].strip()) in ("deg", "rpm", "mm"):
                remedy += f', or "= {number[0]} * {unit}" in a scene with [parameters]'
        elif is_short and written.isidentifier():
            remedy = f'write "= {written}" for a parameter'
        return Fault(f"{should}, not text", remedy)
    if type(value) is bool:
        return Fault(f"{should}, not a truth value")
    if type(value) is int or (type(value) is float and math.isfinite(value)):
        return Fault(f"{should} of at most {LARGEST:g} in size: products of larger ones overflow")
    if type(value) is float:
        remedy = "numbers beyond 1.8e+308 are read as inf" if math.isinf(value) else ""
        return Fault(f"should be a finite number, not {value}", remedy)
    if type(value) is tuple:
        return Fault(f"{should}, not a list of {len(value)}")
    return Fault(f"{should}, not {_kind(value)}")


def angle_of(value: Any, unit: str = "rad") -> float | Fault:
    """A number in a unit of angles, rad or rad/s; or a text with its own unit, such as "30 deg"."""
    if type(value) is not str:
        return number_of(value)
    found = _ANGLE.fullmatch(value.strip())
    if found is None:
        return _number_fault(value)
    number, given = float(found[1]), found[2].replace(" ", "")
    known = ANGLE_UNITS[unit]
    if given not in known:
        close = nearest(given, known) or next(iter(known))
        words = ", ".join(f'"{found[1]} {name}"' for name in known)
        return Fault(f"should be in one of {', '.join(known)}", f"write {words}", close)
    return number_of(number * known[given])


def numbers_of(value: Any, count: int) -> Any:
    """Exactly ``count`` finite numbers as a tuple."""
    if type(value) is tuple and len(value) == count:
        for x in value:
            if type(x) is not float or not -LARGEST <= x <= LARGEST:
                break
        else:
            return value
    value = plain(value)
    should = f"should be a list of {count} numbers"
    if type(value) is not tuple:
        return Fault(f"{should}, not {_kind(value)}")
    if len(value) != count:
        hint = "write one row only" if value and type(value[0]) is tuple else ""
        return Fault(f"{should}; it has {len(value)}", hint)
    return _entries(value, number_of, should, "entry")


def _entries(value: tuple[Any, ...], reader: Callable[[Any], Any], should: str, noun: str) -> Any:
    """The entries of a list, each read; the faults of the invalid ones, with the first remedy."""
    entries = tuple(map(reader, value))
    faults = [(k, entry) for k, entry in enumerate(entries, 1) if isinstance(entry, Fault)]
    if not faults:
        return entries
    told = some([f"{noun} {k} {fault.what}" for k, fault in faults], MOST_FAULTS, "; ")
    return Fault(f"{should}; {told}", faults[0][1].remedy)


def points_of(value: Any) -> Any:
    """Two or more points of 3 numbers each."""
    value, should = plain(value), "should be a list of two or more points of 3 numbers each"
    if type(value) is not tuple or len(value) < 2:
        return Fault(should)
    return _entries(value, lambda point: numbers_of(point, 3), should, "point")


def quaternion_of(value: Any) -> Any:
    """Euler parameters of unit length."""
    p = numbers_of(value, 4)
    if isinstance(p, Fault):
        return p
    length = sum(x * x for x in p) ** 0.5
    return Fault(not_unit(length)) if abs(length - 1.0) > UNIT_TOLERANCE else p


def from_rpy(value: Any) -> Any:
    """Euler parameters of roll, pitch and yaw."""
    angles = _angles(value, 3, "roll, pitch and yaw")
    if isinstance(angles, Fault):
        return angles
    (s0, c0), (s1, c1), (s2, c2) = ((math.sin(0.5 * x), math.cos(0.5 * x)) for x in angles)
    return (
        c2 * c1 * c0 + s2 * s1 * s0,
        c2 * c1 * s0 - s2 * s1 * c0,
        c2 * s1 * c0 + s2 * c1 * s0,
        s2 * c1 * c0 - c2 * s1 * s0,
    )


def from_axis_angle(value: Any) -> Any:
    """Euler parameters of a turn: three components of its axis, and the angle."""
    numbers = _angles(value, 4, "an axis, 3 numbers, and an angle")
    if isinstance(numbers, Fault):
        return numbers
    *axis, angle = numbers
    length = math.hypot(*axis)
    if length < SHORTEST:
        return Fault("has an axis of zero length", "write [0.0, 0.0, 1.0, angle] for one about z")
    part = math.sin(0.5 * angle) / length
    return (math.cos(0.5 * angle), *(part * x for x in axis))


def _angles(value: Any, count: int, what: str) -> Any:
    """Numbers, of which the last, or all of three, are angles."""
    value, should = plain(value), f"should be {count} numbers: {what}"
    if type(value) is not tuple or len(value) != count:
        return Fault(should)
    read = [angle_of if count == 3 or k == count - 1 else number_of for k in range(count)]
    numbers = tuple(reader(x) for reader, x in zip(read, value, strict=True))
    faults = [x for x in numbers if isinstance(x, Fault)]
    return Fault(f"{should}; {faults[0].what}", faults[0].remedy) if faults else numbers


def not_unit(length: float) -> str:
    """The fault of Euler parameters of this length."""
    return (
        f"should be four numbers e0, e1, e2, e3 of unit length (within {UNIT_TOLERANCE:g}); "
        f"the length is {length:.9g}"
    )


def matrix_of(value: Any) -> Any:
    """A 3x3 matrix as three rows."""
    value = plain(value)
    should = "should be 3x3 numbers, three rows"
    if type(value) is not tuple:
        return Fault(f"{should}, not {_kind(value)}")
    if len(value) == 9 and not any(type(x) is tuple for x in value):
        return Fault(f"{should}; it is one list of 9", "write [[..., ..., ...], [...], [...]]")
    if len(value) != 3:
        return Fault(f"{should}; it has {len(value)} entries")
    return _entries(value, lambda row: numbers_of(row, 3), should, "row")


def square_of(value: Any, size: int) -> Any:
    """A symmetric matrix as rows, or its diagonal."""
    value = plain(value)
    if type(value) is not tuple or not value or type(value[0]) is not tuple:
        return numbers_of(value, size)
    should = f"should be {size} numbers, or {size} rows of {size}"
    if len(value) != size:
        return Fault(f"{should}; it has {len(value)} rows")
    rows = _entries(value, lambda row: numbers_of(row, size), should, "row")
    if isinstance(rows, Fault):
        return rows
    largest = max(abs(x) for row in rows for x in row)
    for m, row in enumerate(rows):
        for n in range(m):
            if abs(row[n] - rows[n][m]) > 1e-12 * largest:
                places = f"row {m + 1}, column {n + 1} is {row[n]:g}, its mirror {rows[n][m]:g}"
                return Fault(f"should be symmetric; {places}")
    return rows


def list_of(value: Any, spec: FieldSpec | None = None) -> Any:
    """One or more finite numbers as a tuple; above 0 where a field says so."""
    value = plain(value)
    if type(value) is not tuple or not value:
        return Fault(f"should be a list of numbers, not {_kind(value)}")
    numbers = numbers_of(value, len(value))
    if (
        spec is not None
        and spec.positive
        and not isinstance(numbers, Fault)
        and min(numbers) <= 0.0
    ):
        return Fault("should be a list of numbers above 0")
    return numbers


def rows_of(value: Any) -> Any:
    """Rows of finite numbers, all of one length, as tuples."""
    value, should = plain(value), "should be a list of rows of numbers"
    if type(value) is not tuple or not value:
        return Fault(f"{should}, not {_kind(value)}")
    rows = _entries(value, list_of, should, "row")
    if isinstance(rows, Fault):
        return rows
    for k, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            return Fault(f"{should} of one length; row {k} has {len(row)}, row 1 {len(rows[0])}")
    return rows


def word_of(value: Any, allowed: Collection[Any], aliases: Mapping[str, str] | None = None) -> Any:
    """One of the allowed words (or truth values), by its own name or an alias."""
    value = plain(value)
    if type(value) is str and aliases and value in aliases:
        value = aliases[value]
    if type(value) in (str, bool) and value in allowed:
        return value
    if set(allowed) == {False, True}:
        return truth_of(value)
    words = ", ".join(f'"{w}"' for w in allowed)
    return Fault(f"should be one of {words}", nearest=nearest(value, allowed))


def truth_of(value: Any) -> bool | Fault:
    """True or false."""
    value = plain(value)
    return value if type(value) is bool else Fault("should be true or false")


def text_of(value: Any) -> str | Fault:
    """Text."""
    value = plain(value)
    return value if type(value) is str else Fault(f"should be text, not {_kind(value)}")


def bounded(
    number: float | Fault,
    *,
    positive: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
    whole: bool = False,
) -> float | Fault:
    """A number within its limits."""
    if isinstance(number, Fault):
        return number
    if positive and not number > 0.0:
        return Fault("should be greater than 0")
    if minimum is not None and number < minimum:
        return Fault(f"should be at least {minimum:g}")
    if maximum is not None and number > maximum:
        return Fault(f"should be at most {maximum:g}")
    if whole and number != round(number):
        return Fault("should be a whole number")
    return number


_KINDS: dict[type, str] = {
    bool: "a truth value",
    str: "text",
    dict: "a table",
    int: "a number",
    float: "a number",
}


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if type(value) is tuple:
        return "an empty list" if not value else f"a list of {len(value)}"
    if name := _KINDS.get(type(value)):
        return name
    dtype = getattr(value, "dtype", None)
    return f"an array of {dtype}" if dtype is not None else f"a {type(value).__name__}"


def unusual_value_note(spec: FieldSpec, value: Any) -> str:
    """The note on an unusual value of a field, to follow it in a message; "" for no note."""
    if spec.kind == "number":
        low, high = spec.usual
        if low is not None and value < low:
            return f"is less than {low:g}, which is unusual; it is used as it is"
        if high is not None and value > high:
            return f"is more than {high:g}, which is unusual; it is used as it is"
        if spec.unit == "rad" and abs(value) > TURN:
            return MANY_TURNS
    elif spec.direction and spec.kind == "vec3":
        length = sum(x * x for x in value) ** 0.5
        if length == 0.0:
            return "is a direction of zero length: it has no effect"
        if abs(length - 1.0) > UNIT_LENGTH_ROUNDING:
            return f"is a direction of length {length:.9g}, not 1; it is used as it is"
    return ""


#: Readers of the kinds of fields that hold values and no references.
READERS: dict[str, Callable[[FieldSpec, Any], Any]] = {
    "number": lambda spec, value: bounded(
        angle_of(value, unit)
        if (unit := spec.unit.partition(" or ")[0]) in ANGLE_UNITS
        else number_of(value),
        positive=spec.positive,
        minimum=spec.minimum,
        maximum=spec.maximum,
        whole=spec.whole,
    ),
    "numbers": lambda spec, x: list_of(x, spec) if spec.size else numbers_of(x, spec.columns),
    "vec3": lambda spec, value: numbers_of(value, 3),
    "matrix": lambda spec, value: matrix_of(value),
    "square": lambda spec, value: square_of(value, spec.columns),
    "table": lambda spec, value: rows_of(value) if spec.by_rows else list_of(value),
    "choice": lambda spec, value: word_of(value, spec.choices, spec.aliases),
}


def unread(spec: FieldSpec, value: Any) -> Any:
    """The value itself, of a kind without a reader."""
    return value


def in_words(spec: FieldSpec) -> str:
    """The kind and the description of a field, for the message that it is missing."""
    kinds = {
        "vec3": "3 numbers",
        "numbers": f"{spec.columns} numbers",
        "matrix": "3x3 numbers",
        "square": f"{spec.columns} numbers, or as many rows of as many",
        "choice": "a word",
        "table": "rows of numbers" if spec.by_rows else "numbers",
        "functions": "names",
        "input": "an input",
    }
    kind = kinds.get(spec.kind, f"a {spec.kind}")
    return f" ({kind}: {spec.doc})" if spec.doc else f" ({kind})"
