"""Impacts of the contacts that touch and approach, with friction, the joints held.

By Poisson's law an impact has two phases (Glocker, Set-Valued Force Laws, 2001, ch. 10): impulses
that stop what approaches, within their cones; then e times their normal parts, and friction within
the cones of these. By Newton's the normal velocity becomes -e of what it was. They go in
rounds: in each what approaches answers, all at once, so that impacts travel through bodies that
touch, as through Newton's cradle. Where e is zero everywhere one round of all that touch is enough.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.assembly.arrays import System
from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.formulations.contacts.cone import solve_cone
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.forces import UNSOLVED, put_matrix, put_plain
from dap3d_core.formulations.contacts.rows import change, kick, lift
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: Part of the longest column below which slips depend on each other.
DEPENDENT = 1e-12
#: Normal speed, m/s of a scene of ordinary size, below which what touches does not approach.
AT_REST = 1e-9
#: Part of the terms of a slip that may be rounding of it.
CANCELLED = 1e-15
#: Times the changes of slips nearby to which slips are raised, so that the same happens there.
FARTHER = 1e3
#: Rounds of one instant; in the last one all that touches stops.
ROUNDS = 500
#: Part of its mobility that friction leaves a contact whose steps become endless: it jams; and
#: where time resolves them no more. The same of what several that slide do to each other: radau
#: comes as near as 1e-6 to where it leaves nothing, dop853 as 1e-13.
NEARLY, AT_FLOOR, COUPLED = 1e-2, 1e-1, 1e-3
#: Height of a bounce, as a part of the length of the scene, from which on what bounces is held:
#: those that follow end after the geometric series of their times, too near to tell from rest. The
#: nearer e is to 1 the more bounces that takes: LAST_LOSS over 1 - e, up to a height that touches.
LAST_HEIGHT, LAST_LOSS, TOUCHING = 1e-13, 1e-14, 1e-10
#: Times the rounding of gaps that is the least such height, far from the origin.
BOUNCES = 14.0


@compiled
def begin_problem(s: ContactArrays) -> None:
    """The cone problem of the contacts that touch: from their slip on, with impulses zero."""
    cone, own = s.cone, s.lam_free.shape[0]
    for k in range(s.touching_count):
        s.closed[k] = s.touching[k]
    s.closed_count = cone.count = s.touching_count
    put_plain(s)
    for k in range(s.closed_count):
        c = s.closed[k]
        cone.mu[k], cone.more[k] = s.mu[c], 0.0
        cone.gapless[k], cone.ratio[k] = s.gapless[c], s.ratio[c]
        for i in range(3):
            cone.b[3 * k + i], cone.x[3 * k + i] = s.slip[c, i], 0.0
            row, terms = s.J[own + 3 * c + i], 0.0
            for q in range(row.shape[0]):
                terms += abs(row[q] * s.v[q])
            cone.noise[3 * k + i] = CANCELLED * terms


@compiled
def put_impulses(s: ContactArrays, e: Floats) -> bool:
    """Impulses x (3 k,) of the contacts that touch, in both phases; False if there are none.

    Newton's law may ask for a rebound that joints and friction, as in a wedge, hold.
    e: (m,) of restitution.
    """
    begin_problem(s)
    cone, n, widens = s.cone, 3 * s.closed_count, False
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.newton[c] != 0:
            cone.b[3 * k] += e[c] * min(s.slip[c, 0], 0.0)
    left = solve_cone(cone)
    copy(s.x[:n], cone.x[:n])
    for k in range(s.closed_count):
        c = s.closed[k]
        if s.newton[c] == 0:  # friction of joints alone has none
            cone.more[k] = e[c] * s.x[3 * k]
            s.x[3 * k] += cone.more[k]
            widens |= cone.more[k] != 0.0
    if not widens:
        return left <= UNSOLVED
    for i in range(n):
        cone.x[i], cone.b[i] = 0.0, s.slip[s.closed[i // 3], i % 3]
        for k in range(n):
            cone.b[i] += cone.A[i, k] * s.x[k]
    left = max(left, solve_cone(cone))
    for k in range(n):
        s.x[k] += cone.x[k]
    return left <= UNSOLVED


@compiled
def stop_slip(s: ContactArrays) -> bool:
    """Impulses x (3 k,) that stop slip, of those that touch and do not approach; False if zero."""
    begin_problem(s)
    cone, n, pushes = s.cone, 3 * s.closed_count, False
    for i in range(n):
        resists = cone.under[i // 3] != i // 3  # it begins with forces: moments are bounded by them
        s.x[i] = 0.0 if resists else -cone.b[i]
        for k in range(n):
            s.B[i, k] = 0.0 if resists or cone.under[k // 3] != k // 3 else cone.A[i, k]
    rank = factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, n, n, rank, s.w, s.order, s.x, cone.x)
    left = solve_cone(cone)
    copy(s.x[:n], cone.x[:n])
    for k in range(s.closed_count):
        pushes |= s.x[3 * k] > 0.0
    return pushes and left <= UNSOLVED


@compiled
def collide(s: ContactArrays, system: System) -> bool:
    """Let the contacts in touch collide until none approaches; velocities follow.

    False where there are no impulses for those that are among ``jams``.
    """
    s.round_count, s.exchanged = 0, 0.0
    for c in range(s.state.shape[0]):
        s.work[c], s.rests_soon[c], s.is_low[c], s.role[c] = 0.0, 0, 0, 0
        zero(s.impulses[c])
    for k in range(ROUNDS):
        if not take_part(s, k == ROUNDS - 1):
            break
        if not put_impulses(s, s.e_now):
            put_wedged(s)
            return False
        remember_round(s)
        act(s, system)
    for k in range(s.in_touch_count):
        s.role[s.in_touch[k]] = 2
    return True


@compiled
def put_wedged(s: ContactArrays) -> None:
    """Put what has no impulses among ``jams``: of what takes part those of Newton's law, if any."""
    newton = 0
    for c in range(s.jams.shape[0]):
        s.jams[c] = 0
    for k in range(s.touching_count):
        newton = max(newton, s.newton[s.touching[k]])
    for k in range(s.touching_count):
        s.jams[s.touching[k]] = s.newton[s.touching[k]] == newton


@compiled
def take_part(s: ContactArrays, is_last: bool) -> bool:
    """Let ``touching`` be those that answer in a round, by ``e_now``; False if none approaches."""
    s.touching_count, bounces = 0, False
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        bounces |= s.e[c] > 0.0
        presses = s.under[c] if s.under[c] >= 0 else c
        if s.closing[presses] < -AT_REST * s.speed[presses]:
            s.touching[s.touching_count] = c
            s.touching_count += 1
    if s.touching_count > 0 and (is_last or not bounces):
        for k in range(s.in_touch_count):
            s.touching[k] = s.in_touch[k]
        s.touching_count = s.in_touch_count
    for c in range(s.state.shape[0]):
        s.e_now[c] = 0.0 if is_last else s.e[c]
    return s.touching_count > 0


@compiled
def remember_round(s: ContactArrays) -> None:
    """Keep who took part in a round, as far as there is room, for the same once more."""
    if s.round_count < s.taking.shape[0]:
        for c in range(s.state.shape[0]):
            s.taking[s.round_count, c], s.restitution[s.round_count, c] = 0, s.e_now[c]
            for i in range(3):
                s.slips[s.round_count * s.state.shape[0] + c, i] = s.slip[c, i]
        for k in range(s.touching_count):
            s.taking[s.round_count, s.touching[k]] = 1
        s.round_count += 1


@compiled
def act(s: ContactArrays, system: System) -> None:
    """Let impulses x act, and count them and their work."""
    for k in range(s.touching_count):
        count_work(s, k)
    kick(s, system)
    for k in range(s.touching_count):
        count_work(s, k)
        for i in range(3):
            s.impulses[s.touching[k], i] += s.x[3 * k + i]


@compiled
def count_work(s: ContactArrays, k: int) -> None:
    """Count half of the work of impulses along the present slip."""
    c = s.touching[k]
    for i in range(3):
        part = s.x[3 * k + i] * 0.5 * (s.slip[c, i] - s.driven[c, i])
        s.work[c] += part
        s.exchanged += abs(part)


@compiled
def unjam(s: ContactArrays, system: System) -> bool:
    """Stop slip that jams behind an impact, by an impulse without a collision; False if none does.

    While it slips its friction presses bodies together, however short the time: an impulse, until
    it sticks; then that turns what approaches back (Genot, Brogliato, Eur. J. Mech. A 18 (1999)
    653). So what holds is at rest then, and nothing bounces.
    """
    s.touching_count = 0
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        if s.closing[c] < AT_REST * s.speed[c]:
            s.touching[s.touching_count] = c
            s.touching_count += 1
    if not stop_slip(s):
        return False
    for c in range(s.state.shape[0]):
        s.e_now[c] = -1.0
    remember_round(s)
    act(s, system)
    return True


@compiled
def last_height(s: ContactArrays, c: int) -> float:
    """Height of a bounce, m, from which on it is held."""
    part = min(max(LAST_HEIGHT, LAST_LOSS / max(1.0 - s.e[c], LAST_HEIGHT)), TOUCHING)
    return max(part * s.length[c], BOUNCES * s.rounding[c])


@compiled
def find_low(s: ContactArrays) -> bool:
    """Give role 1 to open contacts that come back from too low, of role 2; False if none does.

    It is known what carries the others: of a ball on a box that stands, both would fall alike else.
    What is held may lift others as low: they would change places for ever.
    """
    found, n = False, s.free.shape[0]
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        v = s.closing[c]
        if not (s.role[c] == 2 and s.mode[c] == 0.0 and v > AT_REST * s.speed[c]):
            continue
        a = -s.free[3 * c]
        for q in range(n):
            a -= s.W[3 * c, q] * s.force[q // 3, q % 3]
        if v * v < 2.0 * last_height(s, c) * a:
            s.is_low[c], s.role[c], found = 1, 1, True
            if s.impulses[c, 0] > 0.0 and 0.0 < s.e[c] < 1.0:
                # the speeds after bounces are v, e v, e^2 v, ...: that takes the sum of a series
                s.rests_soon[c], s.rest_time[c] = 1, 2.0 * v / (a * (1.0 - s.e[c]))
    return found


@compiled
def hold_low(s: ContactArrays, system: System) -> None:
    """Stop the contacts of role 1 so that none of role 2 approaches; count the work of that."""
    for c in range(s.state.shape[0]):
        s.values[c], s.least[c] = s.closing[c], 0.0
    count = lift(s)
    for k in range(count):
        c = s.active[k]
        s.work[c] += 0.5 * s.inner[k] * (s.slip[c, 0] - s.driven[c, 0])
    change(s, system)
    for k in range(count):
        c = s.active[k]
        s.work[c] += 0.5 * s.inner[k] * (s.slip[c, 0] - s.driven[c, 0])


@compiled
def repeat_impulses(s: ContactArrays, first: int) -> None:
    """Impulses x of a round that is kept, from row ``first`` of ``slips`` on, by the slip nearby.

    What approached slowly may open nearby, and has no impulse there. All impulses grow as slips do,
    x(f v) = f x(v): so x(f v + dv) - (f - 1) x(v) has the derivatives of x(v + dv), and for a large
    f all slides or sticks in it as in x(v).
    """
    far, slowest, n = 0.0, 1.0, 3 * s.touching_count
    for k in range(s.touching_count):
        c = s.touching[k]
        old = s.slips[first + c]
        if s.gapless[c] == 0.0 and old[0] < -AT_REST * s.speed[c]:
            slowest = min(slowest, -old[0])
        for i in range(3):
            far = max(far, abs(s.slip[c, i] - old[i]))
            s.slip[c, i], old[i] = old[i], s.slip[c, i]
    put_impulses(s, s.e_now)
    more = FARTHER * far / slowest
    for i in range(n):
        s.right[i] = more * s.x[i]
    for k in range(s.touching_count):
        c = s.touching[k]
        for i in range(3):
            s.slip[c, i] = more * s.slip[c, i] + s.slips[first + c, i]
    put_impulses(s, s.e_now)
    for i in range(n):
        s.x[i] -= s.right[i]
    for k in range(s.touching_count):
        for i in range(3):
            s.slip[s.touching[k], i] = s.slips[first + s.touching[k], i]


@compiled
def repeat_rounds(s: ContactArrays, system: System) -> None:
    """The rounds that are kept once more, of the same contacts, from other velocities."""
    for c in range(s.state.shape[0]):
        s.work[c], s.role[c] = 0.0, s.is_low[c]
    for q in range(s.round_count):
        s.touching_count = 0
        for c in range(s.state.shape[0]):
            s.e_now[c] = s.e[c] if s.restitution[q, c] > 0.0 else 0.0
            if s.taking[q, c] != 0:
                s.touching[s.touching_count] = c
                s.touching_count += 1
        if s.restitution[q, 0] >= 0.0:
            repeat_impulses(s, q * s.state.shape[0])
            act(s, system)
        elif stop_slip(s):
            act(s, system)
    hold_low(s, system)


@compiled
def nearly_jams(s: ContactArrays, part: float) -> int:
    """A contact whose friction leaves next to nothing of how it gives way; -1 of none.

    Of those that touch, alone or by what they do to each other, A x = W 1 with large x: its normal
    force grows beyond all bounds there, in a finite time, or there are several motions from there.
    part: of its mobility, which is next to nothing where it is alone.
    """
    s.closed_count = 0
    for k in range(s.touching_count):
        c = s.touching[k]
        if s.alone[c] == 0:
            s.closed[s.closed_count] = c
            s.closed_count += 1
    put_matrix(s, False)
    n = s.closed_count
    for k in range(n):
        c = s.closed[k]
        if s.slides[c] != 0 and s.cone.A[3 * k, 3 * k] < part * s.W[3 * c, 3 * c]:
            return c
    for k in range(n):
        s.x[k] = 0.0
        for q in range(n):
            s.B[k, q] = s.W[3 * s.closed[k], 3 * s.closed[q]]
            s.x[k] += s.B[k, q]
    if factor_least(s.B, n, n, DEPENDENT, 0.0, s.w, s.order) < n:  # they share what they carry
        return -1
    for k in range(n):
        for q in range(n):
            s.B[k, q] = s.cone.A[3 * k, 3 * q]
    rank = factor_least(s.B, n, n, 0.0, 0.0, s.w, s.order)
    solve_least(s.B, n, n, rank, s.w, s.order, s.x, s.right)
    most, found = 1.0 / COUPLED, -1
    for k in range(n):
        if abs(s.right[k]) > most:
            most, found = abs(s.right[k]), s.closed[k]
    return found
