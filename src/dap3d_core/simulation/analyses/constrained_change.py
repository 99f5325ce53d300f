"""Least changes of poses, velocities and accelerations that some of the constraint rows ask for."""

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.simulation.initial.assemble import finite_rows

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Singular values of scaled rows below this count as zero.
RANK = 1e-9


class ChosenRows:
    """Some of the rows of a model at a state, with the motions that they leave.

    Attributes:
        rows: all rows as they are.
        all_rows: (rows, 6 n) the Jacobian.
        D: (k, 6 n) those chosen, as they are.
        free: (6 n, f) an orthonormal basis, in m and rad, of the motions that they leave.
    """

    def __init__(self, evaluator: Evaluator, t: float, u: Floats, chosen: Flags) -> None:
        """Args: evaluator, time, s, state (13 n,); chosen: (rows,) which rows."""
        self.rows = finite_rows(evaluator, t, u) if len(chosen) else _none(evaluator)
        self.all_rows = self.rows.dense()
        self._chosen, self.D = chosen, self.all_rows[chosen]
        scaled, gradient = scaled_rows(self.rows, 1.0)
        self._gradient = gradient[chosen]
        left, values, right = np.linalg.svd(scaled.dense()[chosen])
        rank = int(np.sum(values > RANK))
        self._left, self._values, self._right = left[:, :rank], values[:rank], right[:rank]
        self.free: Floats = right[rank:].T

    def least(self, side: Floats) -> Floats:
        """(6 n,) the least x with D x = side, side (rows,) of all rows."""
        scaled = self._left.T @ (side[self._chosen] / self._gradient)
        least: Floats = self._right.T @ (scaled / self._values)
        return least

    def onto(self, x: Floats, side: Floats) -> Floats:
        """The x (6 n,) nearest to one given with D x = side."""
        nearest: Floats = self.free @ (self.free.T @ x) + self.least(side)
        return nearest

    def residual(self, x: Floats, side: Floats) -> float:
        """Largest |D x - side|."""
        return float(np.max(np.abs(self.D @ x - side[self._chosen]), initial=0.0))

    def multipliers(self, force: Floats) -> Floats:
        """(k,) the least ones whose D^T lambda is a force (6 n,), as near as can be."""
        return np.asarray(np.linalg.lstsq(self.D.T, force, rcond=RANK)[0])


def _none(evaluator: Evaluator) -> ConstraintRows:
    nothing, places = np.zeros(0), np.zeros(0, dtype=np.int64)
    shape = (0, 6 * evaluator.model.body_count)
    return ConstraintRows(nothing, nothing, nothing, places, places, nothing, shape)
