"""Coulomb's law as a complementarity problem: u = A x + b, contact by contact (normal, t1, t2),

    0 <= x_N  _|_  u_N >= 0,    |x_T| <= mu x_N,    u_T = -kappa x_T, kappa >= 0, on the rim

by projected Gauss-Seidel, which comes near, and a semismooth Newton on the projection equations,
which ends at rounding (Alart and Curnier, Comp. Meth. Appl. Mech. Eng. 92, 1991):

    x_N = max(0, x_N - r u_N),    x_T = proj(mu (x_N + more); x_T - r u_T)

Dense, for as many contacts as touch in one place.
"""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats

#: Sweeps of the first try after Newton alone, and how many tries, each of four times as many.
SWEEPS, TRIES = 50, 6
FIRST = 5
#: Newton passes, halvings of a step in one, and where it stands at rounding.
PASSES, CUTS, ROUNDING = 50, 12, 1e-15
#: Of the scale of the solution: a problem counts as solved.
SOLVED = 1e-12
_TINY = 1e-300


def solve_cone(
    A: Floats, b: Floats, mu: Any, more: Any = None, start: Any = None, tries: int = TRIES
) -> tuple[Floats, float]:
    """The solution x (3 m,), and the residual of the equations over its size.

    Args:
        A, b: (3 m, 3 m), (3 m,) of u = A x + b.
        mu: (m,) coefficients of friction.
        more: (m,) normal impulses of an earlier phase, which widen the discs.
        start: (3 m,) where to begin.
        tries: at most; fewer where it is to be known whether there is a solution nearby.
    """
    count = len(b) // 3
    mu, more = np.asarray(mu, dtype=float), np.zeros(count) if more is None else more
    x = np.zeros(len(b)) if start is None else start.copy()
    left = 0.0
    if not count:
        return x, left
    r = 1.0 / np.maximum(np.diag(A).reshape(-1, 3).max(axis=1), _TINY)
    scale = float(np.abs(b / np.maximum(np.diag(A), _TINY)).max()) + _TINY
    for k in range(tries):
        x = _sweep(A, b, mu, x, r, more, SWEEPS * 4 ** (k - 1) if k else FIRST)
        x, left = _newton(A, b, mu, x, r, more)
        if left <= SOLVED * scale:
            break
    return x, left / scale


def _project(z: Floats, radius: Floats) -> Floats:
    size = np.hypot(z[..., 0], z[..., 1])
    factor = np.where(size > radius, radius / np.where(size > 0.0, size, 1.0), 1.0)
    projected: Floats = z * factor[..., None]
    return projected


def _residual(x: Floats, u: Floats, mu: Floats, r: Floats, more: Floats) -> Floats:
    X, U = x.reshape(-1, 3), u.reshape(-1, 3)
    F = np.empty_like(X)
    F[:, 0] = X[:, 0] - np.maximum(0.0, X[:, 0] - r * U[:, 0])
    radius = mu * np.maximum(X[:, 0] + more, 0.0)
    F[:, 1:] = X[:, 1:] - _project(X[:, 1:] - r[:, None] * U[:, 1:], radius)
    return F.ravel()


def _sweep(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats, sweeps: int
) -> Floats:
    """Projected Gauss-Seidel."""
    for _ in range(sweeps):
        change = 0.0
        for c in range(len(mu)):
            k = slice(3 * c, 3 * c + 3)
            u, old = A[k] @ x + b[k], x[k].copy()
            x[3 * c] = max(0.0, x[3 * c] - u[0] / max(A[3 * c, 3 * c], _TINY))
            u += A[k, 3 * c] * (x[3 * c] - old[0])
            radius = np.array(mu[c] * max(x[3 * c] + more[c], 0.0))
            x[3 * c + 1 : 3 * c + 3] = _project(x[3 * c + 1 : 3 * c + 3] - r[c] * u[1:], radius)
            change = max(change, float(np.abs(x[k] - old).max()))
        if change <= ROUNDING * (float(np.abs(x).max()) + _TINY):
            break
    return x


def _slopes(A: Floats, x: Floats, u: Floats, mu: Floats, r: Floats, more: Floats) -> Floats:
    """A generalised derivative of the residual."""
    unit = np.eye(len(x))
    found = unit.copy()
    for c in range(len(mu)):
        k = 3 * c
        if x[k] - r[c] * u[k] > 0.0:
            found[k] = r[c] * A[k]
        t = slice(k + 1, k + 3)
        z, dz = x[t] - r[c] * u[t], unit[t] - r[c] * A[t]
        size, radius = float(np.hypot(*z)), mu[c] * max(x[k] + more[c], 0.0)
        if size <= radius:
            found[t] -= dz
        elif size > 0.0:
            d = z / size
            found[t] -= radius / size * (np.eye(2) - np.outer(d, d)) @ dz
            if x[k] + more[c] > 0.0:
                found[t] -= mu[c] * np.outer(d, unit[k])
    return found


def _newton(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats
) -> tuple[Floats, float]:
    """Semismooth Newton with a line search; x and its residual."""
    best = float(np.abs(_residual(x, A @ x + b, mu, r, more)).max())
    least = float(np.abs(b / np.maximum(np.diag(A), _TINY)).max())
    for _ in range(PASSES):
        if best <= ROUNDING * (float(np.abs(x).max()) + least + _TINY):
            break
        u = A @ x + b
        F = _residual(x, u, mu, r, more)
        step = np.linalg.lstsq(_slopes(A, x, u, mu, r, more), -F, rcond=1e-13)[0]
        for cut in range(CUTS):
            new = x + step * 0.5**cut
            size = float(np.abs(_residual(new, A @ new + b, mu, r, more)).max())
            if size < best:
                x, best = new, size
                break
        else:
            break
    return x, best
