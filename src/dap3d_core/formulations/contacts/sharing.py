"""Contacts that share what they carry: forces well within cones, and rows that do not hold."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import largest_entry, pressing, put_sizes, solve_forces
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Part of the largest entry of A below which rows depend on each other.
DEPENDENT = 1e-12
#: Part of the largest acceleration that may be left where contacts hold, by shares alone: their
#: rows take it, within what the cones leave.
HELD, OF_REST, RATE_ROUNDING = 1e-9, 0.05, 1e-13
#: Part of the largest force that is rounding of one.
FORCE_ROUNDING = 1e-12
#: How many parts of their cones within which contacts that share what they carry may be to stay,
#: each leaving half of what the one before leaves: what they carry reaches its limit with so much
#: left, 1e-9. And how many normal forces, each half of the one before.
PARTS = 30
#: Normal force that each of them has, as a part of an equal share, where it can: what carried
#: nothing would be at its limit at once.
LEAST = 0.2
#: Tries of a cone problem that may have no solution.
FEW = 3


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
def left_of(k: int) -> float:
    """What the part of their cones of a number leaves."""
    left = 1.0
    for _ in range(k + 1):
        left *= 0.5
    return left


@compiled
def hold_inside(s: ContactArrays) -> bool:
    """Forces ``inner`` well within the cones of closed contacts that share, and hold, if any."""
    for k in range(3 * s.closed_count):
        s.cone.x[k] = 0.0
    resists = False
    for k in range(s.closed_count):
        s.slipping[s.closed[k]] = 0
        resists |= s.under[s.closed[k]] >= 0
    if resists and are_held_within(s, 0, 0, 0.0):  # they carry nothing that others can
        return True
    for k in range(3 * s.closed_count):
        s.cone.x[k] = 0.0
    if are_held_within(s, 0, 0):  # as a rule
        return True
    for k in range(3 * s.closed_count):
        s.cone.x[k] = 0.0
    if not are_held_within(s, PARTS - 1, PARTS - 1):
        return False
    part = bring_in(s, -1)
    bring_in(s, min(part + 1, PARTS - 1))
    return True


@compiled
def bring_in(s: ContactArrays, part: int) -> int:
    """The first part of the cones that holds; or, within one, the first normal force that does."""
    low, high = 0, PARTS - 2
    while low <= high:  # what one allows, so does every later one
        k = (low + high) // 2
        for q in range(3 * s.closed_count):
            s.cone.x[q] = s.inner[q]
        if are_held_within(s, k if part < 0 else part, PARTS - 1 if part < 0 else k):
            high = k - 1
        else:
            low = k + 1
    return low


@compiled
def are_held_within(s: ContactArrays, part: int, least: int, resisting: float = 1.0) -> bool:
    """True if forces within a part of the cones hold; these are ``inner`` then.

    least: the number of the normal force that each has at least.
    resisting: 0 where what resists rolling is to carry nothing.
    """
    load, count, left = 0.0, 0, left_of(part)
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.alone[c] == 0:
            load, count = max(load, -s.free[3 * c] / s.cone.A[3 * k, 3 * k]), count + 1
    normal = LEAST * left_of(least) * load / count if count > 1 else 0.0
    solve_forces(s, 1.0 - left, FEW, normal, resisting)
    x, A, big = s.cone.x, s.cone.A, put_sizes(s, True)
    for q in range(put_own_rows(s)):
        k = s.rows[q] // 3
        c = s.closed[k]
        own = max(A[3 * k, 3 * k], A[3 * k + 1, 3 * k + 1], A[3 * k + 2, 3 * k + 2])
        carried = s.mu_s[c] * pressing(s, k)
        rest = OF_REST * left * own * carried + RATE_ROUNDING * big
        if not abs(s.rates[s.rows[q]]) <= min(HELD * s.sizes[k], rest):
            return False
    if not is_left_to_rows(s, left):
        return False
    for k in range(3 * s.closed_count):
        s.inner[k] = x[k]
    return True


@compiled
def is_left_to_rows(s: ContactArrays, left: float) -> bool:
    """True if rows end what is left of rates by little of what the cones leave.

    Of weak rows that is more force than their own mobility tells.
    """
    n, A, big = put_own_rows(s), s.cone.A, 0.0
    for i in range(n):
        s.x[i] = s.rates[s.rows[i]]
        for k in range(n):
            s.B[i, k] = A[s.rows[i], s.rows[k]]
    rank = factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, n, n, rank, s.w, s.order, s.x, s.right)
    for k in range(3 * s.closed_count):
        big = max(big, abs(s.cone.x[k]))
    for q in range(n):
        k = s.rows[q] // 3
        carried = s.mu_s[s.closed[k]] * pressing(s, k)
        if carried > 0.0 and not abs(s.right[q]) <= OF_REST * left * carried + FORCE_ROUNDING * big:
            return False
    return True


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
            s.way[c, i] = s.holds[c, i] * s.length[c]
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
