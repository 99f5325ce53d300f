"""The constraint rows of a model at one state, as arrays of Python."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.linear.ldlt.plan import Plan


@attrs.frozen
class ConstraintRows:
    """The constraint rows of a model at one state, in the order of the model.

    Attributes:
        C: (rows,) position-level residuals, zero where a row has none.
        nu, gamma: (rows,) right-hand sides of the velocity and acceleration level.
        row, column, value: the Jacobian's entries, (rows, 6 n), in no particular order.
    """

    C: Floats
    nu: Floats
    gamma: Floats
    row: Integers
    column: Integers
    value: Floats
    shape: tuple[int, int]

    def product(self, x: Floats) -> Floats:
        """(rows,) D x of x (6 n,)."""
        terms = self.value * x[self.column]
        return np.bincount(self.row, terms, minlength=self.shape[0]).astype(float)

    def first(self, count: int) -> "ConstraintRows":
        """The first rows alone."""
        own = self.row < count
        sides = self.C[:count], self.nu[:count], self.gamma[:count]
        entries = self.row[own], self.column[own], self.value[own]
        return ConstraintRows(*sides, *entries, (count, self.shape[1]))

    def dense(self) -> Floats:
        """The Jacobian D (rows, 6 n)."""
        D = np.zeros(self.shape)
        D[self.row, self.column] = self.value
        return D

    def sparse(self) -> Any:
        """The Jacobian D (rows, 6 n) as a scipy CSR array."""
        from scipy.sparse import csr_array

        return csr_array((self.value, (self.row, self.column)), shape=self.shape)


def scaled_rows(rows: ConstraintRows, length: float) -> tuple[ConstraintRows, Floats]:
    """Rows whose gradients have unit length, of displacements in units of a length, m; and lengths.

    Neither depends on the units of the scene. A row without gradient stays as it is.

    Args:
        rows: those of a model.
        length: a length of the scene, m.

    Returns:
        the rows, whose columns belong to (r / length, rotation in rad), and (rows,) the lengths of
        their gradients before.
    """
    value = np.where(rows.column % 6 < 3, length, 1.0) * rows.value
    gradient = np.sqrt(np.bincount(rows.row, value**2, minlength=rows.shape[0]))
    gradient[gradient == 0.0] = 1.0
    return attrs.evolve(
        rows,
        C=rows.C / gradient,
        nu=rows.nu / gradient,
        gamma=rows.gamma / gradient,
        value=value / gradient[rows.row],
    ), gradient


def jacobian_pattern(plan: Plan, row_places: Integers) -> tuple[Integers, Integers, Integers]:
    """Row, column and place in D of the Jacobian's entries; row_places: ``System.row``."""
    place, row, body = plan.entries
    model_row = np.zeros(plan.row_size, dtype=np.int64)
    model_row[row_places] = np.arange(len(row_places))
    six = np.arange(6)
    column = 6 * (body - 1)[:, None] + six
    return np.repeat(model_row[row], 6), column.ravel(), (place[:, None] + six).ravel()
