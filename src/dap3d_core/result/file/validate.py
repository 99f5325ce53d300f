"""What a result file may claim: asked before memory is taken for it, and before it is believed."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result.errors import ResultError
from dap3d_core.result.event_record import KINDS
from dap3d_core.result.model_summary import Subject

#: Arrays of so many bytes are read whatever the size of the file; beyond, a file holds at least one
#: byte for so many. dap3d writes numbers as they are; other programs may press them together.
ALWAYS, MOST_PRESSED = 64 * 2**20, 64
#: Rows of a joint.
MOST_ROWS = 1000

#: Larger numbers leave no run: it is stopped before.
MOST = 1e100

#: What an entry must fulfil, and what it is in words.
Form = tuple[Callable[[Any], bool], str]


def check_claims(file: Path, dataset: Any) -> None:
    """Refuse a file that says it holds far more numbers than fit into it.

    A few bytes can claim 1e12 entries: what was never written reads as a filling value.

    Args:
        file: where it lies.
        dataset: the open netCDF4.Dataset.

    Raises:
        ResultError: it claims too much; says how much.
    """
    shapes = [variable.shape for variable in dataset.variables.values()]
    check_shapes(file, shapes, file.stat().st_size)


def check_shapes(file: Path, shapes: Iterable[tuple[int, ...]], byte_count: int) -> None:
    """The same for arrays of these shapes, of 8 bytes a number, and a size of the file in bytes."""
    claimed = 8 * sum(math.prod(shape) for shape in shapes)
    if claimed > max(ALWAYS, MOST_PRESSED * byte_count):
        raise ResultError(
            f"cannot read {file}: it claims {claimed / 2**30:.3g} GiB of numbers and has "
            f"{byte_count / 2**20:.3g} MiB; it is damaged, or made to fill the memory"
        )


def check_attributes(found: Mapping[str, Any]) -> None:
    """Whether what a file says of its run has the form in which dap3d writes it.

    Args:
        found: the global attributes, JSON already read.

    Raises:
        ValueError: names the first that has not.
    """
    check_forms(found, FORMS)


def check_forms(found: Mapping[str, Any], forms: Mapping[str, Form]) -> None:
    """ValueError for the first entry that is not of its form."""
    for name, (fits, what) in forms.items():
        if not fits(found.get(name)):
            raise ValueError(f"{name} should be {what}")


def check_numbers(file: str | Path, name: str, values: NDArray[np.float64]) -> None:
    """Whether an array of a file holds what a run may have left; times increase.

    Raises:
        ResultError: it does not.
    """
    good = not values.size or (values.min() >= -MOST and values.max() <= MOST)
    if not good or (name == "t" and not (values[1:] > values[:-1]).all()):
        fault = "times that do not increase" if good else "a number that no run leaves"
        raise ResultError(f"cannot read {file}: it is damaged: {name} holds {fault}")


def check_subject(subject: Subject) -> None:
    """Whether names are texts of a line, and indices and counts lie within what there is.

    Raises:
        ValueError: names what does not.
    """
    for kind in ("body", "joint", "point"):
        for name in getattr(subject, f"{kind}_names"):
            if not name or not name.isprintable():
                raise ValueError(f"{name!r} is no name of a {kind}")
    for constant in ("mass", "Jp", "point_local"):
        if not (np.abs(getattr(subject, constant)) <= MOST).all():
            raise ValueError(f"{constant} holds a number that no scene may have")
    if not (subject.mass > 0.0).all():
        raise ValueError("a mass is not positive")
    if not all(0 <= k <= subject.body_count for k in subject.point_body.tolist()):
        raise ValueError("point_body names a body that there is not")
    if not all(0 <= k <= MOST_ROWS for k in subject.joint_rows.tolist()):
        raise ValueError("joint_rows are no numbers of rows")


def is_number(value: Any) -> bool:
    """Whether this is a finite number of a size that a run may meet."""
    return type(value) in (int, float) and abs(value) < 1e300


def are_texts(value: Any) -> bool:
    """Whether this is a list of texts."""
    return isinstance(value, list) and all(isinstance(v, str) for v in value)


def _is_plain(value: Any, depth: int = 3) -> bool:
    """A setting: a number, a word, a truth value, nothing, or a short nest of them."""
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
    )


def _is_tolerance(value: Any) -> bool:
    """One number, one for each quantity, or none."""
    return value is None or is_number(value) or (_are_numbers(value) and set(value) == set("rpvw"))


def _are_numbers(value: Any) -> bool:
    return isinstance(value, dict) and all(is_number(v) for v in value.values())


def are_events(value: Any) -> bool:
    """Whether these are events as a result and a checkpoint hold them."""
    return isinstance(value, list) and all(isinstance(v, dict) and _is_event(v) for v in value)


def _is_event(value: Mapping[str, Any]) -> bool:
    changes, u = value.get("changes", {}), value.get("u")
    return (
        isinstance(value.get("name"), str)
        and is_number(value.get("t"))
        and value.get("direction") in (-1, 1)
        and value.get("kind") in KINDS
        and (u is None or (isinstance(u, list) and all(map(is_number, u))))
        and isinstance(changes, dict)
        and all(isinstance(v, dict) and _is_plain(v) for v in changes.values())
    )


def _are_sources(value: Any) -> bool:
    return value is None or (
        isinstance(value, dict) and all(is_table_of_texts(of) for of in value.values())
    )


def is_table_of_texts(value: Any) -> bool:
    """Whether this is a table whose values are texts."""
    return isinstance(value, dict) and all(isinstance(v, str) for v in value.values())


#: Of the attributes of a result.
FORMS: dict[str, Form] = {
    "types": (_are_sources, "a table of tables of texts"),
    "notes": (are_texts, "a list of texts"),
    "settings": (_are_settings, "a table of numbers, words and truth values"),
    "statistics": (_are_numbers, "a table of numbers"),
    "versions": (is_table_of_texts, "a table of texts"),
    "events": (are_events, "a list of tables with name, t, direction"),
}
