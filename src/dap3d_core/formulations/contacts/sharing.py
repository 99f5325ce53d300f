"""Contacts that share what they carry: forces well within cones, and rows that do not hold.

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

from dap3d_core.assembly.evaluate import copy, largest, zero
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import (
    BOUNDLESS,
    largest_entry,
    put_open,
    put_rates,
    put_sizes,
    some_slide,
)
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, put_null, solve_least

#: Part of the largest entry of A below which rows depend on each other.
DEPENDENT = 1e-12
#: Part of the largest acceleration that may be left where contacts hold, by shares alone: their
#: rows take it, within what the cones leave.
HELD, OF_REST, RATE_ROUNDING = 1e-9, 0.05, 1e-13
#: Part of the largest force that is rounding of one.
FORCE_ROUNDING = 1e-12
#: Part of the largest force that cones leave, at least, where contacts hold inside them.
LEAST_RIM = 1e-11
#: Part of the largest force within cones by which forces as of feet are taken where some slide.
WELL = 1e-3
#: Of Newton's method passes at most, the decrements at which it is near and at which it has ended
#: by its next pass, and how much more t weighs each time that it is near.
PASSES, NEAR, CENTRED, HEAVIER = 50, 0.25, 1e-6, 10.0
#: Part of a diagonal that is rounding of a pivot.
PIVOT = 1e-16


@compiled
def do_share(s: ContactArrays) -> bool:
    """True if forces of closed contacts may change without a change of the motion."""
    n, A = put_own_rows(s), s.cone.A
    for i in range(n):
        for k in range(n):
            s.B[i, k] = A[s.rows[i], s.rows[k]]
    least = DEPENDENT * max(largest_entry(A, 3 * s.closed_count), most_mobile(s))
    return factor_least(s.B, n, n, 0.0, least, s.w, s.order) < n


@compiled
def most_mobile(s: ContactArrays) -> float:
    """The most that a row of closed contacts changes of itself, as if there were no joints."""
    most = 0.0
    for k in range(s.closed_count):
        for row in range(3 * s.closed[k], 3 * s.closed[k] + 3):
            most = max(most, mobility(s, row, row, False))
    return most


@compiled
def put_own_rows(s: ContactArrays) -> int:
    """Rows along which closed contacts act: of what slides, or is smooth, the normal alone."""
    count = 0
    for k in range(s.closed_count):
        c = s.closed[k]
        slides, alone = s.slides[c] != 0, s.alone[c] != 0
        for i in range(3):
            acts = not (slides and alone)
            if i > 0:
                acts = not slides and (alone or s.mu_s[c] > 0.0)
            if acts and s.holds[c, i] != 0:
                s.rows[count] = 3 * k + i
                count += 1
    return count


@compiled
def are_inside(s: ContactArrays) -> bool:
    """Forces ``inner`` well within the cones of closed contacts that share, and hold, if any."""
    resists = False
    for k in range(s.closed_count):
        resists |= s.under[s.closed[k]] >= 0
    # as a rule what resists rolling carries nothing that others can
    return (resists and are_held_inside(s, False)) or are_held_inside(s, True)


@compiled
def are_held_inside(s: ContactArrays, resisting: bool) -> bool:
    """True if forces within the cones hold; these are ``inner`` then.

    resisting: what resists rolling carries something.
    """
    put_open(s)
    free = put_least(s, resisting)
    if free < 0 or not come_inside(s, free):
        return False
    put_rates(s)
    n, big = put_own_rows(s), put_sizes(s, True)
    for q in range(n):
        k = s.rows[q] // 3
        row = 3 * k
        own = max(s.cone.A[row, row], s.cone.A[row + 1, row + 1], s.cone.A[row + 2, row + 2])
        rest = OF_REST * own * rim_of(s, k) + RATE_ROUNDING * big
        if not abs(s.rates[s.rows[q]]) <= min(HELD * s.sizes[k], rest):
            return False
    if not is_left_to_rows(s):
        return False
    copy(s.inner[: 3 * s.closed_count], s.cone.x)
    return True


@compiled
def put_least(s: ContactArrays, resisting: bool) -> int:
    """The least forces ``cone.x`` that hold, if any, and vectors ``cone.K`` of what may be added.

    Returns how many of these there are; -1 where nothing holds.
    """
    n, A, x, K, count = put_own_rows(s), s.cone.A, s.cone.x, s.cone.K, 0
    zero(x[: 3 * s.closed_count])
    for q in range(n):
        s.right[q] = -s.cone.b[s.rows[q]]
        for i in range(n if carries(s, s.rows[q], resisting) else 0):
            s.B[i, count] = A[s.rows[i], s.rows[q]]
        count += carries(s, s.rows[q], resisting)
    least = DEPENDENT * max(largest_entry(A, 3 * s.closed_count), most_mobile(s))
    rank = factor_least(s.B, n, count, 0.0, least, s.w, s.order)
    for k in range(3 * s.closed_count):
        zero(K[k][: count - rank + 1])
    solve_least(s.B, n, count, rank, s.w, s.order, s.right, s.x)
    for i in range(-1, count - rank):
        if i >= 0:
            put_null(s.B, count, rank, s.w, s.order, i, s.x)
        count = 0
        for q in range(n):
            if carries(s, s.rows[q], resisting):
                if i >= 0:
                    K[s.rows[q], i] = s.x[count]
                else:
                    x[s.rows[q]] = s.x[count]
                count += 1
    return count - rank if rank > 0 else -1


@compiled
def carries(s: ContactArrays, row: int, resisting: bool) -> bool:
    """True of a row of closed contacts, one of those along which they act, that may carry."""
    c = s.closed[row // 3]
    bounded = s.alone[c] == 0 or (s.mu_s[c] > 0.0 and (resisting or s.under[c] < 0))
    return bounded and (row % 3 < 2 or s.ratio_s[c] > 0.0)


@compiled
def is_left_to_rows(s: ContactArrays) -> bool:
    """True if rows end what is left of rates by little of what the cones leave.

    Of weak rows that is more force than their own mobility tells.
    """
    n, A = put_own_rows(s), s.cone.A
    for i in range(n):
        s.x[i] = s.rates[s.rows[i]]
        for k in range(n):
            s.B[i, k] = A[s.rows[i], s.rows[k]]
    rank = factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, n, n, rank, s.w, s.order, s.x, s.right)
    big = largest(s.cone.x[: 3 * s.closed_count])
    for q in range(n):
        if not abs(s.right[q]) <= OF_REST * rim_of(s, s.rows[q] // 3) + FORCE_ROUNDING * big:
            return False
    return True


@compiled
def come_inside(s: ContactArrays, free: int) -> bool:
    """True if forces that hold are inside the cones; they become ``cone.x``, the centre of them.

    Args:
        s: with the least forces that hold, and vectors ``cone.K`` that may be added.
        free: how many of these there are.
    """
    size = largest(s.cone.x[: 3 * s.closed_count])
    if some_slide(s) and share_alike(s, free) and farthest_outside(s) < -WELL * size:
        return True
    terms = 5.0 * s.closed_count  # twice as many logarithms as cones, and forces
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
    before = np.inf
    for _ in range(PASSES):
        t, decrement = pass_with(s, free, 0.0, 0.0, size)
        if not decrement > CENTRED or (before < NEAR and decrement > 0.5 * before):  # by rounding
            break
        before = decrement
    return farthest_outside(s) < 0.0


@compiled
def share_alike(s: ContactArrays, free: int) -> bool:
    """Let forces ``cone.x`` that hold be those of feet of one stiffness, as in equations.py.

    They have nothing along vectors that no motion of bodies gives; False if these are fewer.
    """
    n, x, K, M = put_own_rows(s), s.cone.x, s.cone.K, s.cone.S
    for i in range(n):
        row = s.W[3 * s.closed[s.rows[i] // 3] + s.rows[i] % 3]
        for k in range(n):
            s.B[i, k] = row[3 * s.closed[s.rows[k] // 3] + s.rows[k] % 3]
    rank = factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order)
    if n - rank != free:
        return False
    for q in range(free):
        put_null(s.B, n, rank, s.w, s.order, q, s.x)
        s.right[q] = 0.0
        for j in range(free):
            M[q, j] = 0.0
        for i in range(n):
            s.right[q] -= s.x[i] * x[s.rows[i]]
            for j in range(free):
                M[q, j] += s.x[i] * K[s.rows[i], j]
    rank = factor_least(M, free, free, DEPENDENT, 0.0, s.w, s.order)
    solve_least(M, free, free, rank, s.w, s.order, s.right, s.cone.step)
    for k in range(3 * s.closed_count):
        for j in range(free):
            x[k] += K[k, j] * s.cone.step[j]
    return rank == free


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
    """Put ``cone.step``, -H^-1 g, by Cholesky; returns the decrement, (g H^-1 g)^(1/2)."""
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


@compiled
def leave_to_others(s: ContactArrays) -> None:
    """Let rows of what sticks not hold where others, and the joints, hold what they would.

    They carry what was found for them; joints and rows would divide that between them otherwise.
    """
    count = 0
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.alone[c] == 0 and s.mode[c] == 1.0:
            s.rows[count] = 3 * c
            count += 1
    count = hold_freest(s, count, 0, 0, 1)
    hold_freest(s, hold_freest(s, count, 0, 1, 3), 1, 0, 3)


@compiled
def hold_freest(s: ContactArrays, count: int, alone: int, first: int, end: int) -> int:
    """Let rows of what sticks hold, the freest first, and others not, until these are found to.

    Rows of contacts hold as well where without joints they depend on each other: they share.

    Args:
        s: with the first rows, ``count`` of them, that hold.
        alone: 1 of friction of joints alone, 0 of contacts.
        first, end: rows of each contact, from 0: its normal, its tangents.

    Returns:
        How many rows hold then.
    """
    left, least = 0, DEPENDENT * max(largest_entry(s.W, s.W.shape[0]), most_mobile(s))
    for k in range(s.closed_count):
        c = s.closed[k]
        for i in range(first, end if is_left(s, c, alone) else 0):
            s.way[c, i] = s.holds[c, i] * s.speed[c]
            left += s.holds[c, i]
    best = 0
    while left > 0 and best >= 0:
        rank, best = factor_rows(s, count, True), -1
        most = least
        for k in range(s.closed_count):
            c = s.closed[k]
            for i in range(first, end if is_left(s, c, alone) else 0):
                if s.way[c, i] > 0.0:
                    free = freedom_of(s, 3 * c + i, count, rank, True)
                    if free > most:
                        best, most = 3 * c + i, free
        if best >= 0:
            count, left = hold_row(s, best, count), left - 1
    if left == 0 or alone != 0:
        return count
    of_bodies, rank = count, factor_rows(s, count, False)
    for k in range(s.closed_count):
        c = s.closed[k]
        for i in range(first, end if is_left(s, c, alone) else 0):
            row = 3 * c + i
            small = DEPENDENT * mobility(s, row, row, False)
            if s.way[c, i] > 0.0 and freedom_of(s, row, of_bodies, rank, False) <= small:
                count = hold_row(s, row, count)
    return count


@compiled
def is_left(s: ContactArrays, c: int, alone: int) -> bool:
    """True of a contact that sticks, of friction of joints alone or of others."""
    return (s.alone[c] == alone) & (s.mode[c] == 2.0)


@compiled
def hold_row(s: ContactArrays, row: int, count: int) -> int:
    """Let one more row hold; how many do."""
    s.rows[count], s.way[row // 3, row % 3] = row, 0.0
    return count + 1


@compiled
def mobility(s: ContactArrays, row: int, other: int, jointed: bool) -> float:
    """What a row changes of another, with the joints or as if there were none."""
    if jointed:
        return s.W[row, other]
    own, total = s.lam_free.shape[0], 0.0
    for k in range(s.v.shape[0]):
        total += s.scaled[own + row, k] * s.scaled[own + other, k]
    return total


@compiled
def factor_rows(s: ContactArrays, count: int, jointed: bool) -> int:
    """Factors of what rows change of each other; their rank."""
    for i in range(count):
        for k in range(count):
            s.B[i, k] = mobility(s, s.rows[i], s.rows[k], jointed)
    return factor_least(s.B, count, count, DEPENDENT, 0.0, s.w, s.order)


@compiled
def freedom_of(s: ContactArrays, row: int, count: int, rank: int, jointed: bool) -> float:
    """What a row changes of itself where some rows hold."""
    for k in range(count):
        s.x[k] = mobility(s, s.rows[k], row, jointed)
    solve_least(s.B, count, count, rank, s.w, s.order, s.x, s.inner)
    found = mobility(s, row, row, jointed)
    for k in range(count):
        found -= mobility(s, row, s.rows[k], jointed) * s.inner[k]
    return found
