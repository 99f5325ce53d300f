"""What collides, and moves then; bounces with friction that give no more energy than they take.

Newton's law with friction may gain energy (Kane, Levinson, Dynamics: theory and applications, 1985,
sec. 5.8). Where it would, impulses are a mean of these and of those without a bounce: cones are
convex, and without a bounce nothing is gained.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.moreau.arrays import BOUNCES, CONE, STOPS, StepArrays
from dap3d_core.integrators.moreau.contact_set import velocity_of
from dap3d_core.integrators.moreau.gauss_seidel import copy_impulses
from dap3d_core.integrators.moreau.newton import TINY, product_of
from dap3d_core.integrators.moreau.problem import BODY, CONTACT, ROW, find_groups, root_of, solve
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Columns of ``bounce``: work of the impulses of a group with the bounce, half of it, and without;
#: the sum of the magnitudes of its parts; how much of the bounce is kept.
WITH, HALF, WITHOUT, EXCHANGED, KEPT = range(5)
#: Work that is rounding, as a part of what is exchanged.
GAIN_ROUNDING = 1e-12
#: Gaps, m of a scene of ordinary size, below which overlaps are left.
OVERLAP = 1e-12
#: Part of the step where bodies are not hit, and the least part behind a hit that counts.
NOT_HIT, SHORT = 2.0, 1e-9
#: A contact collides where it approaches by more than this times h times the acceleration.
COLLIDES = 4.0


@compiled
def put_bias(s: StepArrays) -> bool:
    """What is added to normal velocities, and when bodies are hit; True if bodies collide."""
    fall, found = 0.0, False
    for b in range(s.free.shape[0]):
        for k in range(3):
            fall = max(fall, abs(s.free[b, k] - s.before[b, k]))
    for c in range(s.contact_count):
        bias, s.collides[c] = s.bias[c], 0
        bias[0] = bias[1] = bias[2] = 0.0
        if s.kind[c] != CONE:
            continue
        approach, _, _ = velocity_of(s, c, s.before)
        normal, _, _ = velocity_of(s, c, s.free)
        change, gap = max(fall, abs(normal - approach)), max(s.gap[c], 0.0)  # by turning, too
        if approach < -COLLIDES * change and gap + s.h * min(approach, normal) < 0.0:
            s.closing[c] = closing_of(gap, s.h * approach, s.h * (normal - approach))
            last = 1.0 - s.closing[c]
            back = last * (normal - approach) - s.e[c] * (normal - last * (normal - approach))
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


@compiled
def put_flies(s: StepArrays) -> None:
    """Mark the groups of which something stops, or is borne, by 0."""
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
        if s.collides[c] == BOUNCES:
            s.bias[c, 0] = 0.0
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
                s.change[k], s.turned[k] = s.free[b, k] - s.before[b, k], s.free[b, k] - s.end[b, k]
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
