"""The values of switches and their rates at a state; on which side of each the motion is."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import ENDS, JUMPS, MODE_ENDS, SEAM, UNSEEN
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function, IntegrationState
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Part of a usual step over which rates are found by differences, and the least part of the time.
DIFFERENCE, LEAST_DIFFERENCE = 1e-4, 1e-8
#: Part of the change over such a difference that a switch may be from zero where it has crossed it.
JUMPED = 0.01
#: Part of a rate, towards the end of a mode, that is left on the constraints where it was wrong.
OFF = 0.5
#: Bands from a seam, and in a usual step, within which motion follows it.
ALONG = 1e6


@compiled
def evaluate(
    work: IntegrationState, t: float, x: Floats, row: int, watch: Function, system: Any, loops: Any
) -> None:
    """The switches at a state, into a row.

    One with a band counts from the far edge of it: what rests where it is zero, to rounding, does
    not change its side again and again.
    """
    watch(t, x, work.switches[row], system, loops)
    count_from_far_edges(work.switches, row)


@compiled
def count_from_far_edges(s: Floats, row: int) -> None:
    """Values of a row as ``evaluate`` gives them, from those of the switches."""
    for k in range(s.shape[1]):
        s[row, k] += s[at.SIDE, k] * s[at.BAND, k]


@compiled
def may_rest(s: Floats, k: int) -> bool:
    """True if switch k may be at rest where it is zero: it is in its band, or as near to it."""
    return s[at.SIDE, k] * s[at.VALUE, k] < 2.0 * s[at.BAND, k]


@compiled
def near_edge(s: Floats, k: int) -> float:
    """The value of switch k, times its side, at which samples of a step reach the other law.

    The near edge of its band, unless it may be at rest in it. Where it is UNSEEN both laws are one.
    """
    return 0.0 if may_rest(s, k) or s[at.DOES, k] == UNSEEN else s[at.BAND, k]


@compiled
def is_along_seam(work: IntegrationState, k: int) -> bool:
    """True if switch k is a seam that the motion follows: on which side it is would be rounding."""
    s = work.switches
    near = abs(s[at.VALUE, k]) + abs(s[at.RATE, k]) * usual_step(work)
    return s[at.DOES, k] == SEAM and near < ALONG * s[at.BAND, k]


@compiled
def evaluate_start(
    work: IntegrationState,
    slope: Floats,
    project: Function,
    watch: Function,
    system: Any,
    loops: Any,
) -> None:
    """Values, sides and rates at the state; the run ends where it should have ended before."""
    s = work.switches
    y = work.state[at.Y]
    evaluate(work, work.t, y, at.VALUE, watch, system, loops)
    for k in range(s.shape[1]):
        if s[at.SIDE, k] == 0.0:
            s[at.SIDE, k] = np.sign(s[at.VALUE, k])
            s[at.VALUE, k] += s[at.SIDE, k] * s[at.BAND, k]
        s[at.BEND, k] = 0.0
        if s[at.DOES, k] == ENDS and s[at.SIDE, k] < 0.0:
            work.end_status, work.terminal_switch = at.SWITCHED, k
            record_crossing(work, k, work.t)
    rows = at.VALUE, at.RATE
    find_switch_rates(work, work.t, y, slope, rows, project, watch, system, loops)
    work.switch_rates_valid = 1


@compiled
def find_switch_rates(
    work: IntegrationState, t: float, y: Floats, slope: Floats, rows: tuple[int, int],
    project: Function, watch: Function, system: Any, loops: Any,
) -> None:  # fmt: skip
    """Rates of the switches along the slope, by a difference.

    rows: of their values at y; of their rates.
    """
    (row, out), h, x, s = rows, rate_difference(work), work.state[at.OTHER], work.switches
    for i in range(y.shape[0]):
        x[i] = y[i] + h * slope[i]
    evaluate(work, t + h, x, out, watch, system, loops)
    soon, usual = 0, usual_step(work)
    for k in range(s.shape[1]):
        s[out, k] = (s[out, k] - s[row, k]) / h
        ahead = s[at.SIDE, k] * (s[row, k] + usual * s[out, k])
        soon |= (s[at.DOES, k] == MODE_ENDS) & (ahead < 0.0)
    if soon != 0 and work.projects != 0:
        correct_rates(work, t + h, x, h, rows, project, watch, system, loops)


@compiled
def correct_rates(
    work: IntegrationState, t: float, x: Floats, h: float, rows: tuple[int, int],
    project: Function, watch: Function, system: Any, loops: Any,
) -> None:  # fmt: skip
    """Rates of what ends modes, found over a time h to a state x that is off its constraints.

    That is so by the square of h. What joints and contacts hold together slips by it, more than
    ends such a mode. Other rates keep what they are to rounding, which projection adds to.
    """
    s, (row, out), outcome = work.switches, rows, work.limits[at.LIMITS_END :]
    outcome[0] = outcome[1] = 0.0
    work.projection_count += 1
    project(t, x, outcome, system, loops)
    evaluate(work, t, x, at.SAMPLE, watch, system, loops)
    for k in range(s.shape[1]):
        rate, side = (s[at.SAMPLE, k] - s[row, k]) / h, s[at.SIDE, k]
        if s[at.DOES, k] == MODE_ENDS and side * rate > OFF * side * s[out, k]:
            s[out, k] = rate


@compiled
def rate_difference(work: IntegrationState) -> float:
    """The time, s, over which rates are found by differences."""
    return max(DIFFERENCE * usual_step(work), LEAST_DIFFERENCE * time_span(work))


@compiled
def is_across(s: Floats, row: int) -> bool:
    """True if a switch, in a row of values, is on another side than at the start of the step."""
    found = 0
    for k in range(s.shape[1]):
        found |= s[row, k] * s[at.SIDE, k] < 0.0
    return found != 0


@compiled
def first_across(s: Floats) -> int:
    """The first switch that lies across; -1 where none does."""
    for k in range(s.shape[1]):
        if s[at.FOUND, k] * s[at.SIDE, k] < 0.0:
            return k
    return -1


@compiled
def changes_sign(s: Floats, row: int) -> bool:
    """True if a switch is on another side, or zero: then it is not known which law holds."""
    found = 0
    for k in range(s.shape[1]):
        found |= (s[at.SIDE, k] != 0.0) & (s[row, k] * s[at.SIDE, k] <= near_edge(s, k))
    return found != 0


@compiled
def has_jumped(work: IntegrationState) -> bool:
    """True if the switch that was crossed last jumped there, by its rate beside: no zero of it is.

    Its instant has derivatives of another kind then, which are NaN here (study/sensitivities).
    """
    s, k = work.switches, first_across(work.switches)
    if k < 0:
        return False
    return abs(s[at.FOUND, k]) > JUMPED * abs(s[at.FOUND_RATE, k]) * rate_difference(work)


@compiled
def record_crossing(work: IntegrationState, k: int, t: float) -> None:
    """Record that a switch changed its sign, unless it is unseen, or velocities jump there."""
    if work.switches[at.DOES, k] <= UNSEEN or work.switches[at.DOES, k] >= JUMPS:
        return
    count = work.crossing_count
    if count < at.LOGGED:
        row = work.crossings[count]
        row[0], row[1], row[2] = t, k, work.switches[at.SIDE, k]
    work.crossing_count = count + 1


@compiled
def time_span(work: IntegrationState) -> float:
    """The time, s, with the rounding that bounds what can be distinguished."""
    return max(abs(work.t), work.times[-1] - work.times[0])


@compiled
def usual_step(work: IntegrationState) -> float:
    """The step without switches."""
    return work.fixed_step if work.fixed_step != 0.0 else max(work.h, work.uncut_step)
