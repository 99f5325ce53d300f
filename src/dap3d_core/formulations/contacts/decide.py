"""What contacts do at an instant: which of them touch, collide, open, stick, slide from there on.

One compiled function of arrays, which runs and exported models share. Bodies are in their own
coordinates.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.assembly.evaluate import place, place_states, zero
from dap3d_core.formulations import REPORT
from dap3d_core.formulations.contacts.contact_arrays import ContactArrays
from dap3d_core.formulations.contacts.contact_table import (
    FRICTION,
    GAP,
    REACH,
    find_grips,
    put_outputs,
)
from dap3d_core.formulations.contacts.equations import NEAR, WAY
from dap3d_core.formulations.contacts.forces import put_slip_against, size_across, still_speed
from dap3d_core.formulations.contacts.impacts import (
    AT_REST,
    BOUNCES,
    collide,
    find_low,
    hold_low,
    repeat_rounds,
    unjam,
)
from dap3d_core.formulations.contacts.loads import find_modes
from dap3d_core.formulations.contacts.modes import is_pressed
from dap3d_core.formulations.contacts.rows import (
    add_scaled,
    change,
    lift,
    put_feels,
    put_free,
    put_rows,
    put_velocities,
    put_velocity,
    unscale,
)
from dap3d_core.interface.contacts.rows import STRAYED
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.least_squares import factor_least, solve_least

#: What an impulse changes where joints hold, as a part of what it does to free bodies: nothing.
HELD = 1e-10
#: Slip, m/s, that is stopped where it goes through zero.
STOPPED = 1e-6
#: Mobility of a slip, as a part of that of free bodies, below which it is the pose that stops it.
DEAD = 1e-12
#: Part of the longest column below which slips that are stopped depend on each other.
DEPENDENT = 1e-12
#: What overlaps by up to so many times the gap of what touches parts: a disk that lay flat and
#: tilts has its lowest point below the eight on which it lay.
DEEPER = 100.0
#: What was decided, or why nothing is: joints prescribe that a contact closes, friction jams,
#: bodies overlap at the start, friction would drive, an impact has no impulses.
DECIDED, PRESCRIBED, JAMMED, OVERLAPS, DRIVES, WEDGED = 0, 1, 2, 3, 4, 5


@compiled
def decide(
    t: float, s: ContactArrays, system: System, loops: Any, functions: Any, tensions: Any
) -> int:
    """Decide at time t and the state ``y``, which becomes that from there on.

    Args:
        t, s: time; with y, what ``ended``, ``limit``, and what else is asked for.
        system, loops, functions: of an evaluator in coordinates of bodies.
        tensions: loops of what contacts say.

    Returns:
        DECIDED, or why nothing was, by ``culprit`` or the contacts that are among ``jams``.
    """
    report = functions[REPORT]
    report(t, s.y, s.report, system, loops)
    find_grips(t, s, system, tensions)
    put_outputs(t, s.says, system.multipliers, system, tensions)
    remember_modes(s, system)
    for c in range(s.limit.shape[0]):
        s.limit[c] = max(s.limit[c], BOUNCES * s.rounding[c] / s.arm[c])
    if s.starts != 0 and find_overlap(s):
        return OVERLAPS
    put_rows(t, s, system, loops)
    put_in_touch(s)
    if find_drive(s):
        return DRIVES
    take_ended(s)
    stop(s, system)
    if not leave_movable(t, s, system, loops, functions):
        return PRESCRIBED
    put_opening(s)
    if not collide(s, system):
        blame(s)
        return WEDGED
    if s.round_count > 0:
        stop_what_rests(s, system)
    move_on(t, s, system, loops, tensions)
    if s.jammed >= 0:
        s.leaves[s.jammed] = 1  # where others carry what it did
    lasts = find_lasting(t, s, system, loops, functions, tensions)
    if s.jammed >= 0 and not (lasts and s.mode[s.jammed] == 0.0):
        lasts = False
        for c in range(s.jams.shape[0]):
            s.jams[c] = c == s.jammed
    if not lasts:
        if not unjam(s, system):
            return blame(s)
        s.freed += 1
        move_on(t, s, system, loops, tensions)
        for c in range(s.begins.shape[0]):
            s.begins[c] = s.leaves[c] = 0
        if not find_lasting(t, s, system, loops, functions, tensions):
            return blame(s)
    settle(s, system)
    put_state(s, system)
    return DECIDED


@compiled
def move_on(t: float, s: ContactArrays, system: System, loops: Any, tensions: Any) -> None:
    """Place the bodies with the present velocities, and find coefficients of friction there."""
    put_velocities(s, system)
    place(t, s.placed, system, loops)
    find_grips(t, s, system, tensions)


@compiled
def blame(s: ContactArrays) -> int:
    """Name the first contact that jams."""
    for c in range(s.jams.shape[0]):
        if s.jams[c] != 0:
            s.culprit = c
            return JAMMED
    return JAMMED


@compiled
def repeat(
    t: float, s: ContactArrays, system: System, loops: Any, functions: Any, tensions: Any
) -> bool:
    """What is kept as decided once more, at a state nearby: all follows smoothly.

    Args: as of ``decide``.

    Returns:
        False where contacts share what they carry, and others of them would slide or hold here.
    """
    place(t, s.y, system, loops)
    find_grips(t, s, system, tensions)
    remember_modes(s, system)
    put_rows(t, s, system, loops)
    stop(s, system)
    repeat_rounds(s, system)
    for c in range(s.mode.shape[0]):  # what sticks from here on slips no more, soon
        s.was[c], s.stops[c] = s.mode[c], s.mode[c] == 2.0
    stop(s, system)
    for c in range(s.mode.shape[0]):
        s.role[c], s.values[c] = s.mode[c] > 0.5, s.closing[c]
    lift(s)
    change(s, system)
    zero(s.moved)
    are_same = not share(s) or share_anew(t, s, system, loops, functions, tensions)
    for c in range(s.mode.shape[0]):
        size = size_across(s, c, s.slip[c])
        if s.mode[c] == 1.0 and size > STOPPED * s.speed[c]:
            first = 0 if s.gapless[c] > 0.0 else 1
            for k in range(3):
                s.way[c, k] = 0.0
                for i in range(first, 3):
                    part = s.speed[c] / s.arm[c] * s.slip[c, i] / size
                    s.way[c, k] += part * s.frames[c, i, k]
    put_state(s, system)
    return are_same


@compiled
def share(s: ContactArrays) -> bool:
    """True if contacts share what they carry: motion or instants depend on the share."""
    found = False
    for c in range(s.mode.shape[0]):
        for i in range(3):
            found |= s.mode[c] > 0.5 and s.near[c, i] != 0.0
    return found


@compiled
def share_anew(
    t: float, s: ContactArrays, system: System, loops: Any, functions: Any, tensions: Any
) -> bool:
    """Divide what contacts carry at the present velocities; False if other modes are found."""
    s.in_touch_count = 0
    for c in range(s.mode.shape[0]):
        s.was[c], s.begins[c], s.leaves[c] = s.mode[c], s.mode[c] == 1.0, 0
        if s.mode[c] > 0.5:
            s.in_touch[s.in_touch_count] = c
            s.in_touch_count += 1
        slips = size_across(s, c, s.slip[c]) > STOPPED * s.speed[c]
        for i in range(3):  # of what slides from rest
            s.begin_way[c, i] = 0.0
            for k in range(3):
                part = s.arm[c] / s.speed[c] * s.way[c, k]
                s.begin_way[c, i] += s.frames[c, i, k] * part
            s.slip[c, i] = s.slip[c, i] if slips else 0.0
    move_on(t, s, system, loops, tensions)
    s.repeats = 1
    are_same = find_modes_now(t, s, system, loops, functions)
    s.repeats = 0
    for c in range(s.mode.shape[0]):
        are_same &= s.mode[c] == s.was[c]
    return are_same


@compiled
def remember_modes(s: ContactArrays, system: System) -> None:
    """Modes before the instant."""
    place_states(s.y, system)
    for c in range(s.state.shape[0]):
        s.was[c] = system.states[s.state[c]]


@compiled
def find_overlap(s: ContactArrays) -> bool:
    """True if the bodies of a contact overlap, which is ``culprit``."""
    for c in range(s.state.shape[0]):
        if s.says.found[c, REACH] >= 0.0 and s.says.found[c, GAP] < -s.limit[c]:
            s.culprit = c
            return True
    return False


@compiled
def find_drive(s: ContactArrays) -> bool:
    """True if friction of a contact in touch, ``culprit``, is negative or no number."""
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        if not min(s.mu[c], s.mu_s[c]) >= 0.0 and is_pressed(s, c, s.in_touch, s.in_touch_count):
            s.culprit = c
            return True
    return False


@compiled
def put_in_touch(s: ContactArrays) -> None:
    """The contacts that touch; those whose surfaces have ended are not, and leave ``ended``.

    Of those that hold what ends is the force, or the reach of their surfaces: a length, with which
    no force is compared. What carries nothing has one that is rounding, below zero as well.
    """
    s.in_touch_count = 0
    for c in range(s.state.shape[0]):
        says = s.says.found[c]
        if s.ended[c, 0] != 0 and s.was[c] > 0.5 and says[REACH] < 0.0:
            s.ended[c, 0] = s.ended[c, 1] = 0
            continue
        is_near = says[GAP] < s.limit[c] and says[REACH] >= 0.0
        if s.was[c] > 0.5 or is_near or s.ended[c, 0] != 0:
            s.in_touch[s.in_touch_count] = c
            s.in_touch_count += 1


@compiled
def take_ended(s: ContactArrays) -> None:
    """Contacts that begin to slide, with directions, whose normal force vanishes, that stop."""
    force = s.direction
    for c in range(s.state.shape[0]):
        s.begins[c] = s.stops[c] = 0
        s.leaves[c] = s.ended[c, 0] != 0 and s.was[c] > 0.5
        if s.ended[c, 1] == 0:
            continue
        if s.was[c] > 1.5 and size_across(s, c, s.slip[c]) < 0.5 * STRAYED * s.speed[c]:
            friction = s.says.found[c][FRICTION:]
            for i in range(3):
                force[i] = 0.0
                for k in range(3):
                    force[i] += s.frames[c, i, k] * friction[k]
            if size_across(s, c, force) > 0.0:
                put_slip_against(s, c, force, s.begin_way[c])
                s.begins[c] = 1
        elif s.was[c] < 1.5 and size_across(s, c, s.slip[c]) < STOPPED * s.speed[c]:
            s.stops[c] = 1


@compiled
def stop(s: ContactArrays, system: System) -> None:
    """Stop slips, rounding of zero, without a change of what contacts hold in their modes.

    At a dead centre it passes through zero while the mechanism moves on.
    """
    count = 0
    for c in range(s.state.shape[0]):
        is_stopped = False
        if s.stops[c] != 0:
            largest, of_free = 0.0, 0.0
            for i in range(3 * c, 3 * c + 3):
                largest, of_free = max(largest, s.W[i, i]), max(of_free, free_mobility(s, i))
            is_stopped = largest >= DEAD * of_free
        for i in range(3):
            if s.was[c] == 2.0 or is_stopped or (s.was[c] == 1.0 and i == 0):
                across = is_stopped and (i > 0 or s.gapless[c] > 0.0)
                s.rows[count] = 3 * c + i
                s.right[count] = -s.slip[c, i] if across else 0.0
                count += 1
    change_rates(s, count, system)


@compiled
def free_mobility(s: ContactArrays, row: int) -> float:
    """Mobility of a row of the contacts if there were no joints."""
    square, scaled = 0.0, s.scaled[s.lam_free.shape[0] + row]
    for k in range(scaled.shape[0]):
        square += scaled[k] * scaled[k]
    return square


@compiled
def stop_what_rests(s: ContactArrays, system: System) -> None:
    """Stop what rounds of impacts leave of the rates of what touches: slip as slow as at rest, too.

    Forces are found as if it were zero: with directions of that slip they would differ.
    """
    count = 0
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        if not is_pressed(s, c, s.in_touch, s.in_touch_count):
            continue
        slips = size_across(s, c, s.slip[c]) > still_speed(s, c)
        for i in range(3 if abs(s.closing[c]) <= AT_REST * s.speed[c] else 0):
            if not slips or (i == 0 and s.gapless[c] == 0.0):
                s.rows[count], s.right[count] = 3 * c + i, -s.slip[c, i]
                count += 1
    change_rates(s, count, system)


@compiled
def change_rates(s: ContactArrays, count: int, system: System) -> None:
    """Change the rates of so many ``rows`` by what is ``right``, with the joints held.

    Those that the joints hold have mobilities and rates of rounding, and their ratio is no impulse.
    """
    found, given, count = False, count, 0
    for k in range(given):
        row = s.rows[k]
        if s.W[row, row] >= DEAD * free_mobility(s, row):
            s.rows[count], s.right[count] = row, s.right[k]
            found |= s.right[k] != 0.0
            count += 1
    if not found:
        return
    for i in range(count):
        for k in range(count):
            s.B[i, k] = s.W[s.rows[i], s.rows[k]]
    rank = factor_least(s.B, count, count, DEPENDENT, 0.0, s.w, s.order)
    solve_least(s.B, count, count, rank, s.w, s.order, s.right, s.inner)
    for k in range(count):
        add_scaled(s.inner[k], s.moves[s.rows[k]], s.push)
    change(s, system)


@compiled
def leave_movable(t: float, s: ContactArrays, system: System, loops: Any, functions: Any) -> bool:
    """Leave in touch what joints let have an effect; what touches a body held does nothing.

    False if one closes, ``culprit``, and joints prescribe that.
    """
    count = 0
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        least = -AT_REST * s.speed[c]
        if s.alone[c] != 0 or s.W[3 * c, 3 * c] > HELD * free_mobility(s, 3 * c):
            s.in_touch[count] = c
            count += 1
            continue
        put_free(t, s, system, loops, functions)
        if s.slip[c, 0] < least or s.free[3 * c] < least:
            s.culprit = c
            return False
    s.in_touch_count = count
    return True


@compiled
def put_opening(s: ContactArrays) -> None:
    """Contacts that have come to touch and open again."""
    for c in range(s.state.shape[0]):
        has_ended = s.ended[c, 0] != 0 or s.ended[c, 1] != 0
        s.opening[c] = has_ended and s.was[c] < 0.5 and s.closing[c] > 0.0


@compiled
def find_lasting(
    t: float, s: ContactArrays, system: System, loops: Any, functions: Any, tensions: Any
) -> bool:
    """The modes of contacts in touch once what would be back at once is held; False if they jam."""
    while find_modes_now(t, s, system, loops, functions):
        if not find_low(s):
            return True
        hold_low(s, system)
        move_on(t, s, system, loops, tensions)
    return False


@compiled
def find_modes_now(t: float, s: ContactArrays, system: System, loops: Any, functions: Any) -> bool:
    """The modes of contacts in touch, at the present velocities; False if they jam."""
    if s.in_touch_count > 0:
        put_free(t, s, system, loops, functions)
        put_feels(s)
    for k in range(s.in_touch_count):
        s.touching[k] = s.in_touch[k]
    s.touching_count = s.in_touch_count
    for c in range(s.state.shape[0]):
        s.load[c] = s.alone[c] if s.under[c] < 0 else 0
    return find_modes(s)


@compiled
def find_modes_at_rest(
    t: float, s: ContactArrays, system: System, loops: Any, functions: Any, tensions: Any
) -> bool:
    """The modes of contacts in touch at the state ``y``; False if they jam."""
    place(t, s.y, system, loops)
    find_grips(t, s, system, tensions)
    put_rows(t, s, system, loops)
    for c in range(s.state.shape[0]):
        s.begins[c] = s.leaves[c] = 0
    return find_modes_now(t, s, system, loops, functions)


@compiled
def settle(s: ContactArrays, system: System) -> None:
    """Let what holds rest: rates of gaps and gaps are zero then, and what overlaps parts.

    What opens from rest, or opened already, would stop the run again where its gap is as deep as a
    switch passes.
    """
    put_roles(s)
    for c in range(s.state.shape[0]):
        s.values[c], s.least[c] = s.closing[c], 0.0
    lift(s)
    change(s, system)
    put_roles(s)
    for c in range(s.state.shape[0]):
        gap, rounding = s.says.found[c, GAP], s.rounding[c]
        is_near = -DEEPER * s.limit[c] < gap < s.limit[c]
        s.values[c] = s.arm[c] * gap if is_near else 0.0
        s.least[c] = -2.0 * rounding
        is_slow = s.closing[c] < AT_REST * s.speed[c] or s.opening[c] != 0
        if s.role[c] == 2 and is_slow and s.values[c] < -0.5 * rounding:
            s.role[c] = 1
    lift(s)
    unscale(s, system)
    for k in range(s.push.shape[0]):
        s.moved[k], s.push[k] = s.push[k], 0.0


@compiled
def put_roles(s: ContactArrays) -> None:
    """Contacts in touch that hold, and others."""
    for c in range(s.state.shape[0]):
        s.role[c] = 0
    for k in range(s.in_touch_count):
        c = s.in_touch[k]
        s.role[c] = 1 if s.mode[c] > 0.5 else 2


@compiled
def put_state(s: ContactArrays, system: System) -> None:
    """The state ``y`` from the instant on."""
    y, work = s.y, 0.0
    for b in range(1, system.body.shape[0]):
        o, q = 6 * b - 6, 7 * b - 7
        put_velocity(b, s, system)
        for k in range(3):
            y[q + k] += s.moved[o + k]
        turn, e0, e1, e2, e3 = s.moved[o + 3 : o + 6], y[q + 3], y[q + 4], y[q + 5], y[q + 6]
        y[q + 3] -= 0.5 * (turn[0] * e1 + turn[1] * e2 + turn[2] * e3)
        y[q + 4] += 0.5 * (e0 * turn[0] + turn[1] * e3 - turn[2] * e2)
        y[q + 5] += 0.5 * (e0 * turn[1] + turn[2] * e1 - turn[0] * e3)
        y[q + 6] += 0.5 * (e0 * turn[2] + turn[0] * e2 - turn[1] * e1)
    first = y.shape[0] - 1 - system.states.shape[0]
    for c in range(s.state.shape[0]):
        k = first + s.state[c]
        y[k] = s.mode[c]
        for i in range(3):
            y[k + WAY + i], y[k + NEAR + i] = s.way[c, i], s.near[c, i]
        work += s.work[c]
    y[y.shape[0] - 1] += work
