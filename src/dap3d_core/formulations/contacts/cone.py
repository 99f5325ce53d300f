"""Coulomb's law as a complementarity problem: u = A x + b, contact by contact (normal, t1, t2),

    0 <= x_N  _|_  u_N >= 0,    |x_T| <= mu x_N,    u_T = -kappa x_T, kappa >= 0, on the rim

by projected Gauss-Seidel, which comes near, and a semismooth Newton on the projection equations,
which ends at rounding (Alart and Curnier, Comp. Meth. Appl. Mech. Eng. 92, 1991):

    x_N = max(0, x_N - r u_N),    x_T = proj(mu (x_N + more); x_T - r u_T)

Friction without a normal may act in all three directions: x = proj(mu more; x - r u).
Where contacts share what they carry Newton may stall. Then the proximal point method comes nearer
(Rockafellar, SIAM J. Control Optim. 14, 1976): A + D and b - D x, x of the problem before.
Dense, for as many contacts as touch in one place.
"""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Sweeps of the first try after Newton alone, and how many tries, each of four times as many.
SWEEPS, TRIES = 50, 6
FIRST = 5
#: Newton passes, halvings of a step in one, and where it stands at rounding.
PASSES, CUTS, RESIDUAL_ROUNDING = 50, 12, 1e-15
#: Of the scale of the solution: a problem counts as solved.
SOLVED = 1e-12
#: Parts of mobilities that are added to them; sweeps of a step, and how many steps with each.
ADDED, CLOSER, STEPS = (1e-4, 1e-5, 1e-6), 1000, 40
TINY = 1e-300


def solve_cone(
    A: Floats,
    b: Floats,
    mu: Any,
    more: Any = None,
    start: Any = None,
    tries: int = TRIES,
    gapless: Any = None,
    ratio: Any = None,
) -> tuple[Floats, float]:
    """The solution x (3 m,), and the residual of the equations over its size, inf of none.

    Args:
        A, b: (3 m, 3 m), (3 m,) of u = A x + b.
        mu: (m,) coefficients of friction.
        more: (m,) normal impulses of an earlier phase, which widen the discs.
        start: (3 m,) where to begin.
        tries: at most; fewer where it is to be known whether there is a solution nearby, and then
            nothing else is tried.
        gapless: (m,) 1 of friction in three directions, else 0.
        ratio: (m,) of coefficients along t2 to mu, that along t1, where friction is in an ellipse.
    """
    if ratio is not None and np.any(ratio != 1.0):  # stretched to a circle
        stretch = np.column_stack([np.ones((len(ratio), 2)), ratio]).ravel()
        start = None if start is None else start / np.where(stretch > 0.0, stretch, 1.0)
        stretched = stretch[:, None] * A * stretch
        x, left = solve_cone(stretched, stretch * b, mu, more, start, tries, gapless)
        return stretch * x, left
    count = len(b) // 3
    mu, more = np.asarray(mu, dtype=float), np.zeros(count) if more is None else more
    free = np.zeros(count) if gapless is None else gapless
    x = np.zeros(len(b)) if start is None else start.copy()
    left = 0.0
    if not count:
        return x, left
    r = 1.0 / np.maximum(np.diag(A).reshape(-1, 3).max(axis=1), TINY)
    scale = float(np.abs(b / np.maximum(np.diag(A), TINY)).max()) + TINY
    for k in range(tries):
        sweep(A, b, mu, x, r, more, free, SWEEPS * 4 ** (k - 1) if k else FIRST)
        x, left = _newton(A, b, mu, x, r, more, free)
        if left <= SOLVED * scale:
            break
    y = np.zeros_like(x)
    for part in np.repeat(ADDED, STEPS) if tries == TRIES else ():
        if left <= SOLVED * scale or not np.all(np.isfinite(y)):
            break
        own = part * np.diag(A)
        firm, moved = A + np.diag(own), b - own * y
        sweep(firm, moved, mu, y, r, more, free, CLOSER)
        y, _ = _newton(firm, moved, mu, y, r, more, free)
        new, rest = _newton(A, b, mu, y, r, more, free)
        x, left = (x, left) if rest >= left else (new, rest)
    left += RESIDUAL_ROUNDING * float(np.abs(x).max())  # without one x may grow
    return x, left / scale if np.isfinite(left) else np.inf


@compiled
def residual_of(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats, free: Floats, F: Floats,
    S: Floats,
) -> None:  # fmt: skip
    """The residual F of the equations at x, and a generalised derivative S of it, unless empty."""
    size = x.shape[0]
    for c in range(mu.shape[0]):
        k = 3 * c
        z0, z1, z2 = x[k] - r[c] * b[k], x[k + 1] - r[c] * b[k + 1], x[k + 2] - r[c] * b[k + 2]
        for q in range(size):
            z0 -= r[c] * A[k, q] * x[q]
            z1 -= r[c] * A[k + 1, q] * x[q]
            z2 -= r[c] * A[k + 2, q] * x[q]
        is_free = free[c] != 0.0
        pressing = more[c] if is_free else x[k] + more[c]
        first = z0 if is_free else 0.0
        radius = mu[c] * max(pressing, 0.0)
        length = np.sqrt(first * first + z1 * z1 + z2 * z2)
        part = radius / length if length > radius else 1.0
        F[k] = x[k] - (part * z0 if is_free else max(0.0, z0))
        F[k + 1], F[k + 2] = x[k + 1] - part * z1, x[k + 2] - part * z2
        if S.shape[0] == 0:
            continue
        d1, d2 = (z1 / length, z2 / length) if length > radius else (0.0, 0.0)
        d0 = first / length if length > radius else 0.0
        rim = mu[c] if pressing > 0.0 and not is_free else 0.0
        for q in range(size):
            own0, own1, own2 = float(q == k), float(q == k + 1), float(q == k + 2)
            s1, s2 = own1 - r[c] * A[k + 1, q], own2 - r[c] * A[k + 2, q]
            s0 = own0 - r[c] * A[k, q]
            along = d0 * s0 + d1 * s1 + d2 * s2
            S[k, q] = r[c] * A[k, q] if z0 > 0.0 else own0
            if is_free:
                S[k, q] = own0 - part * (s0 - along * d0)
            S[k + 1, q] = own1 - part * (s1 - along * d1) - rim * d1 * own0
            S[k + 2, q] = own2 - part * (s2 - along * d2) - rim * d2 * own0


@compiled
def sweep(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats, free: Floats, sweeps: int
) -> None:
    """Projected Gauss-Seidel, in place."""
    size = x.shape[0]
    for _ in range(sweeps):
        change = largest = 0.0
        for c in range(mu.shape[0]):
            k = 3 * c
            u0, u1, u2 = b[k], b[k + 1], b[k + 2]
            for q in range(size):
                u0 += A[k, q] * x[q]
                u1 += A[k + 1, q] * x[q]
                u2 += A[k + 2, q] * x[q]
            is_free = free[c] != 0.0
            n = x[k] if is_free else max(0.0, x[k] - u0 / max(A[k, k], TINY))
            u1 += A[k + 1, k] * (n - x[k])
            u2 += A[k + 2, k] * (n - x[k])
            z1, z2 = x[k + 1] - r[c] * u1, x[k + 2] - r[c] * u2
            z0 = x[k] - r[c] * u0 if is_free else 0.0
            radius = mu[c] * max(more[c] if is_free else n + more[c], 0.0)
            length = np.sqrt(z0 * z0 + z1 * z1 + z2 * z2)
            factor = radius / length if length > radius else 1.0
            n = factor * z0 if is_free else n
            z1, z2 = factor * z1, factor * z2
            change = max(change, abs(n - x[k]), abs(z1 - x[k + 1]), abs(z2 - x[k + 2]))
            x[k], x[k + 1], x[k + 2] = n, z1, z2
        for q in range(size):
            largest = max(largest, abs(x[q]))
        if change <= RESIDUAL_ROUNDING * (largest + TINY):
            break


@compiled
def shorten(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats, free: Floats,
    F: Floats, none: Floats, step: Floats, new: Floats, best: float,
) -> float:  # fmt: skip
    """The residual at ``new``, which is x and the first part of a step that makes it less.

    The parts are 1, 1/2, ...; infinite where none does.
    """
    part = 1.0
    for _ in range(CUTS):
        for q in range(x.shape[0]):
            new[q] = x[q] + step[q] * part
        residual_of(A, b, mu, new, r, more, free, F, none)
        size = total = 0.0
        for q in range(x.shape[0]):
            size, total = max(size, abs(F[q])), total + abs(F[q])
        if (size < best) & (total < np.inf):  # else not numbers
            return size
        part *= 0.5
    return np.inf


def _newton(
    A: Floats, b: Floats, mu: Floats, x: Floats, r: Floats, more: Floats, free: Floats
) -> tuple[Floats, float]:
    """Semismooth Newton with a line search; x and its residual."""
    F, S, none = np.empty_like(x), np.empty_like(A), np.empty((0, 0))
    least = float(np.abs(b / np.maximum(np.diag(A), TINY)).max())
    residual_of(A, b, mu, x, r, more, free, F, none)
    best = float(np.abs(F).max())
    for _ in range(PASSES):
        rounding = RESIDUAL_ROUNDING * (float(np.abs(x).max()) + least + TINY)
        if best <= rounding or not np.isfinite(best):
            break
        residual_of(A, b, mu, x, r, more, free, F, S)
        step = np.linalg.lstsq(S, -F, rcond=1e-13)[0]
        new = np.empty_like(x)
        size = shorten(A, b, mu, x, r, more, free, F, none, step, new, best)
        if not size < best:
            break
        x, best = new, size
    return x, best
