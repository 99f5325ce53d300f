"""State space of linearised equations in independent coordinates.

Coordinates xi of displacements that the position rows allow, eta of velocities that all rows allow:

    x^ = Q xi        v^ = N eta + P xi        D_p Q = 0, D N = 0, P = -D^+ G Q

with orthonormal Q and N from singular values, so that redundant rows need nothing of their own.
Reactions drop out of N^T v^_dot. Rows of the velocity level alone (rolling) make eta fewer than xi.

A driver that is an input moves by w beside its function: its displacement w and rate w_dot are
states, its acceleration the input. C, nu and gamma of its rows change by df = w, w_dot, w_ddot, and

    x^ = Q xi + D_p^+ nu_1 w        v^ = N eta + P xi + D^+ ((nu_0 - G D_p^+ nu_1) w + nu_1 w_dot)

with nu_k the derivative of nu by the k-th rate of the function. The states of elements come last;
where rows depend on them they are in x^ and v^, as those of drivers are.
"""

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.linearization.scaled_equations import ScaledEquations, ScaledStates


@attrs.frozen(eq=False, kw_only=True)
class DriverRows:
    """Derivatives of right-hand sides of rows by drivers, (rows, drivers) each.

    Attributes:
        nu: by displacement, rate; gamma: by displacement, rate, acceleration. The last has columns
            of numbers that rows read as well, without displacements, behind those of drivers.
    """

    nu: tuple[Floats, Floats]
    gamma: tuple[Floats, Floats, Floats]


@attrs.frozen(eq=False, kw_only=True)
class StateSpace:
    """The state matrix in independent coordinates z = (xi, w, eta, w_dot, states), w of drivers.

    Attributes:
        A: (states, states) z_dot = A z.
        displacement, velocity: (6 n, states) displacements and velocities (global axes) of states.
        acceleration: (6 n, states), multipliers: (rows, states): their changes.
        force_input: (states, 6 n) z_dot by forces on the bodies.
        own: (states, s) unit columns of the states of elements among all.
        acceleration_by_force: (6 n, 6 n), multipliers_by_force: (rows, 6 n).
        driver_input: (states, drivers), acceleration_by_driver: (6 n, drivers),
            multipliers_by_driver: (rows, drivers): by accelerations of drivers, and by the numbers
            behind them.
        coordinate_count: number of xi and w.
        size: magnitude of the terms that A is made of, 1/s: its rounding errors are eps of it.
    """

    A: Floats
    displacement: Floats
    velocity: Floats
    acceleration: Floats
    multipliers: Floats
    force_input: Floats
    own: Floats
    acceleration_by_force: Floats
    multipliers_by_force: Floats
    driver_input: Floats
    acceleration_by_driver: Floats
    multipliers_by_driver: Floats
    coordinate_count: int
    size: float


def state_space(
    equations: ScaledEquations, rank: int, position_rank: int, drivers: DriverRows | None = None
) -> StateSpace:
    """The state space of scaled equations.

    Args:
        equations: the equations.
        rank, position_rank: of all rows, and of those with a position level.
        drivers: drivers that are inputs.
    """
    U, S, K, C, G = (getattr(equations, name).toarray() for name in "USKCG")
    D, back = equations.D.toarray(), equations.gradient[:, None]
    position = equations.position_row
    none = np.zeros((len(D), 0))
    drivers = drivers or DriverRows(nu=(none, none), gamma=(none, none, none))
    nu, gamma = ([part / back for part in level] for level in (drivers.nu, drivers.gamma))
    count = nu[0].shape[1]
    rows = _Rows(D, rank)
    N = rows.null
    holonomic = rows if np.all(position) else _Rows(D[position], position_rank)
    Q = _extended(N, holonomic.null)
    moved = holonomic.pseudoinverse(nu[1][position])
    own = _Own(*(matrix.toarray() for matrix in attrs.astuple(equations.states, recurse=False)))
    shifted = -holonomic.pseudoinverse(own.position[position])
    x = np.hstack([Q, moved, np.zeros((len(U), N.shape[1] + count)), shifted])
    driven, followed = rows.pseudoinverse(nu[1]), -rows.pseudoinverse(own.velocity)
    v = np.hstack([np.zeros((len(U), Q.shape[1] + count)), N, driven, followed])
    v += rows.pseudoinverse(_placed(nu[0], Q.shape[1], x.shape[1]) - G @ x)
    by_motion = equations.acceleration_by_displacement @ x + equations.acceleration_by_velocity @ v
    by_motion -= _placed(gamma[0], Q.shape[1], x.shape[1])
    last = x.shape[1] - own.count
    by_motion -= _placed(gamma[1], last - count, x.shape[1])
    by_motion += _placed(own.acceleration, last, x.shape[1])
    solve = _Accelerations(equations, rows)
    v_dot, lam = solve(_placed(own.force, last, x.shape[1]) - (K @ x + C @ v), -by_motion)
    by_force, lam_by_force = solve(U.T, np.zeros((len(D), len(U))))
    by_driver, lam_by_driver = solve(np.zeros((len(U), gamma[2].shape[1])), gamma[2])
    rate = np.zeros((count, x.shape[1]))
    rate[:, last - count : last] = np.eye(count)
    above = np.zeros((Q.shape[1] + count, len(U)))
    below = np.zeros((count + own.count, len(U)))
    steered = _placed(np.eye(len(below), count), 0, by_driver.shape[1])
    return StateSpace(
        A=np.vstack([Q.T @ (v + S @ x), rate, N.T @ v_dot, 0.0 * rate, own.rates(x, v)]),
        own=np.eye(x.shape[1])[:, last:],
        displacement=U @ x,
        velocity=U @ v,
        acceleration=U @ v_dot,
        multipliers=lam / back,
        force_input=np.vstack([above, N.T @ by_force, below]),
        acceleration_by_force=U @ by_force,
        multipliers_by_force=lam_by_force / back,
        driver_input=np.vstack([above @ by_driver, N.T @ by_driver, steered]),
        acceleration_by_driver=U @ by_driver,
        multipliers_by_driver=lam_by_driver / back,
        coordinate_count=Q.shape[1] + count,
        size=_size(K, C, S, own.by_states),
    )


def _size(K: Floats, C: Floats, S: Floats, by_states: Floats) -> float:
    """Magnitude of the terms of a state matrix, 1/s."""
    largest = [np.linalg.norm(K, np.inf) ** 0.5, np.linalg.norm(C, np.inf)]
    largest += [np.linalg.norm(S, np.inf), np.max(np.abs(np.diag(by_states)), initial=0.0)]
    return float(max(largest))


class _Own(ScaledStates):
    """The same, dense."""

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.by_states)

    def rates(self, x: Floats, v: Floats) -> Floats:
        """Rates (s, c) of the states, which are the last of c columns of displacements."""
        own = _placed(self.by_states, x.shape[1] - self.count, x.shape[1])
        return self.by_displacement @ x + self.by_velocity @ v + own


def _extended(basis: Floats, wider: Floats) -> Floats:
    """An orthonormal basis of a wider space that begins with a basis of a part of it."""
    rest = wider - basis @ (basis.T @ wider)
    left, values, _ = np.linalg.svd(rest, full_matrices=False)
    return np.hstack([basis, left[:, values > 0.5]])


def _placed(columns: Floats, first: int, count: int) -> Floats:
    """Columns from the ``first`` on in a matrix of ``count`` columns, zeros elsewhere."""
    matrix = np.zeros((len(columns), count))
    matrix[:, first : first + columns.shape[1]] = columns
    return matrix


class _Rows:
    """Singular values of the rows of a Jacobian.

    Attributes:
        null: (columns, freedoms) an orthonormal basis of the null space.
        left, values, right: those of the rows' rank; D = left values right^T.
    """

    def __init__(self, D: Floats, rank: int) -> None:
        left, values, right = np.linalg.svd(D)
        self.null = right[rank:].T
        self.left, self.values, self.right = left[:, :rank], values[:rank], right[:rank].T

    def pseudoinverse(self, y: Floats) -> Floats:
        """D^+ y."""
        return self.right @ (self.left.T @ y / self.values[:, None])


class _Accelerations:
    """Solves v_dot = k + (D^T + F) lambda, D v_dot = g for many right-hand sides."""

    def __init__(self, equations: ScaledEquations, rows: _Rows) -> None:
        self.rows = rows
        self.F = equations.F.toarray() @ rows.left
        self.coupling = np.diag(rows.values) + rows.right.T @ self.F

    def __call__(self, k: Floats, g: Floats) -> tuple[Floats, Floats]:
        """v_dot (6 n, c) and lambda (rows, c) of k (6 n, c) and g (rows, c)."""
        rows = self.rows
        along = rows.left.T @ g / rows.values[:, None]
        mu = np.linalg.solve(self.coupling, along - rows.right.T @ k)
        v_dot = k + (rows.right * rows.values + self.F) @ mu
        return v_dot, rows.left @ mu
