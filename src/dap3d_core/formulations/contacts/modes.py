"""Which contacts hold, slip and stick from an instant on: the cone problem of the accelerations."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.assembly.evaluate import copy, largest, zero
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import (
    ZERO,
    begin_to_move,
    put_across,
    put_matrix,
    put_plain,
    put_sizes,
    put_slip_against,
    size_across,
    solve_forces,
    solve_to_move,
    still_speed,
)
from dap3d_core.formulations.contacts.sharing import (
    WELL,
    are_inside,
    do_share,
    factor_rows,
    leave_to_others,
)
from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import put_null

#: Part of its cone in which friction of contacts that share stays where they begin to slip: what it
#: leaves shows which of them do, and where to.
LOOSE = 1.0 - 1e-6
#: Part of the largest acceleration by which a contact that jams may approach where it leaves: steps
#: have become short just before that is over.
NEARLY_ZERO = 1e-5
#: Part of the largest force that is to be left for a contact that stays as others can carry less;
#: and for one that is at the end of its cone: with less it would be there again at once.
TO_STAY, TO_STICK = 1e-6, 1e-3


@compiled
def put_closed(s: ContactArrays) -> None:
    """Put the contacts that touch and do not part, and clear what is found."""
    count = 0
    for k in range(s.touching_count):
        c = s.touching[k]
        if not is_pressed(s, c, s.kept, count):
            continue
        if s.gapless[c] > 0.0 or s.slip[c, 0] < still_speed(s, c):
            s.kept[count] = c
            count += 1
    s.kept_count = count
    for c in range(s.mode.shape[0]):
        clear_mode(s, c)
        s.jams[c] = 0


@compiled
def is_pressed(s: ContactArrays, c: int, some: Integers, count: int) -> bool:
    """True but of what resists rolling at a contact that is not among the first of some."""
    found = s.under[c] < 0
    for k in range(count):
        found |= some[k] == s.under[c]
    return found


@compiled
def clear_mode(s: ContactArrays, c: int) -> None:
    """Let a contact be open."""
    s.mode[c] = 0.0
    for i in range(3):
        s.way[c, i] = s.near[c, i] = s.force[c, i] = 0.0


@compiled
def next_group(s: ContactArrays) -> bool:
    """Take contacts that feel each other's forces from those that are left; False where none is."""
    if s.kept_count == 0:
        return False
    count, done = 1, 0
    s.group[0] = s.kept[0]
    s.kept[0] = -1
    while done < count:
        for k in range(s.kept_count):
            c = s.kept[k]
            if c >= 0 and s.feels[s.group[done], c] != 0:
                s.group[count], s.kept[k] = c, -1
                count += 1
        done += 1
    s.group_count, left = count, 0
    for k in range(s.kept_count):
        if s.kept[k] >= 0:
            s.kept[left] = s.kept[k]
            left += 1
    s.kept_count = left
    sort(s.group, count)
    return True


@compiled
def sort(numbers: Integers, count: int) -> None:
    """Bring the first numbers into ascending order."""
    for k in range(1, count):
        x, q = numbers[k], k
        while q > 0 and numbers[q - 1] > x:
            numbers[q] = numbers[q - 1]
            q -= 1
        numbers[q] = x


@compiled
def put_modes(s: ContactArrays) -> bool:
    """Find the modes of the group; False if it jams."""
    leaves, begins, s.closed_count = 0, 0, s.group_count
    for k in range(s.group_count):
        c = s.closed[k] = s.group[k]
        leaves += s.leaves[c]
        begins += s.begins[c]
    if leaves + begins > 0 and s.repeats == 0:
        # of contacts that share, one at the end of its cone may only have to carry less
        if not put_matrix(s, False):
            return False
        if s.jammed < 0 and do_share(s) and hold_inside(s, False) and all_stay(s):
            leave_few(s)
            return put_found(s, False, True, False)
        put_plain(s)
        if leaves == 0 and do_share(s):
            # what each of them carried was a choice, and so is the direction of it
            return put_found(s, False, False, True)
        let_leave(s, leaves)
    return put_found(s, True, False, False)


@compiled
def hold_inside(s: ContactArrays, begins: bool) -> bool:
    """Forces ``inner`` well within the cones of closed contacts that share, and hold, if any.

    Where others open, those that hold without them are closed then: of several solutions that in
    which nothing begins to slip.
    begins: as of ``put_matrix``.
    """
    holds, before, count = are_inside(s), s.closed_count, 0
    for k in range(before):
        s.active[k], s.gone[s.closed[k]] = s.closed[k], 0
    while not holds and count != s.closed_count:
        count = s.closed_count
        let_open(s)
        if 0 < s.closed_count < count and put_matrix(s, begins) and are_inside(s):
            holds = put_returning(s, -ZERO * put_sizes(s, True)) == 0
    if not holds and s.closed_count < before:
        close_active(s, before, begins)
    return holds


@compiled
def close_active(s: ContactArrays, count: int, begins: bool) -> None:
    """Let the set that is worked on be the first contacts of ``active`` again."""
    for k in range(count):
        s.closed[k], s.jams[s.active[k]] = s.active[k], 0
    s.closed_count = count
    put_matrix(s, begins)


@compiled
def slip_sharing(s: ContactArrays, begins: bool, part: float) -> bool:
    """As ``begin_to_move``, of closed contacts that share, where no forces hold them inside.

    Several solutions are as a rule; that is sought in which all slip as feet of one stiffness, else
    which is next to forces that nearly hold, and at first without those that open where friction of
    all others holds, as of ``hold_inside``.
    begins: as of ``put_matrix``.
    """
    before = s.closed_count
    if begin_near(s, part) and slip_alike(s, begins, part):
        return True
    for k in range(before):
        s.active[k], s.gone[s.closed[k]] = s.closed[k], 0
    let_open(s)
    lasts = 0 < s.closed_count < before and put_matrix(s, begins) and begin_near(s, part)
    if lasts and put_returning(s, -ZERO * put_sizes(s, True)) == 0:
        return slip_alike(s, begins, part) or begin_to_move(s, part, False)
    close_active(s, before, begins)
    return begin_near(s, part) or begin_to_move(s, part, True)


@compiled
def begin_near(s: ContactArrays, part: float) -> bool:
    """As ``begin_to_move``, from forces that nearly hold."""
    are_inside(s)
    return begin_to_move(s, part, False)


@compiled
def slip_alike(s: ContactArrays, begins: bool, part: float) -> bool:
    """Let what was found to slip do so as on feet of one stiffness, if these press all of it.

    Normal forces have nothing along what no motion of bodies gives then, as rows ask for. False if
    they do not press, or nothing shares; forces are as before then, and no accelerations known.
    begins, part: as of ``put_found``.
    """
    count, n, A = 0, 3 * s.closed_count, s.cone.A
    for k in range(s.closed_count):
        c = s.closed[k]
        slips = s.slides[c] != 0 or size_across(s, c, s.rates[3 * k : 3 * k + 3]) > 0.0
        if slips and s.alone[c] == 0:
            s.active[count], s.rows[count] = 3 * k, 3 * c
            count += 1
    rank = factor_rows(s, count, True)
    if rank == count:
        return False
    copy(s.inner[:n], s.cone.x)
    for q in range(count - rank):
        put_null(s.B, count, rank, s.w, s.order, q, s.x)
        for i in range(count):
            size = s.W[s.rows[i], s.rows[i]]
            for k in range(count):
                A[s.active[i], s.active[k]] += size * s.x[i] * s.x[k]
    is_found = slip_pressed(s, count, 1.0) or slip_pressed(s, count, part)
    put_matrix(s, begins)
    if not is_found:
        copy(s.cone.x[:n], s.inner)
        for k in range(s.closed_count):
            s.jams[s.closed[k]] = 0
    return is_found


@compiled
def slip_pressed(s: ContactArrays, count: int, part: float) -> bool:
    """True if some of the first contacts that are ``active`` slip, and all have normal forces."""
    zero(s.cone.x[: 3 * s.closed_count])
    for i in range(count):
        s.slipping[s.closed[s.active[i] // 3]] = 1
    if not solve_to_move(s, part):
        return False
    size, presses, slips = largest(s.cone.x[: 3 * s.closed_count]), True, False
    for i in range(count):
        k = s.active[i]
        slips |= size_across(s, s.closed[k // 3], s.rates[k : k + 3]) > 0.0
        presses &= s.cone.x[k] > WELL * size
    return slips and presses


@compiled
def let_open(s: ContactArrays) -> None:
    """Take from closed contacts those that open where friction of all others holds."""
    before = s.closed_count
    for k in range(before):
        s.slipping[s.closed[k]] = 0
        for i in range(3):
            s.cone.x[3 * k + i] = 0.0
    is_solved = solve_forces(s, 1.0, True)
    put_sizes(s, True)
    s.closed_count = 0
    for k in range(before):
        c, force = s.closed[k], s.cone.A[3 * k, 3 * k] * s.cone.x[3 * k]
        s.jams[c] = 0
        opens = is_solved and s.alone[c] == 0 and s.rates[3 * k] > max(ZERO * s.sizes[k], force)
        if opens or not is_pressed(s, c, s.closed, s.closed_count):
            s.gone[c] = 1
        else:
            s.closed[s.closed_count] = c
            s.closed_count += 1


@compiled
def all_stay(s: ContactArrays) -> bool:
    """True if forces are left for those whose normal force has just vanished."""
    largest = 0.0
    for k in range(3 * s.closed_count):
        largest = max(largest, s.inner[k])
    for k in range(s.closed_count):
        if s.leaves[s.closed[k]] != 0 and not s.inner[3 * k] > TO_STAY * largest:
            return False
    return True


@compiled
def leave_few(s: ContactArrays) -> None:
    """Let go of those at the end of their cones that carry next to nothing, where others hold."""
    before, largest = s.closed_count, 0.0
    for k in range(3 * before):
        largest = max(largest, s.inner[k])
    s.closed_count = 0
    for k in range(before):
        c = s.before[k] = s.closed[k]
        if s.begins[c] == 0 or s.alone[c] != 0 or s.inner[3 * k] > TO_STICK * largest:
            s.closed[s.closed_count] = c
            s.closed_count += 1
    if s.closed_count == before or (put_matrix(s, False) and hold_inside(s, False)):
        return
    for k in range(before):
        s.closed[k] = s.before[k]
    s.closed_count = before
    put_matrix(s, False)
    hold_inside(s, False)


@compiled
def let_leave(s: ContactArrays, count: int) -> None:
    """Take those that leave from closed contacts, unless these would close again at once.

    What carries nothing leaves with them: it would be the next to.
    """
    big, least = 1e-300, ZERO if s.jammed < 0 else NEARLY_ZERO
    for k in range(s.closed_count):
        c = s.closed[k]
        s.gone[c], s.slipping[c] = 0, 0
        for i in range(3):
            big = max(big, abs(s.free[3 * c + i]))
    leaves = s.along_with
    for k in range(s.closed_count):
        leaves[s.closed[k]] = s.leaves[s.closed[k]]
    while count > 0:
        before = s.closed_count
        for k in range(before):
            s.before[k] = s.closed[k]
        s.closed_count = 0
        for k in range(before):
            c = s.before[k]
            if leaves[c] != 0 or not is_pressed(s, c, s.closed, s.closed_count):
                s.gone[c] = 1
            else:
                s.closed[s.closed_count] = c
                s.closed_count += 1
        zero(s.cone.x[: 3 * s.closed_count])
        holds = put_matrix(s, True) and solve_without(s)
        without = s.closed_count
        if not holds or put_returning(s, -least * big) > 0:
            if not holds or without > 0:
                for k in range(before):
                    s.closed[k] = s.before[k]
                s.closed_count = before
            for c in range(s.jams.shape[0]):
                s.jams[c] = 0
            return
        largest, count = 0.0, 0
        for k in range(without):
            largest = max(largest, s.cone.x[3 * k])
        for k in range(without):
            c = s.closed[k]
            leaves[c] = s.alone[c] == 0 and s.cone.x[3 * k] <= ZERO * largest
            count += leaves[c]


@compiled
def solve_without(s: ContactArrays) -> bool:
    """Forces of what is left closed, without what leaves; False if there are none.

    Those that share have the forces that ``put_found`` would give them: with others what leaves
    might be back at once, and carry nothing where it is held.
    """
    if not do_share(s):
        return solve_forces(s, 1.0, False)
    if not hold_inside(s, True):
        return slip_sharing(s, True, 1.0)
    copy(s.cone.x[: 3 * s.closed_count], s.inner)
    return True


@compiled
def put_returning(s: ContactArrays, least: float) -> int:
    """How many of what is gone would close again at once; where none is left these are closed."""
    count, without = 0, s.closed_count
    for q in range(s.group_count):
        c = s.group[q]
        if s.gone[c] != 0:
            rate = s.free[3 * c]
            for k in range(without):
                for i in range(3):
                    rate += s.W[3 * c, 3 * s.closed[k] + i] * s.cone.x[3 * k + i]
            resists = s.under[c] >= 0 and is_pressed(s, c, s.closed, count)
            if rate < least or (without == 0 and resists):
                if without == 0:
                    s.closed[count] = c
                    s.closed_count = count + 1
                count += 1
    return count


@compiled
def put_found(s: ContactArrays, begins: bool, inner: bool, loose: bool) -> bool:
    """Put the modes of closed contacts among those found; False if they jam.

    begins: those that begin to slide, slide; inner: they hold by forces that are known; loose:
    those that share begin to slip.
    """
    if s.closed_count == 0:
        return True
    if not put_matrix(s, begins):
        return False
    shares = do_share(s)
    holds = inner or (shares and not loose and hold_inside(s, begins))
    part = LOOSE if loose else 1.0
    slips = shares and not holds and slip_sharing(s, begins, part)
    if not (holds or slips) and (shares or not begin_to_move(s, part, True)):
        return False
    if loose:
        holds = hold_beside_slip(s)
        if not holds and not (put_matrix(s, False) and begin_to_move(s, LOOSE, True)):
            return False
    if holds:
        for k in range(3 * s.closed_count):
            s.cone.x[k], s.rates[k] = s.inner[k], 0.0
    size, count = largest(s.cone.x[: 3 * s.closed_count]), 0
    for k in range(s.closed_count):
        count += s.cone.under[k] == k
    for k in range(s.closed_count):
        if s.under[s.closed[k]] < 0 or s.mode[s.under[s.closed[k]]] > 0.0:
            put_one(s, k, shares, count == 1, ZERO * size)
    if shares:
        leave_to_others(s)
    return True


@compiled
def hold_beside_slip(s: ContactArrays) -> bool:
    """True if, where those that were found to slip do, the others hold well within their cones.

    Of contacts that share: at the end of a cone rounding of the slip would end at once what holds.
    """
    found = False
    for k in range(s.closed_count):
        c, force = s.closed[k], s.cone.x[3 * k : 3 * k + 3]
        slips = size_across(s, c, s.rates[3 * k : 3 * k + 3]) > 0.0
        s.along_with[c], s.begins[c] = s.begins[c], slips and size_across(s, c, force) > 0.0
        if s.begins[c] != 0:
            put_slip_against(s, c, force, s.begin_way[c])
            found = True
    holds = found and put_matrix(s, True) and hold_inside(s, True)
    big = NEARLY_ZERO * put_sizes(s, True) if holds else 0.0
    for k in range(s.closed_count if holds else 0):  # else what slips would not go on by that
        c, a = s.closed[k], s.rates[3 * k : 3 * k + 3]
        along = a[0] * s.along[c, 0] + a[1] * s.along[c, 1] + a[2] * s.along[c, 2]
        holds &= s.begins[c] == 0 or along >= -big
    for k in range(s.group_count):
        s.begins[s.group[k]] = s.along_with[s.group[k]]
    return holds


@compiled
def put_one(s: ContactArrays, k: int, shares: bool, is_one: bool, least: float) -> None:
    """Put the mode of closed contact k, if it stays closed.

    is_one: there is no other, but what resists rolling at it.
    least: friction, N, whose direction is not that of rounding.
    """
    c, force, rate = s.closed[k], s.cone.x[3 * k : 3 * k + 3], s.rates[3 * k : 3 * k + 3]
    alone, opens = s.alone[c] != 0, s.cone.A[3 * k, 3 * k] * force[0]
    if not alone and rate[0] > max(opens, 0.0):
        return
    if is_one and not alone and force[0] <= 0.0:
        return
    way = s.direction
    way[0] = way[1] = way[2] = 0.0
    s.mode[c] = 1.0
    if s.slides[c] != 0:
        put_across(s, c, s.along[c], 1.0, way)
    elif s.mu_s[c] > 0.0:
        size = size_across(s, c, rate)
        if size == 0.0:
            s.mode[c] = 2.0
        elif s.mu[c] > 0.0 and size_across(s, c, force) > least:
            put_slip_against(s, c, force, way)
        else:
            put_across(s, c, rate, 1.0 / size, way)
    near = shares or alone  # what its row adds has next to no rounding then
    sticks, normal = s.mode[c] == 2.0, s.gapless[c] == 0.0
    for i in range(3):
        s.force[c, i] = force[i]
        s.way[c, i] = s.near[c, i] = 0.0
        for q in range(3):
            s.way[c, i] += s.speed[c] / s.arm[c] * way[q] * s.frames[c, q, i]
            if near and (sticks or (q == 0 and normal)):
                s.near[c, i] += s.arm[c] * force[q] * s.frames[c, q, i]
