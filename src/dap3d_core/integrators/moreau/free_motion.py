"""The state at the end of a step without contacts, by the explicit midpoint rule in parts.

Forces are those along the way that bodies go with the accelerations that contacts gave them in the
last step: a damper of what rests has none.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.assembly.arrays import System, coordinate_offset, velocity_offset
from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.integrators.moreau.arrays import StepArrays
from dap3d_core.integrators.moreau.contact_set import axes_of, evaluate_rows
from dap3d_core.integrators.stepping.integration_state import TRIAL, Function, Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Parts of a step are at most this over the largest rate of the forces: an oscillation of that rate
#: gains 5e-4 of its amplitude in one. Parts of a step as asked for, at most. Passes of an estimate
#: of the rate, which change y by this part.
PART, MOST_PARTS, RATE_PASSES, RATE_CHANGE = 0.25, 1000, 8, 1e-7


@compiled
def move_freely(
    work: Any, s: StepArrays, has_rates: bool, rhs: Function, system: System, loops: Any
) -> None:
    """Put the state at the end of the step with the last accelerations, as the trial state.

    has_rates: ``slopes`` begins with dy/dt at the start of the step.
    """
    t, y, free, size = work.t, work.state[Y], work.state[TRIAL], work.state.shape[1]
    slope, middle, parts = s.slopes[:size], s.slopes[size:], parts_of(work, s)
    copy(free, y)
    h = s.h / parts
    n = s.mass.size - 1
    zero(s.y_free)
    for b in range(1, n + 1):
        zero(s.path[b])
    for k in range(parts):
        begun = t + k * h
        if k > 0 or not has_rates:
            rhs(begun, free, slope, system, loops)
            work.rhs_count += 1
        add_pushed(work.pushed, free, slope)
        for i in range(size):
            middle[i] = free[i] + 0.5 * h * slope[i]
        rhs(begun + 0.5 * h, middle, slope, system, loops)
        add_pushed(work.pushed, middle, slope)
        for i in range(size):
            free[i] += h * slope[i]
        for i in range(s.y_free.size if s.load_count.size > 0 else 0):
            s.y_free[i] -= h * system.multipliers[system.row[i]]
        take_velocities(middle, n, s.rest)
        for b in range(1, n + 1):
            normalise(free, coordinate_offset(b) + 3)
            for i in range(6):
                s.path[b, i] += s.rest[b, i] / parts
        work.rhs_count += 1


@compiled
def parts_of(work: Any, s: StepArrays) -> int:
    """In how many parts a step follows the forces."""
    wanted = s.h * work.rate / PART
    return math.ceil(min(wanted, MOST_PARTS * s.h / work.fixed_step)) if wanted > 1.0 else 1


@compiled
def follow_states(work: Any, s: StepArrays, rhs: Function, system: System, loops: Any) -> None:
    """Integrate the states of elements again, along the way that bodies went as contacts began.

    A state that sums up, as a length that counts turns, would keep the way of free motion for good.
    """
    y, trial, size, n = work.state[Y], work.state[TRIAL], work.state.shape[1], s.mass.size - 1
    slope, middle, parts = s.slopes[:size], s.slopes[size:], parts_of(work, s)
    first = s.first_state - 1
    copy(trial[first : size - 1], y[first : size - 1])
    for k in range(2 * parts):  # to the middle of each part, and to its end
        place = (2 * (k // 2) + 1) / (2.0 * parts) if k % 2 else (k // 2) / parts
        for i in range(size):
            middle[i] = y[i] + place * (trial[i] - y[i])
        for i in range(first, size - 1):
            middle[i] = trial[i] + (0.5 * s.h / parts * slope[i] if k % 2 else 0.0)
        for b in range(1, n + 1):
            normalise(middle, coordinate_offset(b) + 3)
            put_mean_rates(y, trial, coordinate_offset(b), s.h, middle[velocity_offset(b, n) :])
        rhs(work.t + place * s.h, middle, slope, system, loops)
        for i in range(first, size - 1 if k % 2 else first):
            trial[i] += s.h / parts * slope[i]
    work.rhs_count += 2 * parts


@compiled
def put_mean_rates(y: Floats, z: Floats, c: int, h: float, rates: Floats) -> None:
    """Put velocity and angular velocity, body axes, with which a body goes from y to z in h."""
    for k in range(3):
        rates[k] = (z[c + k] - y[c + k]) / h
    e, a, b, d = y[c + 3], y[c + 4], y[c + 5], y[c + 6]
    f, p, q, r = z[c + 3], z[c + 4], z[c + 5], z[c + 6]
    turn, x = e * f + a * p + b * q + d * r, e * p - a * f - b * r + d * q
    v, w = e * q - b * f - d * p + a * r, e * r - d * f - a * q + b * p
    size = math.sqrt(x * x + v * v + w * w)
    part = 2.0 * math.atan2(size, abs(turn)) / (h * size) if size > 0.0 else 0.0
    part = -part if turn < 0.0 else part
    rates[3], rates[4], rates[5] = part * x, part * v, part * w


@compiled
def add_pushed(pushed: Floats, y: Floats, slope: Floats) -> None:
    """Add accelerations by contacts, whose turning is in global axes, to dy/dt."""
    n = pushed.shape[0] - 1
    for b in range(1, n + 1 if pushed[0, 0] != 0.0 else 1):
        p, f, a = y[coordinate_offset(b) :], velocity_offset(b, n), pushed[b]
        for k in range(3):
            slope[f + k] += a[k]
            c, d, e = axes_of(p, k)
            slope[f + 3] += c * a[3 + k]
            slope[f + 4] += d * a[3 + k]
            slope[f + 5] += e * a[3 + k]


@compiled
def put_middle(work: Any, s: StepArrays) -> Floats:
    """The state halfway to that expected at the end of the step."""
    y, trial, size = work.state[Y], work.state[TRIAL], work.state.shape[1]
    middle = s.slopes[:size]
    for i in range(size):
        middle[i] = 0.5 * (y[i] + trial[i])
    for b in range(1, s.end.shape[0]):
        normalise(middle, coordinate_offset(b) + 3)
    return middle


@compiled
def put_struck(work: Any, s: StepArrays) -> Floats:
    """The state in which bodies that are hit are where they are then; others at the start."""
    y, trial, struck = work.state[Y], work.state[TRIAL], s.slopes[: work.state.shape[1]]
    copy(struck, y)
    for b in range(1, s.end.shape[0]):
        first = coordinate_offset(b)
        if s.hit[b] <= 1.0:
            for k in range(first, first + 7):
                struck[k] += s.hit[b] * (trial[k] - y[k])
            normalise(struck, first + 3)
    return struck


@compiled
def normalise(y: Floats, c: int) -> None:
    """Make Euler parameters at c those of unit length."""
    a, b, d, e = y[c], y[c + 1], y[c + 2], y[c + 3]
    size = math.sqrt(a * a + b * b + d * d + e * e)
    y[c], y[c + 1], y[c + 2], y[c + 3] = a / size, b / size, d / size, e / size


@compiled
def size_of(x: Floats, count: int) -> float:
    """Length of the first numbers."""
    total = 0.0
    for i in range(count):
        total += x[i] * x[i]
    return math.sqrt(total)


@compiled
def largest_rate(work: Any, s: StepArrays, rhs: Function, system: System, loops: Any) -> float:
    """Largest size of an eigenvalue of df/dy, 1/s, by powers of it; one a call, but at the start.

    There as many as it takes where forces are fast.

    ``slopes`` then begins with dy/dt.
    Source: the nonlinear power method of Sommeijer, Shampine, Verwer, RKC: an explicit solver
    for parabolic PDEs (J. Comp. Appl. Math. 88, 1997). Of an oscillation two powers are taken
    together: one changes m to m/s, the other back.
    """
    y, at_y, change, size = work.state[Y], work.state[TRIAL], work.direction, work.state.shape[1]
    slope, other = s.slopes[:size], s.slopes[size:]
    rhs(work.t, y, at_y, system, loops)
    last = size - 1  # the work, which changes nothing
    length, before, found = 1.0 + size_of(y, last), 0.0, work.last_rate
    work.rhs_count += 1
    for _ in range(RATE_PASSES if work.step_count == 0 else 1):
        change[last] = 0.0
        norm = size_of(change, last)
        if not 0.0 < norm <= 1e300:
            for i in range(last):
                change[i] = math.cos(1.0 + i)  # has a part of every direction
            norm = size_of(change, last)
        scale = RATE_CHANGE * length / norm
        for i in range(size):
            change[i] *= scale
            other[i] = y[i] + change[i]
        norm = size_of(change, last)
        rhs(work.t, other, slope, system, loops)
        work.rhs_count += 1
        for i in range(size):
            change[i] = slope[i] - at_y[i]
        before, found = found, size_of(change, last) / norm
        if before > 0.0 and max(before, found) * work.fixed_step <= PART:  # by one part, anyway
            break
    work.last_rate = found
    copy(slope, at_y)
    return math.sqrt(before * found)


@compiled
def take_velocities(y: Floats, n: int, v: Floats) -> None:
    """Put the velocities of an integrated state, in global axes."""
    for b in range(1, n + 1):
        f, p = velocity_offset(b, n), y[coordinate_offset(b) :]
        for k in range(3):
            v[b, k] = y[f + k]
            a, c, d = axes_of(p, k)
            v[b, 3 + k] = a * y[f + 3] + c * y[f + 4] + d * y[f + 5]


@compiled
def fit_joints(work: Any, s: StepArrays, turns: bool, system: System, loops: Any) -> None:
    """Put what joints ask of D v at the end of the step as they turn with the velocities found.

    Free motion turns them differently: in a loop that contacts close no velocities fit both.
    """
    y, state, part = work.state[Y], s.slopes[: work.state.shape[1]], 0.5 if turns else 1.0
    if not turns:
        copy(state, y)
    give_velocities(state, s.v)
    evaluate_rows(work.t + (1.0 - part) * s.h, state, False, s, system, loops)
    for k in range(s.y.size):
        row = system.row[k]
        s.free_speed[k] = system.nu[row] + part * s.h * system.gamma[row]


@compiled
def give_velocities(y: Floats, v: Floats) -> None:
    """Give an integrated state velocities v of bodies, in global axes."""
    n = v.shape[0] - 1
    for b in range(1, n + 1):
        f, p, w = velocity_offset(b, n), y[coordinate_offset(b) :], v[b]
        a, c, d = axes_of(p, 0)
        e, g, h = axes_of(p, 1)
        i, k, m = axes_of(p, 2)
        y[f], y[f + 1], y[f + 2] = w[0], w[1], w[2]
        y[f + 3] = a * w[3] + e * w[4] + i * w[5]
        y[f + 4] = c * w[3] + g * w[4] + k * w[5]
        y[f + 5] = d * w[3] + h * w[4] + m * w[5]


@compiled
def move(y: Floats, c: int, dx: float, dy: float, dz: float, a: float, b: float, d: float) -> None:
    """Move and turn the body at c by (dx, dy, dz), m, and (a, b, d), rad, in global axes."""
    y[c], y[c + 1], y[c + 2] = y[c] + dx, y[c + 1] + dy, y[c + 2] + dz
    half = 0.5 * math.sqrt(a * a + b * b + d * d)
    part = 0.5 * (math.sin(half) / half if half > 0.0 else 1.0)
    a, b, d, f = part * a, part * b, part * d, math.cos(half)
    e0, e1, e2, e3 = y[c + 3], y[c + 4], y[c + 5], y[c + 6]
    p0 = f * e0 - (a * e1 + b * e2 + d * e3)
    p1 = f * e1 + a * e0 + (b * e3 - d * e2)
    p2 = f * e2 + b * e0 + (d * e1 - a * e3)
    p3 = f * e3 + d * e0 + (a * e2 - b * e1)
    size = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    y[c + 3], y[c + 4], y[c + 5], y[c + 6] = p0 / size, p1 / size, p2 / size, p3 / size
