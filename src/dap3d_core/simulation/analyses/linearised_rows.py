"""The constraint rows of a pose as a linear map, in coordinates without units, factored once."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows

Floats = NDArray[np.float64]

#: Motions whose singular value is below this are left out of solutions.
SINGULAR = 1e-7


class LinearisedRows:
    """D x = b at a pose where the rows hold all bodies: least squares over redundant rows.

    Rows are scaled to gradients of unit length, translations measured in a length of the scene, so
    that singular values have no units and are of order one at an ordinary pose.

    Attributes:
        rows: the rows as they are.
        matrix: (m, 6 n) scaled.
    """

    def __init__(self, rows: ConstraintRows, length: float) -> None:
        """Args: rows at a pose; a length of the scene, m."""
        self.rows = rows
        scaled, self._gradient = scaled_rows(rows, length)
        self.matrix = scaled.dense()
        self._unit = np.tile(np.repeat([length, 1.0], 3), rows.shape[1] // 6)
        self._Q, self._R = np.linalg.qr(self.matrix)

    @cached_property
    def least(self) -> float:
        """The least singular value of the scaled rows: zero at a singular pose."""
        return float(np.linalg.svd(self._R, compute_uv=False)[-1])

    def solve(self, side: Floats) -> Floats:
        """(6 n,) x in m and rad with D x = side, side (m,) in units of the rows.

        At a singular pose the part of x along which no row changes is zero.
        """
        scaled = side / self._gradient
        if self.least > SINGULAR:
            x = solve_triangular(self._R, self._Q.T @ scaled)
        else:
            x = np.linalg.lstsq(self.matrix, scaled, rcond=SINGULAR)[0]
        solution: Floats = self._unit * x
        return solution

    def product(self, x: Floats) -> Floats:
        """(m,) D x in units of the rows."""
        return self._gradient * (self.matrix @ (x / self._unit))

    def adjoint(self, force: Floats) -> Floats:
        """(m,) multipliers whose D^T lambda is nearest to a force (6 n,); of these the least."""
        scaled = np.linalg.lstsq(self.matrix.T, self._unit * force, rcond=SINGULAR)[0]
        return np.asarray(scaled / self._gradient)

    def smallest(self) -> tuple[float, Floats, Floats]:
        """The least singular value, its left vector (m,) and its motion (6 n,) in m and rad."""
        left, values, right = np.linalg.svd(self.matrix, full_matrices=False)
        return float(values[-1]), left[:, -1], self._unit * right[-1]

    def left_out(self, left: Floats) -> Floats:
        """(m,) what each row's prescribed rate adds to the rate that no motion gives (``left``)."""
        share: Floats = left * self.rows.nu / self._gradient
        return share

    def turned_from(self, other: "LinearisedRows") -> bool:
        """Whether a singular pose lies between two near poses: a determinant changes its sign."""
        here = np.linalg.slogdet(other._Q.T @ self.matrix)[0]
        return bool(here * np.linalg.slogdet(other._R)[0] < 0.0)

    def signed(self, other: "LinearisedRows") -> float:
        """The least singular value, negative beyond a singular pose seen from another pose."""
        return -self.least if self.turned_from(other) else self.least
