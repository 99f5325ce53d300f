"""Many values of one kind at once: an array, and a mistake for each that is not good."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.validate.coerce_values import LARGEST, Fault, number_of, numbers_of
from dap3d_core.scene.validate.mistake_collector import Collector

Floats = NDArray[np.float64]

_NUMBERS = {float, int}


def numbers(report: Collector, keys: Sequence[Key], values: list[Any]) -> Floats:
    """(n,) array of numbers; a bad one is reported under its key and becomes NaN."""
    return _column(report, keys, values, (), _flat(values), number_of)


def vectors(report: Collector, keys: Sequence[Key], values: list[Any], width: int) -> Floats:
    """(n, width) array; a bad row is reported under its key and becomes NaN."""
    good = set(map(type, values)) <= {tuple} and set(map(len, values)) <= {width}
    flat = _flat(list(chain.from_iterable(values))) if good else None
    return _column(report, keys, values, (width,), flat, lambda v: numbers_of(v, width))


def _flat(values: list[Any]) -> Floats | None:
    """The numbers as an array, or None where one of them is not fit."""
    if not set(map(type, values)) <= _NUMBERS:
        return None
    try:
        array = np.array(values, dtype=np.float64)
    except OverflowError:  # an integer beyond all floats
        return None
    return array if bool(np.all(np.abs(array) <= LARGEST)) else None


def _column(
    report: Collector,
    keys: Sequence[Key],
    values: list[Any],
    shape: tuple[int, ...],
    flat: Floats | None,
    read: Callable[[Any], Any],
) -> Floats:
    if flat is not None:
        return flat.reshape(len(values), *shape)
    array = np.full((len(values), *shape), np.nan)
    for place, value in enumerate(values):
        found = read(value)
        if isinstance(found, Fault):
            given, what = value, found.what
            if value is None:
                given, what = MISSING, f"is required; it {what.removesuffix(', not nothing')}"
            report.add(keys[place], given, what, found.nearest, found.remedy)
        else:
            array[place] = found
    return array


def tuples(array: Floats) -> list[tuple[float, ...]]:
    """The rows of a (n, m) array as tuples of Python floats."""
    return list(zip(*array.T.tolist(), strict=True))


class Keys(Sequence[Key]):
    """The keys (table, name, field) of a column, made only where asked for."""

    def __init__(self, table: str, names: Sequence[str], field: str) -> None:
        self.table, self.names, self.field = table, names, field

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, place: Any) -> Any:
        return (self.table, self.names[place], self.field)
