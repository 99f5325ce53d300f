"""Location of switches: a step ends where one of them changes its sign, and another law begins.

``watch(t, y, out, system, loops)`` gives the switches, numbers that vary smoothly with the state.
A step is taken only if all its stages and its end lie on the sides from which it started; so no
step mixes two laws, and the location needs no dense output, which would mix them as well
(docs/decisions/0011). Near a crossing

1. values and rates at both ends of the last step predict it: the step ends shortly before
   (``distance_to_crossing``); each such step brings it some thousand times nearer;
2. an attempt with a sample on the other side is cut to where a parabola through that sample leads
   (``cut_step``); a polynomial through both ends and a sample between them shows a switch that
   changes its sign twice in a step;
3. the rest is an Euler step, so short that its error is below rounding: in it the instant is found
   by bisection, to the last digit of time (``bisect_crossing``). The state goes to the far side,
   the integration starts anew; where the switch ends the run, the state stays on the near side.
"""

import math
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import ENDS, JUMPS, MODE_ENDS, SEAM, UNSEEN
from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function, IntegrationState
from dap3d_core.integrators.stepping.output import project_state
from dap3d_core.integrators.stepping.step_control import EPSILON, FLOOR
from dap3d_core.integrators.stepping.switch_values import (
    changes_sign,
    evaluate,
    evaluate_start,
    find_switch_rates,
    first_across,
    has_jumped,
    is_across,
    is_along_seam,
    may_rest,
    near_edge,
    rate_difference,
    record_crossing,
    time_span,
    usual_step,
)
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import is_differentiated, with_slopes

#: A crossing this part of a usual step away is reached by an Euler step: its error is of the order
#: of the square.
EULER_STEP_FRACTION = 1e-9
#: The least part of the way to a crossing that is left for the next step, and the greatest.
CROSSING_MARGIN, MAX_CROSSING_MARGIN = 1e-4, 0.05
#: How often an Euler step towards a crossing that is nearer than rounding is doubled at most.
MAX_STALLS = 20
#: The same until what is zero is taken to stay so: a slow passage, by less than a bit in such a
#: step, leaves zero in one of them, of a millionth of a usual step.
MAX_STALLS_AT_ZERO = 10
#: A step this part of a usual one has been cut, and grows anew.
CUT_SHORT = 1e-3
#: A change of a switch by this part of its band is rounding.
SAME = 1.0 / 32.0
#: Attempts in a row that may be cut because a polynomial, and no sample, shows two crossings; its
#: values in a step that are compared, and Newton steps to the least; and the error of a cubic, as a
#: part of its drop: of a sine 5 % in a step of 1.5 rad, 20 % in one of 3.
MAX_SUSPICIONS, PLACES, NEWTON_STEPS, CUBIC_ERROR = 8, 16, 3, 0.25
#: Newton steps for derivatives of an instant; each leaves the error of the rate, 1e-4 as a rule.
CROSSING_PASSES = 4
#: A switch that changes its sign more often than this while time advances by less than this part of
#: the run chatters.
CHATTER, CHATTER_SPAN = 100, 1e-6


@compiled
def next_length(
    work: IntegrationState, end: float, slope: Floats, rhs: Function, project: Function,
    watch: Function, system: Any, loops: Any,
) -> float:  # fmt: skip
    """Length of the next step, which may go to time ``end``; 0 where it has been done here.

    slope: dy/dt at the state, as the integrator has it.
    """
    longest, work.middle_part = min(end, work.step_limit) - work.t, 0.0
    h = min(longest, with_slopes(work.step_limit_at_switch, 0.0))
    short = max(EULER_STEP_FRACTION * usual_step(work), 4.0 * FLOOR * time_span(work))
    short = with_slopes(short, 0.0)  # as all lengths that are chosen
    if work.switch_count != 0:
        if work.switch_rates_valid == 0:
            evaluate_start(work, slope, project, watch, system, loops)
            if work.end_status != 0:
                return 0.0
        h = min(h, with_slopes(distance_to_crossing(work, h, short), 0.0))
    short *= 2.0 ** min(work.stalled_steps, MAX_STALLS)
    if h > short or h == end - work.t:
        return h
    if work.stalled_steps != 0 and work.fixed_step == 0.0:
        longest = work.step_limit - work.t  # a usual step may be as short as the stalled ones
    h = min(min(longest, 2.0 * short), work.times[work.next_report] - work.t)
    bisect_crossing(work, h, end, slope, rhs, project, watch, system, loops)
    return 0.0


@compiled
def time_to_zero(value: float, rate: float, bend: float) -> float:
    """First t > 0 with value + rate t + bend t^2 / 2 = 0, for value >= 0; infinite if none."""
    if value <= 0.0:
        return 0.0 if rate < 0.0 else np.inf
    inside = rate * rate - 2.0 * value * bend
    if inside < 0.0:
        return np.inf
    if rate < 0.0:
        return 2.0 * value / (math.sqrt(inside) - rate)
    return (rate + math.sqrt(inside)) / -bend if bend < 0.0 else np.inf


@compiled
def distance_to_crossing(work: IntegrationState, h: float, short: float) -> float:
    """Length of a step that may have length h: it ends shortly before the next crossing.

    short: the length up to which an Euler step is taken.
    """
    s, longest = work.switches, h
    for k in range(s.shape[1]):
        side = s[at.SIDE, k]
        if side == 0.0:
            continue
        value, rate, bend = side * s[at.VALUE, k], side * s[at.RATE, k], side * s[at.BEND, k]
        if may_rest(s, k) and value + short * rate >= 0.0:
            continue  # its rate is rounding
        left = time_to_zero(value - near_edge(s, k), rate, bend)
        if left < longest:
            doubt = 0.5 * left * bend / rate if rate < 0.0 else 1.0
            left *= 1.0 - min(MAX_CROSSING_MARGIN, CROSSING_MARGIN + doubt * doubt)
            if left < h:
                h, work.near_switch = left, k
    return h


@compiled
def is_sample_across(
    work: IntegrationState, t: float, h: float, x: Floats, watch: Function, system: Any, loops: Any
) -> bool:
    """True if a state within a step of length h lies across a switch; then the step is cut."""
    if work.sampled_switch_count == 0:
        return False
    evaluate(work, t, x, at.SAMPLE, watch, system, loops)
    return is_cut_at_sample(work, t, h)


@compiled
def is_cut_at_sample(work: IntegrationState, t: float, length: float) -> bool:
    """``is_sample_across`` once the values of the sample are known.

    Not of what is UNSEEN: where a function takes another form it is smooth: a step may mix both.
    Nor of contacts that begin in their band and by their rates would still be there, as one that
    opens does: an early stage, an Euler step, errs by the curvature of what slides, the end does
    not. One that bounces may be back, and away again at the end.
    """
    s, h = work.switches, t - work.t
    if h < length and abs(h / length - 0.5) <= abs(work.middle_part - 0.5):
        work.middle_part = with_slopes(h / length, 0.0)
        for k in range(s.shape[1]):
            s[at.MIDDLE, k] = s[at.SAMPLE, k]
    for k in range(s.shape[1]):
        moved = h * s[at.SIDE, k] * s[at.RATE, k]
        rests = s[at.DOES, k] == MODE_ENDS and may_rest(s, k) and moved < 2.0 * s[at.BAND, k]
        if s[at.DOES, k] == UNSEEN or rests:
            s[at.SAMPLE, k] = s[at.SIDE, k]
    if not changes_sign(s, at.SAMPLE):
        return False
    cut_step(work, at.SAMPLE, t - work.t)
    return True


@compiled
def cut_step(work: IntegrationState, row: int, h: float) -> None:
    """Cut the next attempt to before the crossing that a sample at h has shown."""
    s = work.switches
    left = h
    for k in range(s.shape[1]):
        side, edge = s[at.SIDE, k], near_edge(s, k)
        value, rate, found = side * s[at.VALUE, k], side * s[at.RATE, k], side * s[row, k]
        if side != 0.0 and found <= edge:
            bend = 2.0 * (found - value - rate * h) / (h * h)
            crosses = time_to_zero(value - edge, rate, bend)
            if crosses <= left:
                left, work.near_switch = crosses, k
    work.cut_attempts += 1
    work.rejected_count += 1
    # samples are as good as the stages they belong to: trusted less from attempt to attempt
    work.step_limit_at_switch = left * max(0.25, 1.0 - 0.01 * 4.0**work.cut_attempts)


@compiled
def end_is_across(
    work: IntegrationState, t1: float, slope: Floats, project: Function, watch: Function,
    system: Any, loops: Any,
) -> bool:  # fmt: skip
    """True if the trial state, with dy/dt ``slope``, lies across, or the motion went there.

    Then the step is cut. Its switches stand in row FOUND.
    """
    s, trial, h = work.switches, work.state[at.TRIAL], t1 - work.t
    if changes_sign(s, at.FOUND):
        cut_step(work, at.FOUND, h)
        return True
    rows = at.FOUND, at.FOUND_RATE
    find_switch_rates(work, t1, trial, slope, rows, project, watch, system, loops)
    if work.cut_attempts >= MAX_SUSPICIONS or h < rate_difference(work):
        return False  # rates over more than the step say nothing of what is within
    part = 1.0
    for k in range(s.shape[1]):
        side = s[at.SIDE, k]
        low = lowest_between(side * s[at.VALUE, k], h * side * s[at.RATE, k], side * s[at.FOUND, k],
                             h * side * s[at.FOUND_RATE, k], work.middle_part,
                             side * s[at.MIDDLE, k])  # fmt: skip
        if low < part:
            part, work.near_switch = low, k
    if part == 1.0:
        return False
    work.cut_attempts += 1
    work.rejected_count += 1
    work.step_limit_at_switch = part * h
    return True


@compiled
def lowest_between(a: float, b: float, c: float, d: float, part: float, middle: float) -> float:
    """As ``cubic_minimum``, of the quartic that also has the value ``middle`` within, at ``part``.

    What depends on the motion of a body that turns bends otherwise than by its ends: a ball beside
    the edge of a box came and left in a step of radau, and the cubic missed three quarters of it.
    """
    weight = part * part * (1.0 - part) * (1.0 - part)
    if weight == 0.0:
        return cubic_minimum(a, b, c, d)
    p2, p3 = 3.0 * (c - a) - 2.0 * b - d, b + d - 2.0 * (c - a)
    p4 = (middle - a - part * (b + part * (p2 + part * p3))) / weight
    between = 0.5 * (a + c) + (b - d) / 6.0 + p4 / 6.0
    if min(a + 0.25 * b, c - 0.25 * d, between) > 0.5 * c:
        return 1.0  # Bezier's points are clear of zero, by more than the error below
    low, high, top, x = a, a, a, 0.0
    for k in range(1, PLACES + 1):
        value = quartic(a, b, p2, p3, p4, k / PLACES)
        top = max(top, value)
        if value < low:
            low, high, x = value, top, k / PLACES
    for _ in range(NEWTON_STEPS):
        slope = b + x * (2.0 * p2 + 3.0 * p3 * x + p4 * (2.0 - x * (6.0 - 4.0 * x)))
        bend = 2.0 * p2 + 6.0 * p3 * x + p4 * (2.0 - 12.0 * x * (1.0 - x))
        if bend > abs(slope) * PLACES:
            x -= slope / bend
    if not 0.0 < x < 1.0:
        return 1.0
    low = min(low, quartic(a, b, p2, p3, p4, x))
    return 1.0 if low >= (1.0 if b > 0.0 else CUBIC_ERROR) * (min(high, c) - low) else x


@compiled
def quartic(a: float, b: float, p2: float, p3: float, p4: float, x: float) -> float:
    """A cubic by its coefficients, and a quartic that is flat at 0 and 1."""
    left = x * (1.0 - x)
    return a + x * (b + x * (p2 + x * p3)) + p4 * left * left


@compiled
def cubic_minimum(a: float, b: float, c: float, d: float) -> float:
    """Abscissa in (0, 1) of the minimum of the cubic with values a, c, slopes b, d at 0, 1.

    1 where there is none, or where it is clear of zero: by more than a cubic errs, which is a part
    of the drop to it from the nearer end; all of the drop from a maximum, where it rises before.
    """
    if not d > 0.0:
        return 1.0
    rise = c - a
    p2, p3 = 3.0 * rise - 2.0 * b - d, b + d - 2.0 * rise
    inside = p2 * p2 - 3.0 * p3 * b
    root, x = math.sqrt(max(inside, 0.0)), 1.0
    if p2 < 0.0 and p3 > 0.0:
        x = (root - p2) / (3.0 * p3)
    elif p2 >= 0.0 and b < 0.0:
        x = -b / (p2 + root)
    if inside < 0.0 or not 0.0 < x < 1.0:
        return 1.0
    low, high, error = a + x * (b + x * (p2 + x * p3)), a, CUBIC_ERROR
    if b > 0.0:  # then p2 < 0 < p3
        top = -(p2 + root) / (3.0 * p3)
        high, error = a + top * (b + top * (p2 + top * p3)), 1.0
    return 1.0 if low >= error * (min(high, c) - low) else x


@compiled
def update_switches_after_step(
    work: IntegrationState, h: float, longest: float, end: float
) -> None:
    """Take over the switches at the end of an accepted step; if it was cut, restore the usual step.

    h: its length; longest, end: the length it might have had, and where it would have ended.
    """
    s = work.switches
    if h < longest:
        work.h = max(work.h, longest)
    if work.fixed_step != 0.0 and work.t < end:
        work.segment_step -= 1
    work.step_limit_at_switch = np.inf
    if work.switch_count == 0:
        return
    stalled, is_short = 0, (work.cut_attempts > 0) | (h < CUT_SHORT * work.uncut_step)
    if not is_short:
        work.near_switch = -1
    for k in range(s.shape[1]):
        approaches = (s[at.SIDE, k] * s[at.RATE, k] < 0.0) | may_rest(s, k)  # or its rate is noise
        is_same = abs(s[at.FOUND, k] - s[at.VALUE, k]) <= SAME * s[at.BAND, k]
        stalled |= is_short & approaches & is_same & (k == work.near_switch)
        s[at.BEND, k] = (s[at.FOUND_RATE, k] - s[at.RATE, k]) / h
        s[at.VALUE, k], s[at.RATE, k] = s[at.FOUND, k], s[at.FOUND_RATE, k]
        if is_along_seam(work, k):
            s[at.VALUE, k] -= s[at.SIDE, k] * s[at.BAND, k]
            s[at.SIDE, k] = 0.0  # until it leaves
        elif s[at.SIDE, k] == 0.0:
            s[at.SIDE, k] = np.sign(s[at.FOUND, k])
            s[at.VALUE, k] += s[at.SIDE, k] * s[at.BAND, k]
    work.cut_attempts = 0
    work.stalled_steps = work.stalled_steps + 1 if stalled else 0


@compiled
def bisect_crossing(
    work: IntegrationState, h: float, end: float, slope: Floats, rhs: Function, project: Function,
    watch: Function, system: Any, loops: Any,
) -> None:  # fmt: skip
    """Take an Euler step of length h, or to the crossing in it, where integration starts anew."""
    s, t, unknown, rates = work.switches, work.t, 0.0, slope
    if is_differentiated():
        rates = work.state[at.SCRATCH]  # that of a polynomial would be wrong by its error
        rhs(t, work.state[at.Y], rates, system, loops)
    low, high, least = 0.0, h, 1e-3 * EPSILON * time_span(work)
    failure = euler_step(work, high, slope, rates, project, watch, system, loops)
    crossed = work.switch_count != 0 and is_across(s, at.FOUND)
    if crossed:
        middle = 0.5 * high
        while failure == at.RUNNING and t + low < t + middle < t + high and high - low > least:
            failure = euler_step(work, middle, slope, rates, project, watch, system, loops)
            if is_across(s, at.FOUND):
                high = middle
            else:
                low = middle
            middle = 0.5 * (low + high)
        if failure == at.RUNNING:
            high = differentiated_crossing(
                work, high, slope, rates, rhs, project, watch, system, loops
            )
            if is_differentiated() and has_jumped(work):
                unknown, high = with_slopes(0.0, high * np.nan), with_slopes(high, 0.0)
            failure = euler_step(work, high, slope, rates, project, watch, system, loops)
        record_crossings(work, t + high, unknown)
        if failure == at.RUNNING and work.end_status == at.SWITCHED:
            high = with_slopes(low, high)
            failure = euler_step(work, high, slope, rates, project, watch, system, loops)
    if failure != at.RUNNING:
        work.t_stop, work.status = t + high, failure
        return
    work.t = t + high
    copy(work.state[at.Y], work.state[at.TRIAL])
    work.step_count += 1
    if work.fixed_step != 0.0 and work.t >= end:
        work.segment_step += 1
    work.first_stage_valid = work.switch_rates_valid = work.cut_attempts = 0
    work.step_limit_at_switch = np.inf
    crossed = leaves_zero(work, crossed)
    if crossed:
        reset_step_control(work)
        for k in range(s.shape[1]):
            if s[at.CROSSED, k] != 0.0 and work.end_status == 0:
                work.status = at.JUMPED


@compiled
def leaves_zero(work: IntegrationState, crossed: bool) -> bool:
    """Count steps at the end of which a switch stays where it is; True if one is across.

    It is also where one has been zero for long and jumps decide what follows.
    """
    s, stays = work.switches, 0
    for k in range(s.shape[1]):
        if s[at.FOUND, k] == s[at.VALUE, k] and s[at.SIDE, k] * s[at.RATE, k] < 0.0:
            stays = 1  # a step to a crossing that changes no digit of its switch
        if s[at.VALUE, k] == 0.0 and s[at.FOUND, k] == 0.0 and s[at.SIDE, k] != 0.0:
            stays = 1
            if work.stalled_steps >= MAX_STALLS_AT_ZERO and s[at.DOES, k] >= JUMPS:
                s[at.SIDE, k] = s[at.CROSSED, k] = -s[at.SIDE, k]
                crossed = True
            elif work.stalled_steps >= MAX_STALLS_AT_ZERO:
                s[at.SIDE, k] = 0.0  # it stays zero: it has no side until it leaves
    if crossed:
        work.stalled_steps = 0
    elif work.stalled_steps != 0 or stays != 0:
        work.stalled_steps += 1
    return crossed


@compiled
def differentiated_crossing(
    work: IntegrationState, h: float, slope: Floats, rates: Floats, rhs: Function,
    project: Function, watch: Function, system: Any, loops: Any,
) -> float:  # fmt: skip
    """The length h of an Euler step to a crossing, with the derivatives that keep the switch zero.

    Bisection gives none. A Newton step corrects them; more correct the error of its rate. That is a
    central difference: of a corner that turns while it hardly approaches one to a side is wrong.
    """
    if not is_differentiated():
        return h
    s, count = work.switches, work.projection_count
    beside = with_slopes(rate_difference(work), 0.0)
    euler_step(work, h, slope, rates, project, watch, system, loops)
    put_rates_before(work, slope, rates, rhs, system, loops)
    for _ in range(CROSSING_PASSES):
        euler_step(work, h + beside, slope, rates, project, watch, system, loops)
        copy(s[at.FOUND_RATE], s[at.FOUND])
        euler_step(work, h - beside, slope, rates, project, watch, system, loops)
        for k in range(s.shape[1]):
            s[at.FOUND_RATE, k] = (s[at.FOUND_RATE, k] - s[at.FOUND, k]) / (2.0 * beside)
        euler_step(work, h, slope, rates, project, watch, system, loops)
        k = first_across(s)
        if k >= 0 and s[at.FOUND_RATE, k] != 0.0:
            h = with_slopes(h, h - s[at.FOUND, k] / s[at.FOUND_RATE, k])
    work.projection_count = count
    return h


@compiled
def put_rates_before(
    work: IntegrationState, slope: Floats, rates: Floats, rhs: Function, system: Any, loops: Any
) -> None:
    """Put the rates before a seam, of which the state is beyond, as far as its band allows."""
    s, k, before = work.switches, first_across(work.switches), work.state[at.TRIAL]
    if k < 0 or s[at.DOES, k] != SEAM or s[at.RATE, k] == 0.0:
        return
    back = with_slopes(2.0 * abs(s[at.BAND, k] / s[at.RATE, k]), 0.0)
    for i in range(before.shape[0]):
        before[i] = work.state[at.Y, i] - back * slope[i]
    rhs(work.t - back, before, rates, system, loops)


@compiled
def euler_step(
    work: IntegrationState, h: float, slope: Floats, rates: Floats, project: Function,
    watch: Function, system: Any, loops: Any,
) -> int:  # fmt: skip
    """The state after a very short time h, on its constraints, as trial state; its switches."""
    t, y, trial = work.t + h, work.state[at.Y], work.state[at.TRIAL]
    for i in range(y.shape[0]):
        trial[i] = with_slopes(y[i] + h * slope[i], y[i] + h * rates[i])
    failure = project_state(work, t, trial, project, system, loops)
    if failure == at.RUNNING and work.switch_count != 0:
        evaluate(work, t, trial, at.FOUND, watch, system, loops)
    return failure


@compiled
def record_crossings(work: IntegrationState, t: float, unknown: float) -> None:
    """Record sign changes of switches at t, and what follows: end, chatter, or another side.

    unknown: 0; its derivatives are NaN where those of the instant are to be found otherwise.
    """
    s = work.switches
    for k in range(s.shape[1]):
        if not s[at.FOUND, k] * s[at.SIDE, k] < 0.0:
            continue
        s[at.SIDE, k] = -s[at.SIDE, k]
        record_crossing(work, k, t + unknown)
        if s[at.DOES, k] == ENDS and s[at.SIDE, k] < 0.0:
            work.end_status, work.terminal_switch = at.SWITCHED, k
        if s[at.DOES, k] >= JUMPS:
            s[at.CROSSED, k] = s[at.SIDE, k] + unknown
        if s[at.COUNT, k] == 0.0 or t - s[at.SINCE, k] > CHATTER_SPAN * (
            work.times[-1] - work.times[0]
        ):
            s[at.SINCE, k], s[at.COUNT, k] = t, 0.0
        s[at.COUNT, k] += 1.0
        if s[at.COUNT, k] > CHATTER and work.end_status == 0:
            work.end_status, work.terminal_switch = at.CHATTERED, k


@compiled
def reset_step_control(work: IntegrationState) -> None:
    """Let step-size control start anew: what follows is another motion."""
    work.h, work.uncut_step, work.last_error = 0.0, 0.0, 1e-4
    work.first_stage_valid = work.switch_rates_valid = work.last_rejected = 0
