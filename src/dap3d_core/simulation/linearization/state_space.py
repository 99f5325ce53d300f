"""State space of linearised equations in independent coordinates.

Coordinates xi of displacements that the position rows allow, eta of velocities that all rows allow:

    x^ = Q xi        v^ = N eta + P xi        D_p Q = 0, D N = 0, P = -D^+ G Q

with orthonormal Q and N from singular values, so that redundant rows need nothing of their own.
Reactions drop out of N^T v^_dot. Rows of the velocity level alone (rolling) make eta fewer than xi.
"""

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.simulation.linearization.scaled_equations import ScaledEquations

Floats = NDArray[np.float64]


@attrs.frozen(eq=False, kw_only=True)
class StateSpace:
    """The state matrix in independent coordinates z = (xi, eta).

    Attributes:
        A: (states, states) z_dot = A z.
        displacement, velocity: (6 n, states) displacements and velocities (global axes) of states.
        acceleration: (6 n, states), multipliers: (rows, states): their changes.
        force_input: (states, 6 n) z_dot by forces on the bodies.
        acceleration_by_force: (6 n, 6 n), multipliers_by_force: (rows, 6 n).
        coordinate_count: number of xi.
        size: magnitude of the terms that A is made of, 1/s: its rounding errors are eps of it.
    """

    A: Floats
    displacement: Floats
    velocity: Floats
    acceleration: Floats
    multipliers: Floats
    force_input: Floats
    acceleration_by_force: Floats
    multipliers_by_force: Floats
    coordinate_count: int
    size: float


def state_space(equations: ScaledEquations, rank: int, position_rank: int) -> StateSpace:
    """The state space of scaled equations.

    Args:
        equations: the equations.
        rank, position_rank: of all rows, and of those with a position level.
    """
    U, S, K, C, G = (getattr(equations, name).toarray() for name in "USKCG")
    D = equations.D.toarray()
    position = equations.position_row
    rows = _Rows(D, rank)
    N = rows.null
    Q = N
    if not np.all(position):
        wider = _Rows(D[position], position_rank).null
        rest = wider - N @ (N.T @ wider)
        left, values, _ = np.linalg.svd(rest, full_matrices=False)
        Q = np.hstack([N, left[:, values > 0.5]])
    P = -rows.pseudoinverse(G @ Q)
    stiffness, damping = K @ Q + C @ P, C @ N
    right = -np.hstack([stiffness, damping])  # K x^ + C v^ of the states
    by_motion = np.hstack(
        [
            equations.acceleration_by_displacement @ Q + equations.acceleration_by_velocity @ P,
            equations.acceleration_by_velocity @ N,
        ]
    )
    solve = _Accelerations(equations, rows)
    v_dot, lam = solve(right, -by_motion)
    by_force, lam_by_force = solve(U.T, np.zeros((len(D), len(U))))
    above = np.hstack([Q.T @ (P + S @ Q), Q.T @ N])
    frequency = max(np.sqrt(np.linalg.norm(K, 2)), np.linalg.norm(C, 2), np.linalg.norm(S, 2))
    displacement = U @ np.hstack([Q, np.zeros_like(N)])
    back = equations.gradient[:, None]
    return StateSpace(
        A=np.vstack([above, N.T @ v_dot]),
        displacement=displacement,
        velocity=U @ np.hstack([P, N]),
        acceleration=U @ v_dot,
        multipliers=lam / back,
        force_input=np.vstack([np.zeros((Q.shape[1], len(U))), N.T @ by_force]),
        acceleration_by_force=U @ by_force,
        multipliers_by_force=lam_by_force / back,
        coordinate_count=Q.shape[1],
        size=float(frequency),
    )


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
        x: Floats = self.right @ (self.left.T @ y / self.values[:, None])
        return x


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
