"""Sparse matrices as lists of entries, with rows or columns for the components of bodies."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers


class SparseEntries:
    """Entries of a sparse matrix of a shape (rows, columns); those at one place add up."""

    def __init__(self, rows: int, columns: int) -> None:
        self.shape = rows, columns
        self._parts: list[tuple[Integers, Integers, Floats]] = []

    def add(self, row: Integers, column: Integers, value: Floats) -> None:
        """Add entries; negative rows or columns are left out. Arguments broadcast."""
        row, column, value = (x.ravel() for x in np.broadcast_arrays(row, column, value))
        chosen = (row >= 0) & (column >= 0) & (value != 0.0)
        self._parts.append((row[chosen], column[chosen], value[chosen]))

    def matrix(self) -> Any:
        """The matrix, as a scipy CSR array."""
        from scipy.sparse import csr_array

        none = np.zeros(0, dtype=np.int64)
        row, column, value = zip((none, none, np.zeros(0)), *self._parts, strict=True)
        places = np.concatenate(row), np.concatenate(column)
        return csr_array((np.concatenate(value), places), shape=self.shape)


def components(bodies: Integers) -> Integers:
    """(..., 6) components of bodies (...); -1 for ground."""
    first = 6 * (bodies[..., None] - 1) + np.arange(6)
    return np.where(bodies[..., None] > 0, first, -1)
