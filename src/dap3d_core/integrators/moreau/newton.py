"""A semismooth Newton method for the impulses of contacts and joints, to rounding.

An augmented Lagrangian in the velocities v of bodies: with weights rho, from impulses x of contacts
and y of joints,

    M (v - v_free) = J^T P(x - rho (J v + b)) + D^T (y - rho D (v - v_free)),

P the projection of Coulomb's law (Alart, Curnier, Comp. Meth. Appl. Mech. Eng. 92, 1991), is solved
by Newton's method; then the impulses become what they are there. Its matrix M + J^T rho P' J is
regular however rows depend on each other. Large weights make few rounds, and cost digits: they are
taken back where rounds no longer help.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import attrs
import numpy as np

from dap3d_core.integrators.moreau.dense import solve_dense
from dap3d_core.kernels.array_types import Floats

#: Weights times the masses that rows feel: at first, and how they are taken back, at most.
WEIGHT, LESS, LEAST = 1e5, 1e-2, 1.0
#: A round helps where it leaves less than this part of the residual. Rounds, Newton passes of one,
#: and halvings of a pass at most.
HELPS, ROUNDS, PASSES, CUTS = 0.5, 40, 40, 8
#: Part of the tolerance to which a round is solved.
INNER = 1e-2
TINY = 1e-300
#: Unknowns up to which all matrices are dense, so small that numpy starts no threads; and up to
#: which that of a pass is: scalar elimination is quicker then.
SMALL, DENSE = 60, 150


def project(z: Floats, mu: Floats) -> Floats:
    """The impulses (m, 3) next to z (m, 3) that Coulomb's law allows, given the normal ones."""
    push, size = np.maximum(0.0, z[:, 0]), np.maximum(np.hypot(z[:, 1], z[:, 2]), TINY)
    part = np.minimum(1.0, mu * push / size)
    return np.column_stack([push, part[:, None] * z[:, 1:]])


def slopes(z: Floats, mu: Floats) -> Floats:
    """(m, 3, 3) derivatives of ``project``."""
    push, size = np.maximum(0.0, z[:, 0]), np.maximum(np.hypot(z[:, 1], z[:, 2]), TINY)
    part, d = np.minimum(1.0, mu * push / size), z[:, 1:] / size[:, None]
    slides = mu * push < size
    B = np.zeros((len(mu), 3, 3))
    B[:, 0, 0] = push > 0.0
    B[:, 1:, 0] = np.where(slides & (push > 0.0), mu, 0.0)[:, None] * d
    across = np.eye(2) - slides[:, None, None] * d[:, :, None] * d[:, None, :]
    B[:, 1:, 1:] = part[:, None, None] * across
    return B


def distance(x: Floats, u: Floats, mu: Floats, r: Floats) -> Floats:
    """(m, 3) what impulses x (m, 3) miss Coulomb's law by at velocities u (m, 3).

    r: (m,) masses that the rows feel, kg, which make impulses of velocities.
    """
    z = x - r[:, None] * u
    found = np.empty_like(x)
    found[:, 0] = x[:, 0] - np.maximum(0.0, z[:, 0])
    rim, size = mu * np.maximum(x[:, 0], 0.0), np.hypot(z[:, 1], z[:, 2])
    part = np.where(size > rim, rim / np.maximum(size, TINY), 1.0)
    found[:, 1:] = x[:, 1:] - z[:, 1:] * part[:, None]
    return found


@attrs.frozen(eq=False)
class Rows:
    """The equations of one group of bodies, sparse where they are many.

    Attributes:
        M, inverse: (6 n, 6 n) masses and their inverse.
        J, D: (3 m, 6 n), (k, 6 n) rows of contacts and joints.
        b: (3 m,) u = J v + b.
        free: (6 n,) velocities without impulses.
        mu, r: (m,) friction, and masses that rows feel, kg.
        s: (k,) the same of joints.
    """

    M: Any
    inverse: Any
    J: Any
    D: Any
    b: Floats
    free: Floats
    mu: Floats
    r: Floats
    s: Floats

    def velocities(self, x: Floats, y: Floats) -> Floats:
        """(6 n,) with impulses (m, 3), (k,)."""
        found: Floats = self.free + self.inverse @ (self.J.T @ x.ravel() + self.D.T @ y)
        return found

    def residual(self, x: Floats, y: Floats) -> float:
        """What the law and the joints are missed by, a part of the largest impulse."""
        v = self.velocities(x, y)
        left = np.abs(distance(x, (self.J @ v + self.b).reshape(-1, 3), self.mu, self.r)).max()
        joints = np.abs(self.s * (self.D @ (v - self.free))).max(initial=0.0)
        largest = max(np.abs(x).max(), np.abs(y).max(initial=0.0))
        return float(max(left, joints) / (largest + TINY))


def newton(rows: Rows, x: Floats, y: Floats, tolerance: float) -> tuple[Floats, Floats, float]:
    """Impulses x (m, 3), y (k,) and their residual.

    Args:
        rows: of a group.
        x, y: where it begins.
        tolerance: of the residual.
    """
    best, weight = (x, y, rows.residual(x, y)), WEIGHT
    v = rows.velocities(x, y)
    for _ in range(ROUNDS):
        if best[2] <= tolerance:
            break
        v = _round(rows, v, x, y, weight, INNER * max(0.1 * tolerance, min(best[2], 1e-3)))
        x, y = _impulses(rows, v, x, y, weight)
        left = rows.residual(x, y)
        if left > HELPS * best[2]:
            weight *= LESS
        if left < best[2]:
            best = x, y, left
        elif weight < LEAST:
            break
        else:
            x, y = best[:2]
            v = rows.velocities(x, y)
    return best


def _argument(rows: Rows, v: Floats, x: Floats, weight: float) -> Floats:
    """(m, 3) what is projected."""
    found: Floats = x - weight * rows.r[:, None] * (rows.J @ v + rows.b).reshape(-1, 3)
    return found


def _impulses(rows: Rows, v: Floats, x: Floats, y: Floats, weight: float) -> tuple[Floats, Floats]:
    """The impulses at velocities v, given those that the round began with."""
    pull: Floats = y - weight * rows.s * (rows.D @ (v - rows.free))
    return project(_argument(rows, v, x, weight), rows.mu), pull


def _round(rows: Rows, v: Floats, x: Floats, y: Floats, weight: float, tolerance: float) -> Floats:
    """Velocities that solve the equations of a round."""

    def rest(v: Floats) -> tuple[Floats, float]:
        push, pull = _impulses(rows, v, x, y, weight)
        R = rows.M @ (v - rows.free) - rows.J.T @ push.ravel() - rows.D.T @ pull
        return R, float(R @ (rows.inverse @ R))

    size = float(rows.free @ (rows.M @ rows.free)) + TINY
    R, merit = rest(v)
    for _ in range(PASSES):
        if merit <= tolerance * tolerance * size:
            break
        B = slopes(_argument(rows, v, x, weight), rows.mu)
        for symmetric in (False, True):
            if symmetric:
                B[:, 1:, 0] = 0.0
            step = _solver(rows, B, weight)(-R)
            for cut in range(CUTS):
                new = v + 0.5**cut * step
                left, found = rest(new)
                if found < (1.0 - 0.1 * 0.5**cut) * merit:
                    break
            else:
                continue
            break
        else:
            return v
        v, R, merit = new, left, found
    return v


def _solver(rows: Rows, B: Floats, weight: float) -> Callable[[Floats], Floats]:
    """Solves with the matrix of a Newton pass."""
    m, size = len(rows.mu), len(rows.free)
    blocks = weight * rows.r[:, None, None] * B
    if size <= SMALL:
        K = rows.M + rows.J.T @ (blocks @ rows.J.reshape(m, 3, size)).reshape(3 * m, size)
        return partial(_solved, K + rows.D.T @ (weight * rows.s[:, None] * rows.D))
    import scipy.sparse as sp
    from scipy.sparse.linalg import splu

    middle = sp.bsr_array((blocks, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
    K = rows.M + rows.J.T @ (middle.tocsr() @ rows.J)
    if len(rows.s):
        K = K + rows.D.T @ (sp.diags_array(weight * rows.s) @ rows.D)
    if size <= DENSE:
        return partial(_solved, K.toarray())
    solve: Callable[[Floats], Floats] = splu(K.tocsc()).solve
    return solve


def _solved(K: Floats, R: Floats) -> Floats:
    x = R.copy()
    solve_dense(K, x)
    return x
