"""Contacts that share what they carry: forces well within cones, and rows that do not hold."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import largest_entry, put_open, put_rates, put_sizes
from dap3d_core.formulations.contacts.inside import come_inside, rim_of
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, put_null, solve_least

#: Part of the largest entry of A below which rows depend on each other.
DEPENDENT = 1e-12
#: Part of the largest acceleration that may be left where contacts hold, by shares alone: their
#: rows take it, within what the cones leave.
HELD, OF_REST, RATE_ROUNDING = 1e-9, 0.05, 1e-13
#: Part of the largest force that is rounding of one.
FORCE_ROUNDING = 1e-12


@compiled
def do_share(s: ContactArrays) -> bool:
    """True if forces of closed contacts may change without a change of the motion."""
    n, A = put_own_rows(s), s.cone.A
    for i in range(n):
        for k in range(n):
            s.B[i, k] = A[s.rows[i], s.rows[k]]
    least = DEPENDENT * largest_entry(A, 3 * s.closed_count)
    return factor_least(s.B, n, n, 0.0, least, s.w, s.order) < n


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
def hold_inside(s: ContactArrays) -> bool:
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
    for k in range(3 * s.closed_count):
        s.inner[k] = s.cone.x[k]
    return True


@compiled
def put_least(s: ContactArrays, resisting: bool) -> int:
    """The least forces ``cone.x`` that hold, if any, and vectors ``cone.K`` of what may be added.

    Returns how many of these there are; -1 where nothing holds.
    """
    n, A, x, K, count = put_own_rows(s), s.cone.A, s.cone.x, s.cone.K, 0
    for k in range(3 * s.closed_count):
        x[k] = 0.0
    for q in range(n):
        s.right[q] = -s.cone.b[s.rows[q]]
        for i in range(n if carries(s, s.rows[q], resisting) else 0):
            s.B[i, count] = A[s.rows[i], s.rows[q]]
        count += carries(s, s.rows[q], resisting)
    least = DEPENDENT * largest_entry(A, 3 * s.closed_count)
    rank = factor_least(s.B, n, count, 0.0, least, s.w, s.order)
    for k in range(3 * s.closed_count):
        for i in range(count - rank + 1):
            K[k, i] = 0.0
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
        if not abs(s.right[q]) <= OF_REST * rim_of(s, s.rows[q] // 3) + FORCE_ROUNDING * big:
            return False
    return True


@compiled
def leave_to_others(s: ContactArrays) -> None:
    """Let rows of friction not hold where others, and the joints, hold what they would.

    They carry what was found for them; joints and rows would divide that between them otherwise.
    """
    count = 0
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.alone[c] == 0 and s.mode[c] > 0.5:
            s.rows[count] = 3 * c
            count += 1
    hold_freest(s, hold_freest(s, count, 0), 1)


@compiled
def hold_freest(s: ContactArrays, count: int, alone: int) -> int:
    """Let rows of friction hold, the freest first, and others not, until these are found to.

    Tangents of contacts hold as well where without joints they depend on each other: they share.

    Args:
        s: with the first rows, ``count`` of them, that hold.
        alone: 1 of friction of joints alone, 0 of contacts.

    Returns:
        How many rows hold then.
    """
    left, least = 0, DEPENDENT * largest_entry(s.W, s.W.shape[0])
    for k in range(s.closed_count):
        c = s.closed[k]
        for i in range(1 - alone, 3 if is_left(s, c, alone) else 0):
            s.way[c, i] = s.holds[c, i]
            left += s.holds[c, i]
    best = 0
    while left > 0 and best >= 0:
        rank, best = factor_rows(s, count, True), -1
        most = least
        for k in range(s.closed_count):
            c = s.closed[k]
            for i in range(3 if is_left(s, c, alone) else 0):
                if s.way[c, i] == 1.0:
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
        for i in range(3 if is_left(s, c, alone) else 0):
            row = 3 * c + i
            small = DEPENDENT * mobility(s, row, row, False)
            if s.way[c, i] == 1.0 and freedom_of(s, row, of_bodies, rank, False) <= small:
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
