"""Columns of values as arrays, with a mistake for each invalid value."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.coerce_values import LARGEST, Fault, number_of, numbers_of
from dap3d_core.scene.validate.mistake_collector import Collector


def numbers(report: Collector, keys: Sequence[Key], values: list[Any]) -> Floats:
    """(n,) array of numbers; an invalid one is reported under its key and becomes NaN."""
    flat = _flat(values)
    return _one_by_one(report, keys, values, (), number_of) if flat is None else flat


def vectors(
    report: Collector,
    keys: Sequence[Key],
    values: list[Any],
    width: int,
    reader: Callable[[Any], Any] | None = None,
) -> Floats:
    """(n, width) array; an invalid row is reported under its key and becomes NaN.

    ``reader`` reads one row; by default ``numbers_of``.
    """
    if set(map(type, values)) <= {tuple} and set(map(len, values)) <= {width}:
        flat = _flat(list(chain.from_iterable(values)))
        if flat is not None:
            return flat.reshape(len(values), width)
    reader = reader or (lambda value: numbers_of(value, width))
    return _one_by_one(report, keys, values, (width,), reader)


def _flat(values: list[Any]) -> Floats | None:
    """The numbers as an array, or None where one of them is invalid."""
    if not set(map(type, values)) <= {float, int}:
        return None
    try:
        array = np.array(values, dtype=np.float64)
    except OverflowError:  # an integer beyond all floats
        return None
    return array if bool(np.all(np.abs(array) <= LARGEST)) else None


def _one_by_one(
    report: Collector,
    keys: Sequence[Key],
    values: list[Any],
    shape: tuple[int, ...],
    reader: Callable[[Any], Any],
) -> Floats:
    array = np.full((len(values), *shape), np.nan)
    for k, value in enumerate(values):
        result = report.read(keys[k], value, reader)
        if not isinstance(result, Fault):
            array[k] = result
    return array


def tuples(array: Floats) -> list[tuple[float, ...]]:
    """The rows of a (n, m) array as tuples of Python floats."""
    return list(zip(*array.T.tolist(), strict=True))


class Keys(Sequence[Key]):
    """The keys (table, name, field) of a column, made on access."""

    def __init__(self, table: str, names: Sequence[str], field: str) -> None:
        self.table, self.names, self.field = table, names, field

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, index: Any) -> Any:
        return (self.table, self.names[index], self.field)
