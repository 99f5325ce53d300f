"""What a single value may be: a fast answer for good values, words for bad ones."""

import math
import re
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.coerce import plain

#: Beyond this size products of two numbers leave double precision.
LARGEST = 1e100
#: Text that is a number in quotes; of longer text nobody needs to be told so.
_NUMBER, LONGEST_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"), 60

Vector3 = tuple[float, float, float]


class Fault(NamedTuple):
    """What is wrong with a value, what to do, the nearest right spelling."""

    what: str
    remedy: str = ""
    nearest: str = ""


def number_of(value: Any) -> float | Fault:
    """A finite number as a float, or what is wrong. Text and truth values are no numbers."""
    if type(value) is float and -LARGEST <= value <= LARGEST:
        return value
    value = plain(value)
    if type(value) is int and abs(value) <= LARGEST:
        return float(value)
    return _number_fault(value)


def _number_fault(value: Any) -> float | Fault:
    should = "should be a number"
    if type(value) is str:
        written = value.strip().replace(",", ".")
        is_number = len(written) <= LONGEST_NUMBER and _NUMBER.fullmatch(written)
        return Fault(f"{should}, not text", f"write {written} without quotes" if is_number else "")
    if type(value) is bool:
        return Fault(f"{should}, not a truth value")
    if type(value) is int or (type(value) is float and math.isfinite(value)):
        if abs(value) <= LARGEST:
            return float(value)
        return Fault(f"{should} of at most {LARGEST:g} in size: products of larger ones overflow")
    if type(value) is float:
        return Fault(f"should be a finite number, not {value}")
    if type(value) is tuple:
        return Fault(f"{should}, not a list of {len(value)}")
    return Fault(f"{should}, not {_kind(value)}")


def numbers_of(value: Any, count: int) -> tuple[float, ...] | Fault:
    """Exactly ``count`` finite numbers as a tuple, or what is wrong."""
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
    found = []
    for place, item in enumerate(value, 1):
        number = number_of(item)
        if isinstance(number, Fault):
            return Fault(f"{should}; entry {place} {number.what}", number.remedy)
        found.append(number)
    return tuple(found)


def matrix_of(value: Any) -> tuple[Vector3, ...] | Fault:
    """A 3x3 matrix as three rows, or what is wrong."""
    value = plain(value)
    should = "should be 3x3 numbers, three rows"
    if type(value) is not tuple:
        return Fault(f"{should}, not {_kind(value)}")
    if len(value) == 9 and not any(type(x) is tuple for x in value):
        return Fault(f"{should}; it is one list of 9", "write [[..., ..., ...], [...], [...]]")
    if len(value) != 3:
        return Fault(f"{should}; it has {len(value)} entries")
    rows: list[Any] = []
    for place, item in enumerate(value, 1):
        row = numbers_of(item, 3)
        if isinstance(row, Fault):
            return Fault(f"{should}; row {place} {row.what}", row.remedy)
        rows.append(row)
    return tuple(rows)


def list_of(value: Any) -> tuple[float, ...] | Fault:
    """One or more finite numbers as a tuple, or what is wrong."""
    value = plain(value)
    if type(value) is not tuple or not value:
        return Fault(f"should be a list of numbers, not {_kind(value)}")
    return numbers_of(value, len(value))


def word_of(value: Any, allowed: Collection[Any], aliases: Mapping[str, str] | None = None) -> Any:
    """One of the allowed words (or truth values), by its own or another name; else what's wrong."""
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
    """True or false, or what is wrong."""
    value = plain(value)
    return value if type(value) is bool else Fault("should be true or false")


def text_of(value: Any) -> str | Fault:
    """Text, or what is wrong."""
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
    """A number within its limits, or what is wrong."""
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


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if type(value) is tuple:
        return "an empty list" if not value else f"a list of {len(value)}"
    names = {bool: "a truth value", str: "text", dict: "a table", int: "a number"}
    names[float] = "a number"
    if type(value) in names:
        return names[type(value)]
    dtype = getattr(value, "dtype", None)
    return f"an array of {dtype}" if dtype is not None else f"a {type(value).__name__}"
