"""Step-size control: initial step, error norm, acceptance and rejection.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (HNW), II.4 and II.5, and
their codes DOPRI5 and DOP853.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.output import NEAR_SINGULAR, may_step
from dap3d_core.integrators.stepping.rounding import update_rounding
from dap3d_core.integrators.stepping.vector_ops import scaled_largest
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import with_slopes

#: A step is never shorter than this part of the time or of the whole span, sixteen roundings.
EPSILON = 2.220446049250313e-16
FLOOR = 16.0 * EPSILON
LARGEST = 1.7976931348623157e308
#: Factor on a step that met a number that is not finite, or whose end could not be projected.
STEP_AFTER_FAILURE = 0.1
#: What completing a step gives besides a status: the step was cut.
STEP_CUT = -1
#: Factor on a step that ends near a singular state, and how often in a row that is tried.
STEP_AFTER_SINGULAR_END, SINGULAR_END_ATTEMPTS = 0.6, 4
#: A singular state this many such steps ahead is stepped across at once.
SINGULAR_END_REACH = 5.0
#: Values of ``calls_accepted``: the fourth function takes note of accepted states; it judges the
#: ends of steps as well. Factor on a step in which turns cannot be counted.
NOTES, JUDGES, STEP_FOR_TURNS = 1, 2, 0.5
#: What an accepted state is announced with, and the end of a step to be judged: one that the error
#: limits, or one of a given length.
FROM_START, FROM_END, OF_ERROR, OF_LENGTH = 1.0, 2.0, 0.0, -1.0
#: The work done may be off by so many times rtol, in steps that are no smaller part of the run.
WORK_SLACK, WORK_STEP = 100.0, 1e-3
#: The last step is stretched by at most this factor, to end at t_end.
STRETCH = 1.01


@compiled_into
def advance_by(
    step: Callable[..., None], state_at: Callable[[Any, float, Floats], None], work: Any,
    first: Floats, functions: Sequence[Function], system: Any, loops: Any, budget: int,
    sense: float,
) -> None:  # fmt: skip
    """Integrate by explicit steps until more than ``budget`` calls of rhs are spent, or it is over.

    step: tries one, given work, the functions rhs, project, accepted and watch, system and loops.
    state_at: as of ``may_step``. first: the rates that a step starts with. sense: as of
    ``count_turns``.
    """
    rhs, project, report = functions[0], functions[1], functions[2]
    watch = functions[4] if work.switch_count != 0 else rhs
    accepted = functions[3] if work.calls_accepted != 0 else rhs
    limit = work.rhs_count + budget
    while may_step(work, state_at, limit, project, report, system, loops):
        steps, rejected, h = work.step_count, work.rejected_count, work.h
        step(work, (rhs, project, accepted, watch), system, loops)
        update_rounding(work, first, h, rejected, rhs, system, loops)
        if work.calls_accepted != 0 and work.step_count > steps:
            count_turns(work, accepted, system, loops, sense)


@compiled
def first_step(work: Any, k: Floats, rhs: Function, system: Any, loops: Any) -> float:
    """Starting step of HNW II.4: an Euler step guesses the second derivative. One call of rhs."""
    size, rtol, tolerance = work.error_size, work.rtol, work.tolerance
    y, y1, f, f1 = work.state[at.Y], work.state[at.SCRATCH], k[0], k[1]  # y1: before and after, too
    t, t_end, floor = work.t, work.times[-1], step_floor(work)
    d0 = scaled_largest(y1, y, y, y, size, rtol, tolerance, 0.0)
    d1 = scaled_largest(y1, f, y, y, size, rtol, tolerance, 0.0)
    h = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    h = max(min(h, t_end - t), floor)
    for i in range(y.size):
        y1[i] = y[i] + h * f[i]
    work.rhs_count += 1
    rhs(min(t + h, t_end), y1, f1, system, loops)
    for i in range(y.size):
        f1[i] -= f[i]
    d2 = scaled_largest(y1, f1, y, y, size, rtol, tolerance, 0.0) / h
    if not d2 <= LARGEST:
        return h
    largest = max(d1, d2)
    h1 = max(1e-6, h * 1e-3)
    if largest > 1e-15:
        h1 = (0.01 / largest) ** (1.0 / work.order)
    return max(min(100.0 * h, h1, t_end - t), floor)


@compiled
def step_floor(work: Any) -> float:
    """The shortest step at t."""
    return FLOOR * max(abs(work.t), work.times[-1] - work.times[0])


@compiled
def end_of_step(work: Any) -> float:
    """The time at which the step that comes next ends."""
    t, t_end, fixed = work.t, work.times[-1], work.fixed_step
    if fixed == 0.0:
        h = with_slopes(min(work.h, work.longest_step), 0.0)  # chosen: not to be differentiated
        return t_end if t + STRETCH * h >= t_end else t + h
    target = t_end if work.has_dense_output != 0 else work.times[work.next_report]
    if work.segment_step == work.segment_step_count:
        work.segment_start = t
        work.segment_step = 0
        # a whole number of steps stays whole though its last digit is rounded
        work.segment_step_count = max(1, math.ceil((target - t) / fixed - 1e-9))
    done = work.segment_step + 1
    if done == work.segment_step_count:
        return target
    start = work.segment_start
    return start + (target - start) * (done / work.segment_step_count)


@compiled
def work_error(work: Any, h: float, error: float) -> float:
    """Scaled error of the work done in a long step, where that does not steer the step as the rest.

    Where the motion is prescribed it may be followed in a few long steps, over which the work is
    not; elsewhere the error of the motion is the larger one by far.
    """
    last = work.state.shape[1] - 1
    if work.error_size > last or h < WORK_STEP * (work.times[-1] - work.times[0]):
        return 0.0
    most = max(work.largest_work, abs(work.state[at.Y, last]), abs(work.state[at.TRIAL, last]))
    return abs(error) / (work.tolerance[at.ABSOLUTE, last] + WORK_SLACK * work.rtol * most)


@compiled
def combined_error(main: float, other: float) -> float:
    """One error from the estimates of order 5 and 3, as in DOP853."""
    total = main * main + 0.01 * other * other
    if total == 0.0:
        return 0.0
    return main * main / math.sqrt(total)


@compiled
def step_reduction(work: Any, error: float) -> float:
    """The factor on a step whose error was too large."""
    return max(work.factor_min, work.safety / error**work.exponent)


@compiled
def accept(work: Any, t1: float, error: float) -> None:
    """Make the trial state the state, and choose the next step (PI controller of HNW's codes)."""
    state, k, h, result = work.state, work.k, t1 - work.t, work.stage_count
    work.t = t1
    copy(state[at.Y], state[at.TRIAL])
    copy(k[0], k[result])
    work.step_count += 1
    if work.fixed_step != 0.0:
        work.segment_step += 1
        return
    divisor = error**work.exponent
    if work.beta != 0.0:
        divisor /= work.last_error**work.beta
    divisor /= work.safety
    factor = min(work.factor_max, max(work.factor_min, 1.0 / max(divisor, 1e-30)))
    if work.last_rejected != 0:
        factor = min(factor, 1.0)
    work.last_rejected = 0
    work.last_error = max(error, 1e-4)
    work.h = max(h * factor, step_floor(work))


@compiled
def reject(work: Any, t1: float, shorter: float, cause: int) -> None:
    """Try a shorter step again; at the floor, or where the step is fixed, stop for ``cause``."""
    work.rejected_count += 1
    work.last_rejected = 1
    work.h = shorter
    if work.fixed_step != 0.0 or shorter < step_floor(work):
        work.t_stop, work.status = t1, cause


@compiled
def lands_near_singularity(work: Any, t1: float) -> bool:
    """True if a step should end at another state: this one is close to a singular one.

    From there every next step would be inaccurate, while from some way before it one can step
    across. A run that stays close to a singular state is not held up: after a few attempts the
    landing is taken.
    """
    return (
        work.projection_outcome == NEAR_SINGULAR
        and work.near_singular_landings < SINGULAR_END_ATTEMPTS
        and t1 < work.times[-1]
    )


@compiled
def turns_are_certain(work: Any, t1: float, accepted: Function, system: Any, loops: Any) -> bool:
    """True if turns can be counted in a step to t1."""
    if work.calls_accepted != JUDGES:
        return True
    moved = work.projection_moved
    work.projection_moved = OF_ERROR if work.fixed_step == 0.0 else OF_LENGTH
    accepted(t1, work.state[at.TRIAL], work.real[at.PROJECTED :], system, loops)
    doubtful, work.projection_moved = work.projection_moved, moved
    return bool(doubtful == 0.0)


@compiled
def count_turns(
    work: Any, accepted: Function, system: Any, loops: Any, sense: float = FROM_START
) -> None:
    """Count turns up to the accepted state; sense: FROM_START or FROM_END.

    It says from which end of the step dense output continues coordinates: an angle that is one may
    be brought within two turns between them.
    """
    moved = work.projection_moved
    work.projection_moved = sense
    accepted(work.t, work.state[at.Y], work.real[at.PROJECTED :], system, loops)
    work.projection_moved = moved


@compiled
def judge_turns(work: Any, t1: float, accepted: Function, system: Any, loops: Any) -> int:
    """RUNNING, or STEP_CUT where a shorter step than that to t1 is tried, also a fixed one."""
    if turns_are_certain(work, t1, accepted, system, loops):
        return at.RUNNING
    h = STEP_FOR_TURNS * (t1 - work.t)
    if work.fixed_step == 0.0:
        reject(work, t1, h, at.STEP_FLOOR)
        return STEP_CUT
    work.rejected_count += 1
    work.step_limit_at_switch = h
    if h < step_floor(work):
        work.t_stop, work.status = t1, at.STEP_FLOOR
    return STEP_CUT
