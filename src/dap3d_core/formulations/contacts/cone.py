"""Coulomb's law as a complementarity problem: u = A x + b, contact by contact (normal, t1, t2),

    0 <= x_N  _|_  u_N >= 0,    |x_T| <= mu x_N,    u_T = -kappa x_T, kappa >= 0, on the rim

by projected Gauss-Seidel, which comes near, and a semismooth Newton on the projection equations,
which ends at rounding (Alart and Curnier, Comp. Meth. Appl. Mech. Eng. 92, 1991):

    x_N = max(0, x_N - r u_N),    x_T = proj(mu (x_N + more); x_T - r u_T)

Friction without a normal may act in all three directions: x = proj(mu more; x - r u). What resists
rolling and spinning has the normal of another contact: x_T = proj(mu x_N of that; x_T - r u_T).
Where contacts share what they carry Newton may stall. Then the proximal point method comes nearer
(Rockafellar, SIAM J. Control Optim. 14, 1976): A + D and b - D x, x of the problem before.
Friction in an ellipse is that in a circle of rows that are stretched.
Dense, for as many contacts as touch in one place.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import attrs
import numpy as np

from dap3d_core.assembly.evaluate import copy, largest, zero
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, Matrix, Scalar
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Sweeps of the first try after Newton alone, and how many tries, each of four times as many.
SWEEPS, TRIES = 50, 6
FIRST = 5
#: Newton passes, halvings of a step in one, and where it stands at rounding.
PASSES, CUTS, RESIDUAL_ROUNDING = 50, 12, 1e-15
#: Part of the longest column below which those of a pass depend on each other.
DEPENDENT = 1e-13
#: Of the scale of the solution: a problem counts as solved.
SOLVED = 1e-12
#: Parts of mobilities that are added to them; sweeps of a step, and how many steps with each.
ADDED, CLOSER, STEPS = (1e-4, 1e-5, 1e-6), 1000, 40
TINY = 1e-300


@attrs.define(eq=False, kw_only=True, slots=False)
class Cone(Arrays):
    """A problem of ``count`` contacts, of m at most, and scratch."""

    count = Scalar[int]("integer")

    integer: Integers
    A: Matrix  # (3 m, 3 m), (3 m,) of u = A x + b
    b: Floats
    x: Floats  # where to begin, and the solution
    noise: Floats  # (3 m,) what of b is rounding: less of a residual is none
    mu: Floats  # (m,) coefficients of friction
    more: Floats  # (m,) normal impulses of an earlier phase, which widen the discs
    gapless: Floats  # (m,) 1 of friction in three directions, else 0
    ratio: Floats  # (m,) of coefficients along t2 to mu, that along t1
    under: Integers  # (m,) contact whose normal widens the disc: itself, or where it resists
    K: Matrix  # A and b stretched; and firmer, with its derivatives
    q: Floats
    firm: Matrix
    moved: Floats
    S: Matrix
    r: Floats  # (m,) 1 over the largest mobility of each
    F: Floats  # (3 m,) residual, step, trial, solutions
    step: Floats
    trial: Floats
    y: Floats
    z: Floats
    new: Floats
    w: Matrix  # of factors
    order: Integers


def cone_of(m: int) -> Cone:
    """Room for problems of m contacts."""
    n = 3 * m
    vectors = ("b", "x", "noise", "q", "moved", "F", "step", "trial", "y", "z", "new")
    return Cone(
        integer=np.zeros(1, dtype=np.int64),
        **{name: np.zeros((n, n)) for name in ("A", "K", "firm", "S")},
        **{name: np.zeros(n) for name in vectors},
        **{name: np.zeros(m) for name in ("mu", "more", "gapless", "r")},
        ratio=np.ones(m),
        under=np.arange(m),
        w=np.zeros((3, n)),
        order=np.zeros(n, dtype=np.int64),
    )


@compiled
def solve_cone(c: Cone) -> float:
    """Solve for ``x``, from what stands there; the residual over its size, infinite of none."""
    n = 3 * c.count
    if n == 0:
        return 0.0
    scale = max(stretch(c), largest_noise(c) / SOLVED)
    z, left, sweeps = c.z[:n], 0.0, FIRST
    for k in range(TRIES):
        sweep(c, c.K, c.q, z, sweeps)
        sweeps = 4 * sweeps if k > 0 else SWEEPS
        left = newton(c, c.K, c.q, z, scale)
        if left <= SOLVED * scale:
            break
    if not left <= SOLVED * scale:
        left = come_nearer(c, left, scale)
    for k in range(n):
        c.x[k] = z[k] * (c.ratio[k // 3] if k % 3 == 2 else 1.0)
    left += RESIDUAL_ROUNDING * largest(z)  # without one x may grow
    return left / scale if left < np.inf else np.inf


@compiled
def stretch(c: Cone) -> float:
    """Stretch what friction in ellipses acts along until these are circles; the scale of x.

    What a row of rounding changes of itself says nothing of that, but what its contact does; of
    friction in three directions a row may be weak, and ask for more force than the others.
    """
    scale = 0.0
    for i in range(3 * c.count):
        own = c.ratio[i // 3] if i % 3 == 2 else 1.0
        for k in range(3 * c.count):
            c.K[i, k] = own * c.A[i, k] * (c.ratio[k // 3] if k % 3 == 2 else 1.0)
        c.q[i], c.z[i] = own * c.b[i], c.x[i] / own if own > 0.0 else c.x[i]
    for k in range(c.count):
        c.r[k] = 1.0 / max(c.K[3 * k, 3 * k], c.K[3 * k + 1, 3 * k + 1],
                           c.K[3 * k + 2, 3 * k + 2], TINY)  # fmt: skip
        for i in range(3 * k, 3 * k + 3):
            own = c.r[k] if c.gapless[k] == 0.0 else 1.0 / max(c.K[i, i], TINY)
            scale = max(scale, abs(c.q[i]) * own)
    return scale + TINY


@compiled
def largest_noise(c: Cone) -> float:
    """The residual that is rounding of the rates of a problem that is stretched."""
    found = 0.0
    for k in range(3 * c.count):
        found = max(found, c.noise[k] * c.r[k // 3])
    return found


@compiled
def come_nearer(c: Cone, left: float, scale: float) -> float:
    """Come nearer to a solution z by problems that are firmer; the residual."""
    n = 3 * c.count
    y, z, new, firm, moved = c.y[:n], c.z[:n], c.new[:n], c.firm, c.moved
    zero(y)
    for part in ADDED:
        for _ in range(STEPS):
            total = 0.0
            for i in range(n):
                total += abs(y[i])
            if (left <= SOLVED * scale) | (not total < np.inf):
                return left
            for i in range(n):
                copy(firm[i][:n], c.K[i])
                firm[i, i] += part * c.K[i, i]
                moved[i] = c.q[i] - part * c.K[i, i] * y[i]
            sweep(c, firm, moved, y, CLOSER)
            newton(c, firm, moved, y, scale)
            copy(new, y)
            rest = newton(c, c.K, c.q, new, scale)
            if rest < left:
                left = rest
                copy(z, new)
    return left


@compiled
def residual_of(c: Cone, A: Floats, b: Floats, x: Floats, derives: bool) -> None:
    """The residual F of the equations at x, and a generalised derivative S of it if asked for."""
    F, S, mu, r, more, free = c.F, c.S, c.mu, c.r, c.more, c.gapless
    size = x.shape[0]
    for j in range(c.count):
        k = 3 * j
        z0, z1, z2 = x[k] - r[j] * b[k], x[k + 1] - r[j] * b[k + 1], x[k + 2] - r[j] * b[k + 2]
        for q in range(size):
            z0 -= r[j] * A[k, q] * x[q]
            z1 -= r[j] * A[k + 1, q] * x[q]
            z2 -= r[j] * A[k + 2, q] * x[q]
        is_free = free[j] != 0.0
        if A[k, k] == 0.0 and not is_free:
            z0 = 0.0  # friction of a joint has no normal
        u = c.under[j]
        pressing = more[j] if is_free else x[3 * u] + more[u]
        first = z0 if is_free else 0.0
        radius = mu[j] * max(pressing, 0.0)
        length = np.sqrt(first * first + z1 * z1 + z2 * z2)
        part = radius / length if length > radius else 1.0
        F[k] = x[k] - (part * z0 if is_free else max(0.0, z0))
        F[k + 1], F[k + 2] = x[k + 1] - part * z1, x[k + 2] - part * z2
        if not derives:
            continue
        d1, d2 = (z1 / length, z2 / length) if length > radius else (0.0, 0.0)
        d0 = first / length if length > radius else 0.0
        rim = mu[j] if pressing > 0.0 and not is_free else 0.0
        for q in range(size):
            own0, own1, own2 = float(q == k), float(q == k + 1), float(q == k + 2)
            s1, s2 = own1 - r[j] * A[k + 1, q], own2 - r[j] * A[k + 2, q]
            s0 = own0 - r[j] * A[k, q]
            along = d0 * s0 + d1 * s1 + d2 * s2
            S[k, q] = r[j] * A[k, q] if z0 > 0.0 else own0
            if is_free:
                S[k, q] = own0 - part * (s0 - along * d0)
            wider = rim * float(q == 3 * u)
            S[k + 1, q] = own1 - part * (s1 - along * d1) - wider * d1
            S[k + 2, q] = own2 - part * (s2 - along * d2) - wider * d2


@compiled
def sweep(c: Cone, A: Floats, b: Floats, x: Floats, sweeps: int) -> None:
    """Projected Gauss-Seidel, in place."""
    mu, r, more, free = c.mu, c.r, c.more, c.gapless
    size = x.shape[0]
    for _ in range(sweeps):
        change = 0.0
        for j in range(c.count):
            k = 3 * j
            u0, u1, u2 = b[k], b[k + 1], b[k + 2]
            for q in range(size):
                u0 += A[k, q] * x[q]
                u1 += A[k + 1, q] * x[q]
                u2 += A[k + 2, q] * x[q]
            is_free = free[j] != 0.0
            n = x[k] if is_free else max(0.0, x[k] - u0 / max(A[k, k], TINY))
            n = n if is_free or A[k, k] != 0.0 else 0.0
            u1 += A[k + 1, k] * (n - x[k])
            u2 += A[k + 2, k] * (n - x[k])
            z1, z2 = x[k + 1] - r[j] * u1, x[k + 2] - r[j] * u2
            z0 = x[k] - r[j] * u0 if is_free else 0.0
            u = c.under[j]
            pressing = n + more[j] if u == j else x[3 * u] + more[u]
            radius = mu[j] * max(more[j] if is_free else pressing, 0.0)
            length = np.sqrt(z0 * z0 + z1 * z1 + z2 * z2)
            factor = radius / length if length > radius else 1.0
            n = factor * z0 if is_free else n
            z1, z2 = factor * z1, factor * z2
            change = max(change, abs(n - x[k]), abs(z1 - x[k + 1]), abs(z2 - x[k + 2]))
            x[k], x[k + 1], x[k + 2] = n, z1, z2
        if change <= RESIDUAL_ROUNDING * (largest(x) + TINY):
            break


@compiled
def newton(c: Cone, A: Floats, b: Floats, x: Floats, scale: float) -> float:
    """Semismooth Newton with a line search, in place; the residual."""
    n = x.shape[0]
    residual_of(c, A, b, x, False)
    best = largest_residual(c, n)
    for _ in range(PASSES):
        if (best <= RESIDUAL_ROUNDING * (largest(x) + scale)) | (not best < np.inf):
            break
        residual_of(c, A, b, x, True)
        for k in range(n):
            c.F[k] = -c.F[k]
        rank = factor_least(c.S, n, n, DEPENDENT, 0.0, c.w, c.order)
        solve_least(c.S, n, n, rank, c.w, c.order, c.F, c.step)
        size = shorten(c, A, b, x, best)
        if not size < best:
            break
        best = size
        copy(x, c.trial[:n])
    return best


@compiled
def shorten(c: Cone, A: Floats, b: Floats, x: Floats, best: float) -> float:
    """The residual at ``trial``, which is x and the first part of a step that makes it less.

    The parts are 1, 1/2, ...; infinite where none does.
    """
    n, part = x.shape[0], 1.0
    trial = c.trial[:n]
    for _ in range(CUTS):
        for k in range(n):
            trial[k] = x[k] + c.step[k] * part
        residual_of(c, A, b, trial, False)
        size = largest_residual(c, n)
        if size < best:
            return size
        part *= 0.5
    return np.inf


@compiled
def largest_residual(c: Cone, n: int) -> float:
    """The largest component of the residual; infinite where one is not a number."""
    size = total = 0.0
    for k in range(n):
        size, total = max(size, abs(c.F[k])), total + abs(c.F[k])
    return size if total < np.inf else np.inf
