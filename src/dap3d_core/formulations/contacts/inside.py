"""Forces well inside the cones of contacts that share: a centre of all those that hold.

Each contact has a rim, what is left of its cone: r - |v| of its friction v within a radius r, or
its normal force. Of forces f that hold those are taken with the least of

    |f|^2 / (2 size^2) - sum of log (r^2 - |v|^2),

by Newton's method (Boyd, Vandenberghe, Convex Optimization, 2004, ch. 9 and 11): all are as far
from their limits as they can be together. Before, where the least forces that hold are outside,
normal forces count as if they were t more, and t is made less until it is not needed.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

import numpy as np

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.kernels.runtime.cache import compiled

#: Part of the largest force that cones leave, at least, where contacts hold inside them.
LEAST_RIM = 1e-11
#: Of Newton's method passes at most, the decrement at which it is near, and how much more t weighs
#: each time that it is.
PASSES, NEAR, HEAVIER = 50, 0.25, 10.0
#: A load that bounds nothing.
BOUNDLESS = 1e100
#: Part of a diagonal that is rounding of a pivot.
PIVOT = 1e-16


@compiled
def come_inside(s: ContactArrays, free: int) -> bool:
    """True if forces that hold are inside the cones; they become ``cone.x``, the centre of them.

    Args:
        s: with the least forces that hold, and vectors ``cone.K`` that may be added.
        free: how many of these there are.
    """
    size, terms = 0.0, 5.0 * s.closed_count  # twice as many logarithms as cones, and forces
    for k in range(3 * s.closed_count):
        size = max(size, abs(s.cone.x[k]))
    t = farthest_outside(s)
    if not size > 0.0 or not t < np.inf:
        return False
    t, weight = t + size, 1.0 / size
    while t >= 0.0:
        for _ in range(PASSES):
            t, decrement = pass_with(s, free, t, weight, size)
            if t < 0.0 or not decrement > NEAR:
                break
        if t >= 0.0 and not t < terms / weight - LEAST_RIM * size:
            return False
        weight *= HEAVIER
    for _ in range(PASSES):
        t, decrement = pass_with(s, free, 0.0, 0.0, size)
        if not decrement > NEAR:
            break
    return farthest_outside(s) < 0.0


@compiled
def steepness(s: ContactArrays, k: int) -> float:
    """Radius of closed contact k by what presses; 1 of what has no friction, or slides."""
    c = s.closed[k]
    return 1.0 if s.slides[c] != 0 or (s.alone[c] == 0 and s.mu_s[c] == 0.0) else s.mu_s[c]


@compiled
def is_bound(s: ContactArrays, k: int) -> bool:
    """True if closed contact k has a limit that what it carries could reach."""
    c = s.closed[k]
    slides_alone = s.slides[c] != 0 and s.alone[c] != 0
    return not slides_alone and s.load[c] < BOUNDLESS and steepness(s, k) > 0.0


@compiled
def radius_of(s: ContactArrays, k: int) -> float:
    """The radius of the cone of closed contact k."""
    c, u = s.closed[k], s.cone.under[k]
    pressing = s.load[c] + (s.cone.x[3 * u] if s.gapless[c] == 0.0 else 0.0)
    return steepness(s, k) * pressing


@compiled
def part_across(s: ContactArrays, k: int, i: int) -> float:
    """By how much component i counts in the cone of closed contact k: an ellipse is a circle."""
    c = s.closed[k]
    if (i == 0 and s.gapless[c] == 0.0) or s.slides[c] != 0:
        return 0.0
    return 1.0 / s.ratio_s[c] if i == 2 and s.ratio_s[c] > 0.0 else 1.0


@compiled
def rim_of(s: ContactArrays, k: int) -> float:
    """What is left of the cone of closed contact k; infinite of one without a limit."""
    if not is_bound(s, k):
        return np.inf
    square = 0.0
    for i in range(3):
        v = part_across(s, k, i) * s.cone.x[3 * k + i]
        square += v * v
    return radius_of(s, k) - math.sqrt(square)


@compiled
def farthest_outside(s: ContactArrays) -> float:
    """How much more normal force would bring all onto their cones; below zero inside."""
    found = -np.inf
    for k in range(s.closed_count):
        if is_bound(s, k):
            found = max(found, -rim_of(s, k) / steepness(s, k))
    return found


@compiled
def pass_with(
    s: ContactArrays, free: int, t: float, weight: float, size: float
) -> tuple[float, float]:
    """A pass of Newton's method; t behind it, and the decrement before.

    weight: of t, which is kept where it has none.
    """
    n, x, K, H, g = free + (1 if weight > 0.0 else 0), s.cone.x, s.cone.K, s.cone.S, s.cone.F
    for j in range(n):
        g[j] = weight if j == free else 0.0
        for k in range(3 * s.closed_count):
            g[j] += K[k, j] * x[k] / (size * size)
        for q in range(j + 1):
            H[j, q] = 1.0 / (size * size) if q == j < free else 0.0
    for k in range(s.closed_count):
        if is_bound(s, k):
            add_cone(s, k, free, n, t)
    decrement = solve_definite(s, n)
    part, step = 1.0 / (1.0 + decrement) if decrement > NEAR else 1.0, s.cone.step
    while part > PIVOT:
        for k in range(3 * s.closed_count):
            for j in range(free):
                x[k] += part * K[k, j] * step[j]
        later = t + part * step[free] if n > free else t
        if farthest_outside(s) < later:
            return later, decrement
        for k in range(3 * s.closed_count):
            for j in range(free):
                x[k] -= part * K[k, j] * step[j]
        part *= 0.5
    return t, 0.0


@compiled
def add_cone(s: ContactArrays, k: int, free: int, n: int, t: float) -> None:
    """Add the derivatives of the logarithm of a cone to those of the sum."""
    c, u, mu = s.closed[k], s.cone.under[k], steepness(s, k)
    K, H, g, wider, slope = s.cone.K, s.cone.S, s.cone.F, s.cone.q, s.cone.moved
    r, square = radius_of(s, k) + mu * t, 0.0
    for i in range(3):
        v = part_across(s, k, i) * s.cone.x[3 * k + i]
        square += v * v
    left = (r - math.sqrt(square)) * (r + math.sqrt(square))
    for j in range(n):
        wider[j] = mu if j == free else 0.0
        if j < free and s.gapless[c] == 0.0:
            wider[j] = mu * K[3 * u, j]
        slope[j] = r * wider[j]
        for i in range(3):
            part = part_across(s, k, i)
            slope[j] -= part * part * s.cone.x[3 * k + i] * K[3 * k + i, j]
        slope[j] *= 2.0 / left
        g[j] -= slope[j]
    for j in range(n):
        for q in range(j + 1):
            bend = wider[j] * wider[q]
            for i in range(3):
                part = part_across(s, k, i)
                bend -= part * part * K[3 * k + i, j] * K[3 * k + i, q]
            H[j, q] += slope[j] * slope[q] - 2.0 * bend / left


@compiled
def solve_definite(s: ContactArrays, n: int) -> float:
    """Put ``cone.step``, -H^-1 g, by Cholesky's factors; returns its decrement, (g H^-1 g)^(1/2)."""
    H, g, x, square = s.cone.S, s.cone.F, s.cone.step, 0.0
    for j in range(n):
        own = H[j, j]
        for q in range(j):
            total = H[j, q]
            for p in range(q):
                total -= H[j, p] * H[q, p]
            H[j, q] = total * H[q, q]
        pivot = own
        for q in range(j):
            pivot -= H[j, q] * H[j, q]
        H[j, j] = 1.0 / math.sqrt(pivot) if pivot > PIVOT * own else 0.0
        x[j] = -g[j]
        for q in range(j):
            x[j] -= H[j, q] * x[q]
        x[j] *= H[j, j]
        square += x[j] * x[j]
    for j in range(n - 1, -1, -1):
        for p in range(j + 1, n):
            x[j] -= H[p, j] * x[p]
        x[j] *= H[j, j]
    return math.sqrt(square)
