"""Checks of the content of a result file, before memory is allocated and before it is used."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result.arrays import ModelSummary
from dap3d_core.result.errors import ResultError
from dap3d_core.result.event_record import CONTACT_KINDS, KINDS

#: Arrays up to so many bytes are read whatever the size of the file; larger ones only up to a ratio
#: of their size to that of the file. dap3d does not compress; other programs may.
ALWAYS, MOST_PRESSED = 64 * 2**20, 64
#: Largest number of rows of a joint.
MOST_ROWS = 1000

#: Largest number in a result: runs are stopped before.
MOST = 1e100

Test = Callable[[Any], bool]
#: Test of an entry, and its description.
Form = tuple[Test, str]


def check_claims(file: Path, dataset: Any) -> None:
    """Refuses a file that claims far more numbers than fit into it; unwritten ones need no space.

    Raises:
        ResultError: it claims too much.
    """
    shapes = [variable.shape for variable in dataset.variables.values()]
    check_shapes(file, shapes, file.stat().st_size)


def check_shapes(file: Path, shapes: Iterable[tuple[int, ...]], byte_count: int) -> None:
    """The same for shapes of arrays, with 8 bytes a number, and a size of the file in bytes."""
    claimed = 8 * sum(math.prod(shape) for shape in shapes)
    if claimed > max(ALWAYS, MOST_PRESSED * byte_count):
        raise ResultError(
            f"cannot read {file}: it claims {claimed / 2**30:.3g} GiB of numbers and has "
            f"{byte_count / 2**20:.3g} MiB; it is damaged, or made to fill the memory"
        )


def check_forms(found: Any, forms: Mapping[str, Form]) -> None:
    """Raises ValueError for the first entry that is not of its form, and for what is no table."""
    if not isinstance(found, Mapping):
        raise ValueError(f"{', '.join(forms)} should be the entries of a table")
    for name, (fits, what) in forms.items():
        if not fits(found.get(name)):
            raise ValueError(f"{name} should be {what}")


def check_numbers(file: str | Path, name: str, values: NDArray[np.float64]) -> None:
    """Refuses an array of a file with numbers beyond those of a run, or times that do not increase.

    Raises:
        ResultError: the array is damaged.
    """
    good = not values.size or (values.min() >= -MOST and values.max() <= MOST)
    if not good or (name == "t" and not (values[1:] > values[:-1]).all()):
        fault = "times that do not increase" if good else "a number that no run leaves"
        raise ResultError(f"cannot read {file}: it is damaged: {name} holds {fault}")


def check_subject(summary: ModelSummary) -> None:
    """Checks that names are single lines, and that constants and indices are in range.

    Raises:
        ValueError: describes the first that is not.
    """
    for kind in ("body", "joint", "point"):
        for name in getattr(summary, f"{kind}_names"):
            if not name or not name.isprintable():
                raise ValueError(f"{name!r} is no name of a {kind}")
    for name in summary.state_names:
        if not name.isprintable() or name.count(".") not in (2, 3):
            raise ValueError(f"{name!r} is no name of a state")
    for name in summary.angle_names:
        if not name.isprintable() or name.count(".") != 2:
            raise ValueError(f"{name!r} is no name of an angle")
    for constant in ("mass", "Jp", "point_local"):
        if not (np.abs(getattr(summary, constant)) <= MOST).all():
            raise ValueError(f"{constant} holds a number that no scene may have")
    if not (summary.mass > 0.0).all():
        raise ValueError("a mass is not positive")
    if not all(0 <= k <= summary.body_count for k in summary.point_body.tolist()):
        raise ValueError("point_body names a body that there is not")
    if not all(0 <= k <= MOST_ROWS for k in summary.joint_rows.tolist()):
        raise ValueError("joint_rows are no numbers of rows")


def is_number(value: Any) -> bool:
    """True for a finite number of ordinary size."""
    return type(value) in (int, float) and abs(value) < 1e300


def is_text(value: Any) -> bool:
    """True for a text."""
    return isinstance(value, str)


def list_of(fits: Test, *lengths: int) -> Test:
    """The test for a list whose entries all pass a test, of one of the lengths if any is given."""
    return lambda value: (
        isinstance(value, list)
        and len(value) in (lengths or (len(value),))
        and all(map(fits, value))
    )


def table_of(fits: Test) -> Test:
    """The test for a table whose values all pass a test."""
    return lambda value: isinstance(value, dict) and all(map(fits, value.values()))


def _or_none(fits: Test) -> Test:
    return lambda value: value is None or fits(value)


are_texts = list_of(is_text)
is_table_of_texts = table_of(is_text)
_are_numbers = table_of(is_number)
_is_state = _or_none(list_of(is_number))


def _is_plain(value: Any, depth: int = 3) -> bool:
    """True for a number, text, truth value or None, or a shallow nest of them."""
    if isinstance(value, (list, dict)):
        parts = value.values() if isinstance(value, dict) else value
        return depth > 0 and all(_is_plain(v, depth - 1) for v in parts)
    return value is None or isinstance(value, (bool, str)) or is_number(value)


def _are_settings(value: Any) -> bool:
    numbers = ("t_end", "dt", "rtol", "step")
    return (
        isinstance(value, dict)
        and _is_plain(value)
        and all(value.get(n) is None or is_number(value[n]) for n in numbers)
        and _is_tolerance(value.get("atol"))
        and type(value.get("rank", 0)) is int
        and _is_length(value.get("length", 1.0))
    )


def _is_length(value: Any) -> bool:
    """True for a length whose square is neither zero nor infinite."""
    return is_number(value) and 1e-100 <= value <= 1e100


def _is_tolerance(value: Any) -> bool:
    """True for one number, one for each quantity, or none."""
    return (
        value is None
        or is_number(value)
        or (_are_numbers(value) and set("rpvw") <= set(value) <= set("rpvwz"))
    )


def _is_event(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and is_text(value.get("name"))
        and is_number(value.get("t"))
        and value.get("direction") in (-1, 0, 1)
        and (
            value["direction"] != 0
            or value.get("kind") in ("jump", "break", "engage", *CONTACT_KINDS)
        )
        and value.get("kind") in KINDS + CONTACT_KINDS
        and all(_is_state(value.get(name)) for name in ("u", "u_after"))
        and is_number(value.get("work", 0.0))
        and all(_are_values(value.get(name, {})) for name in ("changes", "states"))
    )


_are_values = table_of(lambda value: isinstance(value, dict) and _is_plain(value))
#: Test for the events of a result or a checkpoint.
are_events = list_of(_is_event)

#: Forms of the attributes of a result.
FORMS: dict[str, Form] = {
    "types": (_or_none(table_of(is_table_of_texts)), "a table of tables of texts"),
    "notes": (are_texts, "a list of texts"),
    "actuation": (table_of(list_of(is_number)), "a table of lists of numbers"),
    "settings": (_are_settings, "a table of numbers, words and truth values"),
    "statistics": (_are_numbers, "a table of numbers"),
    "versions": (is_table_of_texts, "a table of texts"),
    "events": (are_events, "a list of tables with name, t, direction"),
}
