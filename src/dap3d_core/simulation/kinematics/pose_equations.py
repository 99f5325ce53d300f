"""The equations of a scene at one pose: its rows as linear maps, and what accelerations take."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.constraint_rows import ConstraintRows, scaled_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.model.element_states import ElementState
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import split
from dap3d_core.simulation.initial.least_change import finite_rows

Flags = NDArray[np.bool_]

#: Motions whose singular value is below this are left out of solutions.
SINGULAR = 1e-7
#: Singular values of chosen rows, scaled, below this count as zero.
RANK = 1e-9
#: Columns of which all singular values are computed; sweeps of inverse iteration beyond.
FEW_COLUMNS, SWEEPS = 60, 6


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
        """The least singular value of the scaled rows: zero at a singular pose.

        Of many columns by inverse iteration, accurate where it is small compared with the others.
        """
        if len(self._R) <= FEW_COLUMNS or not np.all(np.diag(self._R)):
            return float(np.linalg.svd(self._R, compute_uv=False)[-1])
        from scipy.linalg import solve_triangular

        x, growth = np.random.default_rng(0).standard_normal(len(self._R)), 1.0
        for _ in range(SWEEPS):
            x /= np.linalg.norm(x)
            x = solve_triangular(self._R, solve_triangular(self._R, x, trans="T"))
            growth = float(np.linalg.norm(x))
        return float(growth**-0.5)

    def solve(self, side: Floats) -> Floats:
        """(6 n,) x in m and rad with D x = side, side (m,) in units of the rows.

        At a singular pose the part of x along which no row changes is zero.
        """
        scaled = side / self._gradient
        if self.least > SINGULAR:
            from scipy.linalg import solve_triangular

            x = solve_triangular(self._R, self._Q.T @ scaled)
        else:
            x = np.linalg.lstsq(self.matrix, scaled, rcond=SINGULAR)[0]
        return self._unit * x

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
        return left * self.rows.nu / self._gradient

    def turned_from(self, other: "LinearisedRows") -> bool:
        """Whether a singular pose lies between two near poses: a determinant changes its sign."""
        here = np.linalg.slogdet(other._Q.T @ self.matrix)[0]
        return bool(here * np.linalg.slogdet(other._R)[0] < 0.0)

    def signed(self, other: "LinearisedRows") -> float:
        """The least singular value, negative beyond a singular pose seen from another pose."""
        return -self.least if self.turned_from(other) else self.least


class ChosenRows:
    """Some of the rows of a model at a state, with the motions that they leave.

    Attributes:
        rows: all rows as they are.
        all_rows: (rows, 6 n) the Jacobian.
        D: (k, 6 n) those chosen, as they are.
        free: (6 n, f) a basis, in m and rad, of the motions that they leave: orthonormal in lengths
            of the scene and rad.
        unit: (6 n,) these lengths, m, and 1 rad.
    """

    def __init__(self, evaluator: Evaluator, t: float, u: Floats, chosen: Flags) -> None:
        """Args: evaluator, time, s, state (13 n,); chosen: (rows,) which rows."""
        self.rows = finite_rows(evaluator, t, u) if len(chosen) else _none(evaluator)
        self.all_rows = self.rows.dense()
        self._chosen, self.D = chosen, self.all_rows[chosen]
        length = evaluator.model.length
        scaled, gradient = scaled_rows(self.rows, length)
        self._gradient = gradient[chosen]
        left, values, right = np.linalg.svd(scaled.dense()[chosen])
        rank = int(np.sum(values > RANK))
        self._left, self._values, self._right = left[:, :rank], values[:rank], right[:rank]
        self.unit = np.tile(np.repeat([length, 1.0], 3), evaluator.model.body_count)
        self.free: Floats = self.unit[:, None] * right[rank:].T

    def least(self, side: Floats) -> Floats:
        """(6 n,) the least x with D x = side, side (rows,) of all rows."""
        scaled = self._left.T @ (side[self._chosen] / self._gradient)
        return self.unit * (self._right.T @ (scaled / self._values))

    def onto(self, x: Floats, side: Floats) -> Floats:
        """The x (6 n,) nearest to one given with D x = side."""
        return self.free @ (self.free.T @ (x / self.unit**2)) + self.least(side)

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


def required_forces(evaluator: Evaluator, t: float, u: Floats, v_dot: Floats) -> Floats:
    """(6 n,) force and moment on each body that joints have to give: M v_dot - g.

    Args:
        u: (13 n,) state.
        v_dot: (6 n,) accelerations.
    """
    model = evaluator.model
    _, p, _, w = split(u)
    accelerations = v_dot.reshape(-1, 6)
    spin, rise = to_body(p, w), to_body(p, accelerations[:, 3:])
    moment = np.einsum("brc,bc->br", model.Jp, rise)
    moment += np.cross(spin, np.einsum("brc,bc->br", model.Jp, spin))
    force = model.mass[:, None] * accelerations[:, :3]
    inertial = np.hstack([force, to_global(p, moment)])
    return np.asarray((inertial - evaluator.applied_forces(t, u)).ravel())


def own_states(model: Model) -> list[ElementState]:
    """The states of elements that are no contacts: a motion alone does not tell them."""
    return [s for s in model.element_states if s.element not in model.contact_names]


def held_states(held: Sequence[ElementState]) -> list[str]:
    """Note that these states of elements stay as they are; none where there are none."""
    names = ", ".join(s.path for s in held)
    words = f"no motion is integrated: states of elements keep their initial values ({names})"
    return [words] if held else []
