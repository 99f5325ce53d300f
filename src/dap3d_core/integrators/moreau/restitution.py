"""What collides, and moves then; bounces with friction that give no more energy than they take.

Impacts travel through bodies that touch in rounds, as at events (formulations/contacts/impacts.py).
Newton's law with friction may gain energy (Kane, Levinson, Dynamics: theory and applications, 1985,
sec. 5.8). Where it would, impulses are a mean of these and of those without a bounce: cones are
convex, and without a bounce nothing is gained.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.formulations.contacts.impacts import AT_REST, ROUNDS
from dap3d_core.integrators.moreau.arrays import BOUNCES, CONE, STOPS, StepArrays
from dap3d_core.integrators.moreau.contact_set import velocity_of
from dap3d_core.integrators.moreau.gauss_seidel import copy_impulses
from dap3d_core.integrators.moreau.impulses import slot_of
from dap3d_core.integrators.moreau.newton import TINY, product_of, speed_of
from dap3d_core.integrators.moreau.problem import (
    BODY,
    CONTACT,
    ROW,
    find_groups,
    prepare_problem,
    root_of,
    solve,
)
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Columns of ``bounce``: work of the impulses of a group with the bounce, half of it, and without;
#: the sum of the magnitudes of its parts; how much of the bounce is kept.
WITH, HALF, WITHOUT, EXCHANGED, KEPT = range(5)
#: Columns in rounds: whether something of a group is hit, something is not; the largest e.
STRUCK, SPARED, ELASTIC = range(3)
#: Columns of ``strike``: what a normal velocity changes by until the gap closes, m/s; the bias of
#: the step.
FALLEN, WAS = range(2)
#: The turn of contacts behind several rounds; times coefficients where velocities are known.
BEHIND, WIDER = ROUNDS + 1, 2.0
#: Work that is rounding, as a part of what is exchanged.
GAIN_ROUNDING = 1e-12
#: Gaps, m of a scene of ordinary size, below which overlaps are left.
OVERLAP = 1e-12
#: Part of the step where bodies are not hit, and the least part behind a hit that counts.
NOT_HIT, SHORT = 2.0, 1e-9
#: A contact collides where it approaches by more than this times h times the acceleration.
COLLIDES = 4.0


@compiled
def put_bias(s: StepArrays, memory: Floats) -> bool:
    """What is added to normal velocities, and when bodies are hit; True if bodies collide.

    memory: impulses of the last step, whose places are in ``slots``.
    """
    fall, found = fall_of(s), False
    for c in range(s.contact_count):
        bias, s.collides[c] = s.bias[c], 0
        bias[0] = bias[1] = bias[2] = 0.0
        if s.kind[c] != CONE:
            continue
        approach, _, _ = velocity_of(s, c, s.before)
        normal, _, _ = velocity_of(s, c, s.free)
        change, gap = max(fall, abs(normal - approach)), max(s.gap[c], 0.0)  # by turning, too
        if approach < -COLLIDES * change and gap + s.h * min(approach, normal) < 0.0:
            normal = expected_of(s, c, approach, normal, change, memory)
            s.closing[c] = closing_of(gap, s.h * approach, s.h * (normal - approach))
            back = put_strike(s, c, approach, normal)
            if s.e[c] > 0.0 and back > 0.0:
                s.collides[c], bias[0], found = BOUNCES, -back, True
            elif gap + s.h * approach < 0.0:  # what it falls by meanwhile is borne
                s.collides[c], s.closing[c], found = STOPS, -gap / (s.h * approach), True
    put_hits(s, found)
    for c in range(s.contact_count):  # redundant contacts would disagree by less
        if s.gap[c] > OVERLAP * s.length and s.collides[c] == 0:
            first = s.hit[max(s.bodies[c, 0], s.bodies[c, 1])]
            first = first if first != NOT_HIT else 0.0
            approach, _, _ = velocity_of(s, c, s.before)
            last = max(1.0 - first, SHORT)
            s.bias[c, 0] = max(s.gap[c] + first * s.h * approach, 0.0) / (last * s.h)
    return found


@compiled
def put_strike(s: StepArrays, c: int, approach: float, normal: float) -> float:
    """Put what a normal velocity falls by until the gap closes; that at the end, bounced, m/s."""
    s.strike[c, FALLEN] = s.closing[c] * (normal - approach)
    more = (1.0 - s.closing[c]) * (normal - approach)
    return more - s.e[c] * (normal - more)


@compiled
def renew_bias(s: StepArrays, memory: Floats) -> None:
    """Put what is added to normal velocities of what bounces, by rows at its instant."""
    fall = fall_of(s)
    for c in range(s.contact_count):
        if s.collides[c] == BOUNCES:
            approach, _, _ = velocity_of(s, c, s.before)
            normal, _, _ = velocity_of(s, c, s.free)
            change = max(fall, abs(normal - approach))
            normal = expected_of(s, c, approach, normal, change, memory)
            s.bias[c, 0] = -max(put_strike(s, c, approach, normal), 0.0)


@compiled
def fall_of(s: StepArrays) -> float:
    """The largest change of a velocity without contacts, m/s."""
    fall = 0.0
    for b in range(s.free.shape[0]):
        for k in range(3):
            fall = max(fall, abs(s.free[b, k] - s.before[b, k]))
    return fall


@compiled
def expected_of(
    s: StepArrays, c: int, approach: float, normal: float, most: float, memory: Floats
) -> float:
    """The normal velocity of a contact that collides at the end of the step, without that, m/s.

    A body that rests on another does not fall: forces of the last step go on, as ``end`` has them,
    but for those of this contact itself. most: what they may change it by.
    """
    if (
        s.bodies[c, 0] == 0
        or s.bodies[c, 1] == 0
        or s.slots[slot_of(memory, s.slots, s.key[c])] >= 0
    ):
        return normal
    borne, _, _ = velocity_of(s, c, s.end)
    if borne == normal:
        return normal
    return min(max(borne, approach - most), approach + most)


@compiled
def put_hits(s: StepArrays, any_collides: bool) -> None:
    """When bodies are hit, as parts of the step: all of a group at the first instant."""
    for b in range(s.hit.size):
        s.hit[b], s.flies[b] = NOT_HIT, 1.0
    if not any_collides:
        return
    find_groups(s)
    for c in range(s.contact_count):
        if s.collides[c] != 0:
            s.hit[s.group[c]] = min(s.hit[s.group[c]], s.closing[c])
    spread(s, s.hit)
    for b in range(s.hit.size):
        zero(s.jump[b])


# ------------------------------------------------------------------ rounds


@compiled
def choose_struck(s: StepArrays) -> bool:
    """Mark by 0 the contacts that rounds may be of, by -1 others; True if there are any.

    Where all of a group is hit, or nothing bounces, one problem of all has the same velocities.
    """
    found, of_group = False, s.bounce
    for g in range(of_group.shape[0]):
        zero(of_group[g])
    for c in range(s.contact_count):
        if s.kind[c] == CONE:
            row = of_group[s.group[c]]
            row[STRUCK if is_hit(s, c) else SPARED] = 1.0
            row[ELASTIC] = max(row[ELASTIC], s.e[c])
    for c in range(s.contact_count):
        row, s.takes[c] = of_group[s.group[c]], -1
        if s.kind[c] == CONE and min(row[STRUCK], row[SPARED], row[ELASTIC]) > 0.0:
            s.takes[c], found = 0, True
    for b in range(s.jump.shape[0] if found else 0):
        for k in range(6):
            s.jump[b, k] = s.end[b, k] - s.before[b, k]  # without an impact
    return found


@compiled
def is_hit(s: StepArrays, c: int) -> bool:
    """True if a contact collides by itself."""
    return s.collides[c] == STOPS or s.collides[c] == BOUNCES


@compiled
def pass_on(s: StepArrays, tolerance: float) -> bool:
    """Let impacts travel through what touches, in rounds; False without room.

    In each of them what approaches answers, by Newton's law. Behind the last one contacts bear what
    they still do, and normal velocities then are what the step asks for. Rounds begin with
    velocities of the start of the step, by which what rests does not approach; what is hit has
    besides what it falls by until its gap closes.
    """
    has_room, fall = True, fall_of(s)
    prepare_problem(s)
    zero(s.y_bounce)
    for c in range(s.contact_count):
        zero(s.x_bounce[c])
        s.strike[c, WAS] = s.bias[c, 0]
    for b in range(s.free.shape[0]):
        copy(s.v_bounce[b], s.free[b])
        copy(s.free[b], s.before[b])
    while has_room and s.turn < ROUNDS and take_part(s, fall):
        has_room = solve_turn(s, tolerance)
    s.turn = 0
    any_passed = put_behind(s)
    if any_passed and has_room:
        s.turn = BEHIND
        has_room = solve_turn(s, tolerance)
        s.turn = 0
        ask_for(s)
    for b in range(s.free.shape[0]):
        copy(s.free[b], s.v_bounce[b])
    return has_room


@compiled
def solve_turn(s: StepArrays, tolerance: float) -> bool:
    """Solve the problem of a round, and take its velocities as ``free``; False without room.

    Impulses are summed up.
    """
    for k in range(s.y.size):
        s.y[k], s.free_speed[k] = 0.0, speed_of(s, k, s.free)
    for c in range(s.contact_count):
        zero(s.x[c])
    has_room = solve(s, tolerance)
    for b in range(s.free.shape[0]):
        copy(s.free[b], s.v[b])
    for k in range(s.y.size):
        s.y_bounce[k] += s.y[k]
    for c in range(s.contact_count):
        for k in range(3):
            s.x_bounce[c, k] += s.x[c, k]
    return has_room


@compiled
def take_part(s: StepArrays, fall: float) -> bool:
    """Choose what answers in the next round, and its bias; False if nothing does."""
    found, first = False, s.turn == 0
    s.turn += 1
    for c in range(s.contact_count):
        if s.under[c] >= 0 or s.takes[c] < 0:
            continue
        hit, strike = is_hit(s, c), s.strike[c]
        fallen = strike[FALLEN] if hit else 0.0
        speed, _, _ = velocity_of(s, c, s.free)
        speed += fallen
        least = max((1.0 - s.e[c]) * COLLIDES * fall, AT_REST * s.length)
        if not hit:  # it closes within the step
            least = max(least, strike[WAS])
        if hit if first else speed < -least:
            s.takes[c], found = s.turn, True
            s.bias[c, 0] = fallen + s.e[c] * min(speed, 0.0)
    for c in range(s.contact_count):
        if s.under[c] >= 0:
            s.takes[c] = s.takes[s.under[c]]
    return found


@compiled
def put_behind(s: StepArrays) -> bool:
    """Put velocities at the end of the step by those behind the last round; True if several were.

    Of groups with one round alone none approaches behind it, and the step has its velocities as it
    is.
    """
    found, last = False, s.flies
    find_groups(s)
    for c in range(s.contact_count):
        g = s.group[c]
        last[g] = 0.0 if s.takes[c] >= 2 else last[g]
    for c in range(s.contact_count):
        passed = last[s.group[c]] == 0.0
        s.takes[c], found = BEHIND if passed else -1, found or passed
        s.bias[c, 0] = 0.0 if passed and is_hit(s, c) else s.strike[c, WAS]
    for b in range(s.free.shape[0]):
        first = min(s.hit[b], 1.0)
        for k in range(6):
            fallen, s.jump[b, k] = first * s.jump[b, k], s.free[b, k] - s.before[b, k]
            s.free[b, k] += fallen + (1.0 - first) * (s.v_bounce[b, k] - s.before[b, k])
        if last[root_of(s.parent, b)] != 0.0:
            zero(s.jump[b])
    return found


@compiled
def ask_for(s: StepArrays) -> None:
    """Put biases by which the step has the velocities ``free`` of what rounds pushed.

    The sums of the impulses of rounds are within the cones, which are convex: they solve that.
    """
    for c in range(s.contact_count):
        presses = c if s.kind[c] == CONE else s.under[c]
        if s.takes[c] < 0 or presses < 0:
            continue
        back, along, across = velocity_of(s, c, s.free)
        pushes = s.x_bounce[presses, 0] > 0.0
        if pushes:
            s.bias[c, 1], s.bias[c, 2] = -along, -across
        if pushes and (back > 0.0 or s.kind[c] != CONE):
            s.bias[c, 0] = -back
        if s.kind[c] == CONE and pushes and back > 0.0:
            s.collides[c] = BOUNCES
        elif is_hit(s, c):
            s.collides[c] = STOPS


@compiled
def recall_rounds(s: StepArrays) -> None:
    """Try first the impulses of all rounds."""
    find_groups(s)
    for c in range(s.contact_count):
        if s.takes[c] == BEHIND:
            copy(s.x[c], s.x_bounce[c])
    for k in range(s.y.size):
        if s.flies[root_of(s.parent, s.row_owner[k])] == 0.0:
            s.y[k] = s.y_bounce[k]


@compiled
def widen(s: StepArrays, part: float) -> None:
    """Multiply coefficients of friction of what rounds pushed.

    Velocities are known then; on the rim of its cone the problem has its solutions at a kink.
    """
    for c in range(s.contact_count):
        if s.takes[c] == BEHIND:
            s.mu[c] *= part


# ------------------------------------------------------------------ bounces


@compiled
def put_flies(s: StepArrays) -> None:
    """Mark the groups of which something stops, or is borne, by 0, as those of rounds are."""
    find_groups(s)
    for c in range(s.contact_count):
        if s.collides[c] != BOUNCES and (s.collides[c] == STOPS or s.x[c, 0] > 0.0):
            s.flies[s.group[c]] = 0.0
    spread(s, s.flies)


@compiled
def spread(s: StepArrays, of_group: Floats) -> None:
    """Give all bodies what their groups have."""
    for b in range(of_group.size):
        of_group[b] = of_group[root_of(s.parent, b)]


@compiled
def closing_of(gap: float, way: float, more: float) -> float:
    """The part x of a step in which a gap closes: gap + x (way + x more / 2) = 0."""
    inner = way * way - 2.0 * gap * more
    return min(1.0, 2.0 * gap / (math.sqrt(max(inner, 0.0)) - way))


@compiled
def limit_bounces(s: StepArrays, tolerance: float) -> bool:
    """Weaken the bounces of groups that would gain energy; False without room."""
    rubs = False
    for c in range(s.contact_count):
        rubs |= s.under[c] >= 0 or (s.collides[c] == BOUNCES and s.mu[c] > 0.0)
    if not rubs or not any_gains(s):
        return True
    for b in range(s.v.shape[0]):
        copy(s.v_bounce[b], s.v[b])
    copy_impulses(s.x, s.y, s.x_bounce, s.y_bounce, s.contact_count)
    for c in range(s.contact_count):
        if s.collides[c] == BOUNCES or s.kind[c] != CONE:
            s.bias[c, 0] = 0.0
        if s.takes[c] == BEHIND:
            s.bias[c, 1] = s.bias[c, 2] = 0.0
    if not solve(s, tolerance):
        return False
    put_work(s, WITHOUT, 0.0)
    put_work(s, HALF, 0.5)
    for g in range(s.bounce.shape[0]):
        s.bounce[g, KEPT] = part_without_gain(
            s.bounce[g, WITHOUT], s.bounce[g, HALF], s.bounce[g, WITH], s.bounce[g, EXCHANGED]
        )
    find_groups(s)
    mix(s)
    return True


@compiled
def any_gains(s: StepArrays) -> bool:
    """True if a group gains energy by its impact."""
    put_work(s, WITH, 0.0)
    found = False
    for g in range(s.bounce.shape[0]):
        found |= s.bounce[g, WITH] > GAIN_ROUNDING * s.bounce[g, EXCHANGED]
    return found


@compiled
def put_work(s: StepArrays, column: int, part: float) -> None:
    """Put the work of the impulses of each group, J, with such a part of the bounce kept."""
    for g in range(s.bounce.shape[0]):
        s.bounce[g, column] = s.bounce[g, EXCHANGED] = 0.0
    for b in range(s.v.shape[0]):
        first = s.hit[b] if s.hit[b] <= 1.0 else 0.5
        for k in range(6):
            fall = s.flies[b] * (s.free[b, k] - s.before[b, k])
            end = s.v[b, k] + part * (s.v_bounce[b, k] - s.v[b, k])
            s.trial[b, k] = 0.5 * (s.before[b, k] + end + (2.0 * first - 1.0) * fall)
    for c in range(s.contact_count):
        u0, u1, u2 = velocity_of(s, c, s.trial)
        x, other = s.x[c], s.x_bounce[c]
        normal = (x[0] + part * (other[0] - x[0])) * u0
        rubbed = (x[1] + part * (other[1] - x[1])) * u1 + (x[2] + part * (other[2] - x[2])) * u2
        s.bounce[s.group[c], column] += normal + rubbed
        s.bounce[s.group[c], EXCHANGED] += abs(normal) + abs(rubbed)


@compiled
def part_without_gain(without: float, half: float, whole: float, exchanged: float) -> float:
    """The largest part of a bounce whose work is zero; the work is quadratic in it."""
    if not whole > GAIN_ROUNDING * exchanged:
        return 1.0
    a, b = 2.0 * (whole + without) - 4.0 * half, 4.0 * half - whole - 3.0 * without
    root = math.sqrt(max(b * b - 4.0 * a * without, 0.0))
    below = b + root if b > 0.0 else root - b
    found = -2.0 * without / below if b > 0.0 else below / (2.0 * a)
    return min(1.0, max(0.0, found))


@compiled
def mix(s: StepArrays) -> None:
    """Make impulses and velocities those of the parts that are kept."""
    for c in range(s.contact_count):
        part = s.bounce[s.group[c], KEPT]
        for k in range(3):
            s.x[c, k] += part * (s.x_bounce[c, k] - s.x[c, k])
    for b in range(s.v.shape[0]):
        part = s.bounce[root_of(s.parent, b), KEPT]
        for k in range(6):
            s.v[b, k] += part * (s.v_bounce[b, k] - s.v[b, k])
    for k in range(s.y.size):
        s.y[k] += s.bounce[root_of(s.parent, s.row_owner[k]), KEPT] * (s.y_bounce[k] - s.y[k])


# ------------------------------------------------------------------ motion


@compiled
def mark_moved(work: Any, s: StepArrays, goes: Integers) -> None:
    """Mark by 1 the machines that contacts act on, or that have some near."""
    for b in range(goes.size):
        goes[b] = 0
    for b in range(1, goes.size):
        m = s.first[b, BODY] if s.first[b, CONTACT] >= 0 and s.first[b, ROW] >= 0 else -1
        while m >= 0:
            goes[s.machine[m]], m = 1, s.next_body[m]
        for k in range(6):
            if s.end[b, k] != s.free[b, k] or work.pushed[b, k] != 0.0 or s.hit[b] != NOT_HIT:
                goes[s.machine[b]] = 1


@compiled
def put_falls(s: StepArrays) -> None:
    """Put what part of their change without contacts bodies that are hit fall by, ``flies``.

    Contacts bear the rest, as far as they push against that change; of what joints connect, as a
    whole.
    """
    sums = s.bounce
    for b in range(1, s.end.shape[0]):
        sums[b, 0] = sums[b, 1] = 0.0
    for b in range(1, s.end.shape[0]):
        if s.hit[b] != NOT_HIT and s.flies[b] == 0.0:
            whole = sums[s.machine[b]]
            for k in range(6):
                s.change[k] = s.free[b, k] - s.before[b, k]
                s.turned[k] = s.free[b, k] + s.jump[b, k] - s.end[b, k]
            whole[0] += product_of(s.change, s.turned, s.mass[b], s.spin[b])
            whole[1] += product_of(s.change, s.change, s.mass[b], s.spin[b])
    for b in range(1, s.end.shape[0]):
        if s.flies[b] == 0.0:
            borne, size = sums[s.machine[b], 0], sums[s.machine[b], 1]
            s.flies[b] = 1.0 - min(max(borne / max(size, TINY), 0.0), 1.0)


@compiled
def mean_of(s: StepArrays, b: int, k: int) -> float:
    """Mean of a velocity in the step."""
    before, end, first = s.before[b, k], s.end[b, k], s.hit[b]
    if first == NOT_HIT:
        return 0.5 * (before + end)
    fall, last = s.flies[b] * (s.free[b, k] - before), 1.0 - first
    return first * (before + 0.5 * first * fall) + last * (end - 0.5 * last * fall)
