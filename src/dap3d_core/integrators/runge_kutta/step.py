"""Explicit Runge-Kutta methods: a compiled loop that can be stopped and continued.

It knows a vector y and first-class functions ``f(t, y, out, system, loops)``:

    rhs      out = dy/dt
    project  moves y onto its constraints in place; on entry out[0] = 1 means that rhs was the last
             one called, at this very t and y. Then out[0] = 1 where y changed by more than the
             rounding of a normalisation, out[1] = 1 where that failed, 2 where the state is too
             close to a singular one to continue; out[4:] = singularity measures, which go through
             zero at a singular state (stepping/singular_poses.py)
    report   out = what else is reported at (t, y): accelerations, multipliers, ...
    accepted (only where turns are counted) takes note of an accepted state, or judges the step to
             one, by out[0] (step_control.py); out[0] = angles whose turns are not certain
    watch    (only where there are switches) gives their values (stepping/event_location.py)

Everything that decides what comes next is in the arrays of ``RungeKuttaState``: however a run is
cut into calls of ``advance``, its numbers are the same bit for bit. Source: Hairer, Norsett,
Wanner, Solving Ordinary Differential Equations I (HNW), II.4 to II.6.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import MODE_ENDS
from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.runge_kutta import sums
from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.stiffness import detect_stiffness
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping import singular_poses, step_control
from dap3d_core.integrators.stepping.event_location import (
    end_is_across,
    is_cut_at_sample,
    next_length,
    update_switches_after_step,
)
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.output import dense_state, needs_dense, project_state
from dap3d_core.integrators.stepping.rounding import record_failure
from dap3d_core.integrators.stepping.switch_values import evaluate, near_edge
from dap3d_core.integrators.stepping.vector_ops import all_finite, scaled_largest
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where, with_slopes

#: Near a singular state nothing is known better than to this part of the largest component.
POSITION_NOISE = 1e-11
#: Projection may move a result, or a stage, by this part of it, and no more: the error of what it
#: takes away shows no other branch.
MAX_PROJECTION = 1e-2
#: An error up to this may be rounding.
MAX_ROUNDING_ERROR = 100.0


@compiled
def advance(
    work: RungeKuttaState, functions: Sequence[Function], system: Any, loops: Any, budget: int
) -> None:
    """Integrate until more than ``budget`` calls of rhs are spent, the rows are full, or the end.

    At least one step is tried in each call, whatever the budget.
    """
    start = step_control.FROM_START
    step_control.advance_by(
        step, dense_state, work, work.k[0], functions, system, loops, budget, start
    )


@compiled
def step(work: RungeKuttaState, functions: Any, system: Any, loops: Any) -> None:
    """Try one step: accept it, reject it, or stop the run; functions as of ``finish_step``."""
    rhs, project, _, watch = functions
    if work.first_stage_valid == 0 and not find_first_stage(work, rhs, system, loops):
        return
    adaptive = work.fixed_step == 0.0
    if adaptive and work.h == 0.0:
        work.h = step_control.first_step(work, work.k, rhs, system, loops)
    end = t1 = step_control.end_of_step(work)
    longest = t1 - work.t
    h = longest
    if adaptive:
        h = min(h, with_slopes(singular_poses.limit_step_at_singularity(work, longest), 0.0))
    if work.switch_count != 0 or min(work.step_limit, work.t + work.step_limit_at_switch) < t1:
        h = min(h, next_length(work, t1, work.k[0], rhs, project, watch, system, loops))
        if h == 0.0:
            return
    if h < longest:
        t1 = work.t + h
    near = work.projects != 0 and singular_poses.is_near_singularity(work, longest)
    if not take_stages(work, t1, h, near, functions, system, loops):
        return
    error = step_error(work, t1, h, near, project, system, loops)
    finish_step(work, t1, h, longest, end, near, error, False, functions, system, loops)


@compiled
def step_error(
    work: RungeKuttaState,
    t1: float,
    h: float,
    near: bool,
    project: Function,
    system: Any,
    loops: Any,
) -> float:
    """Error of a step whose stages are known; up to 1.0 it is good enough."""
    if work.fixed_step != 0.0:
        return 0.0
    if near:
        error = projected_error_norm(work, t1, h, project, system, loops)
    else:
        error = sums.error_norm(work, h)
    if 1.0 < error <= step_control.LARGEST:
        error = error_above_rounding(work, near, h, error)
    return error


@compiled
def finish_step(
    work: RungeKuttaState,
    t1: float,
    h: float,
    longest: float,
    end: float,
    near: bool,
    error: float,
    has_rates: bool,
    functions: Any,
    system: Any,
    loops: Any,
) -> None:
    """Accept a step whose stages and error are known, reject it, or stop the run.

    has_rates: f at t1 and the trial state is known already, in the stage behind those of the step.
    """
    accepted = functions[2]
    if error <= 1.0:
        failure = complete_step(work, t1, near, has_rates, functions, system, loops)
        if failure == at.RUNNING:
            failure = step_control.judge_turns(work, t1, accepted, system, loops)
        if failure == step_control.STEP_CUT:
            return
        other = 0.0
        if failure == at.RUNNING and work.fixed_step == 0.0 and not near:
            other = step_elsewhere(work, t1, h)
        if other > 0.0:
            work.near_singular_landings += 1
            step_control.reject(work, t1, other, at.STEP_FLOOR)
        elif failure == at.RUNNING:
            work.near_singular_landings = 0
            if singular_poses.time_to_singularity(work, h) < h:
                work.error_across_singularity = 0.0
            singular_poses.update_measures(work, h)
            step_control.accept(work, t1, error)
            update_switches_after_step(work, h, longest, end)
        else:
            step_control.reject(work, t1, h * step_control.STEP_AFTER_FAILURE, failure)
    elif error <= step_control.LARGEST:
        record_failure(work, error, h, work.last_rejected != 0)
        step_control.reject(work, t1, h * step_control.step_reduction(work, error), at.STEP_FLOOR)
    else:
        step_control.reject(work, t1, h * step_control.STEP_AFTER_FAILURE, at.NOT_FINITE)


@compiled
def step_elsewhere(work: RungeKuttaState, t1: float, h: float) -> float:
    """Length of a better step than that to t1, which ends close to a singular state; 0 if none is.

    Stages on the constraints allow a step across that is several times as long: it is tried where
    errors bring the motion close to the state in steps too short to be placed about it. Behind the
    state, or while it is out of reach, there is none.
    """
    if not (step_control.lands_near_singularity(work, t1) and singular_poses.is_approaching(work)):
        return 0.0
    singular_poses.predict_measures(work, h)
    if singular_poses.limit_step_at_singularity(work, h) < h:
        return h
    left = singular_poses.time_to_singularity(work, work.times[-1] - work.t)
    if left < step_control.SINGULAR_END_REACH * h:
        return left / work.widest_gap_abscissa
    return 0.0 if left < np.inf else h * step_control.STEP_AFTER_SINGULAR_END


@compiled
def find_first_stage(work: RungeKuttaState, rhs: Function, system: Any, loops: Any) -> bool:
    """Evaluate f at the state; False where it is not finite, which ends the run."""
    work.rhs_count += 1
    rhs(work.t, work.state[at.Y], work.k[0], system, loops)
    work.first_stage_valid = 1
    if all_finite(work.k[0]):
        return True
    work.t_stop, work.status = work.t, at.NOT_FINITE
    return False


@compiled
def error_above_rounding(work: RungeKuttaState, near: bool, h: float, error: float) -> float:
    """The error of a step that is too large, without what a shorter step could not reduce."""
    if near:
        return 1.0 if is_rounding(work, h, error) else error
    if h * step_control.step_reduction(work, error) < step_control.step_floor(work):
        return min(error, sums.error_beyond_rounding(work, h))
    return error


@compiled
def take_stages(
    work: RungeKuttaState, t1: float, h: float, near: bool, functions: Any, system: Any, loops: Any
) -> bool:
    """Stages and trial state of a step to t1; each on the constraints if ``near``.

    False where one of them lies beyond a switch, or at a singular state: then the step is cut.
    """
    stages, table, k = work.stage_count, work.table, work.k
    last = stages if work.error_uses_last_stage != 0 else stages - 1
    for i in range(1, stages + 1):
        x = work.state[at.TRIAL] if i == stages else work.state[at.SCRATCH]
        sums.combine(x, 1.0, work.state[at.Y], h, table, i, k)
        if i <= last:
            c = table[i, sums.ABSCISSA]
            t = t1 if c == 1.0 else work.t + c * h
            if not evaluate_stage(work, i, t, x, t1, near, functions, system, loops):
                return False
            work.rhs_count += 1
    return True


@compiled
def evaluate_stage(
    work: RungeKuttaState, i: int, t: float, x: Floats, t1: float, near: bool, functions: Any,
    system: Any, loops: Any,
) -> bool:  # fmt: skip
    """Rates of stage i, at t and the state x, of a step to t1; False as for ``take_stages``."""
    rhs, project, _, watch = functions
    if near:
        project_stage(work, t, x, project, system, loops)
        x = work.state[at.SCRATCH]
        if cut_at_stage(work, t, t1):
            return False
    if work.switch_count != 0 and is_stage_across(work, t, t1, x, project, watch, system, loops):
        return False
    rhs(t, x, work.k[i], system, loops)
    return True


@compiled
def cut_at_stage(work: RungeKuttaState, t: float, t1: float) -> bool:
    """Cut a step to t1, near a singular state, whose projected stage at t is of no use; whether so.

    Projection of what is far from the constraints may lead to any branch. A stage at the singular
    state has rates that are not known, and tells where that is: the step is placed about it. The
    first step of a run from a singular state is not cut: longer ones are the better ones there.
    """
    if singular_poses.is_at_singularity(work):
        return False
    if work.fixed_step != 0.0:
        return False
    h, jump = t1 - work.t, projection_jump(work, work.state[at.OTHER], work.state[at.SCRATCH])
    if not jump <= 1.0:
        step_control.reject(
            work, t1, h * max(work.factor_min, work.safety / math.sqrt(jump)), at.STEP_FLOOR
        )
        return True
    has_choice = t1 + step_control.step_floor(work) < work.step_limit
    if work.near_singular_landings >= step_control.SINGULAR_END_ATTEMPTS or not has_choice:
        return False
    if not singular_poses.record_singularity(work, t - work.t):
        return False
    work.near_singular_landings += 1
    step_control.reject(work, t1, h, at.STEP_FLOOR)
    return True


@compiled
def projection_jump(work: RungeKuttaState, before: Floats, after: Floats) -> float:
    """The change of a state by projection, in parts of what it may be in a step."""
    y, jump = work.state[at.Y], 0.0
    for i in range(work.error_size):
        largest = MAX_PROJECTION * (1.0 + max(abs(y[i]), abs(after[i])))
        ratio = abs(after[i] - before[i]) / largest
        jump = where((ratio > jump) | (ratio != ratio), ratio, jump)
    return jump


@compiled
def project_stage(
    work: RungeKuttaState, t: float, x: Floats, project: Function, system: Any, loops: Any
) -> None:
    """Project the state x of a stage into the scratch row (x may be that); as it was: OTHER."""
    argument = work.state[at.SCRATCH]
    copy(work.state[at.OTHER], x)
    copy(argument, work.state[at.OTHER])  # which x may be
    project_state(work, t, argument, project, system, loops)


@compiled
def is_stage_across(
    work: RungeKuttaState, t: float, t1: float, x: Floats, project: Function, watch: Function,
    system: Any, loops: Any,
) -> bool:  # fmt: skip
    """As ``is_sample_across``; where a mode ends at x, it does on the constraints, too.

    A stage is off them by its error: so slips what joints and contacts hold together, by more than
    the slip that ends such a mode, in steps of nearly any length.
    """
    if work.sampled_switch_count == 0:
        return False
    s, ends = work.switches, 0
    evaluate(work, t, x, at.SAMPLE, watch, system, loops)
    for k in range(s.shape[1]):
        ends |= (s[at.DOES, k] == MODE_ENDS) & (s[at.SIDE, k] * s[at.SAMPLE, k] < 0.0)
    if ends != 0:
        project_stage(work, t, x, project, system, loops)
        evaluate(work, t, work.state[at.SCRATCH], at.FOUND, watch, system, loops)
        copy(x, work.state[at.OTHER])
        for k in range(s.shape[1]):
            if s[at.DOES, k] == MODE_ENDS and s[at.SIDE, k] * s[at.FOUND, k] > near_edge(s, k):
                s[at.SAMPLE, k] = s[at.FOUND, k]
    return is_cut_at_sample(work, t, t1 - work.t)


@compiled
def projected_error_norm(
    work: RungeKuttaState, t1: float, h: float, project: Function, system: Any, loops: Any
) -> float:
    """As ``error_norm``, of the projected result.

    Near a singular state errors are large in a direction that projection takes away, up to rounding
    over the square of the distance: errors below POSITION_NOISE do not count.
    """
    table, k = work.table, work.k
    y, trial, result, other = (work.state[at.Y], work.state[at.TRIAL], work.state[at.SCRATCH],
                               work.state[at.OTHER])  # fmt: skip
    project_stage(work, t1, trial, project, system, loops)
    jump = projection_jump(work, trial, result)
    if not jump <= 1.0:
        return jump
    least, main = 0.0, 0.0
    for i in range(work.error_size):
        least = max(least, POSITION_NOISE * abs(y[i]))
    for e in range(work.estimate_count):
        sums.combine(other, 1.0, trial, -h, table, k.shape[0] + e, k)
        project_state(work, t1, other, project, system, loops)
        for i in range(other.size):
            other[i] -= result[i]
        size = scaled_largest(work.state[at.GIVEN], other, y, result, work.error_size, work.rtol,
                              work.tolerance, h, least)  # fmt: skip
        main = size if e == 0 else step_control.combined_error(main, size)
    return main


@compiled
def is_rounding(work: RungeKuttaState, h: float, error: float) -> bool:
    """True if the error of a step across a singular state is rounding: a shorter one had no less.

    It is mostly in the direction that projection takes away from there on.
    """
    if not (singular_poses.time_to_singularity(work, h) < h and error < MAX_ROUNDING_ERROR):
        return False
    before, work.error_across_singularity = work.error_across_singularity, error
    return before > 0.0 and error > 0.25 * before


@compiled
def complete_step(
    work: RungeKuttaState,
    t1: float,
    near: bool,
    has_rates: bool,
    functions: Any,
    system: Any,
    loops: Any,
) -> int:
    """Prepare dense output, evaluate f, project the trial state; the failure, or RUNNING.

    Dense output belongs to the step as the method took it; what it gives is projected separately.
    f is evaluated before the projection, which then has less to do. Where that moves the state by
    no more than the step's error may be, the next step starts with the value all the same.
    has_rates: as of ``finish_step``.
    """
    times, k = work.times, work.k
    rhs, project, _, watch = functions
    trial, result = work.state[at.TRIAL], work.stage_count
    known, watched = work.error_uses_last_stage != 0, work.switch_count != 0
    here, controlled = known and not near, work.fixed_step == 0.0 and not near
    if needs_dense(work, t1):
        if not known:
            work.rhs_count += 1
            if not has_rates:
                rhs(t1, trial, k[result], system, loops)
            known = True
        if not take_dense_stages(work, t1, near, functions, system, loops):
            return step_control.STEP_CUT
        work.rhs_count += k.shape[0] - 1 - result
        here = here and k.shape[0] == result + 1
        prepare_dense(work, t1)
    if controlled and not known and t1 < times[-1]:
        work.rhs_count += 1
        if not has_rates:
            rhs(t1, trial, k[result], system, loops)
        known = here = True
    if controlled and known:
        detect_stiffness(work, t1 - work.t)
    copy(work.state[at.OTHER], trial)
    failure = project_state(work, t1, trial, project, system, loops, here)
    if failure != at.RUNNING:
        return failure
    if known and work.projection_moved != 0.0:
        known = controlled and is_within_error(work)
    if watched:  # before f, which is known where multipliers have been found for switches
        evaluate(work, t1, trial, at.FOUND, watch, system, loops)
    if not known and (watched or t1 < times[-1]):
        work.rhs_count += 1
        rhs(t1, trial, k[result], system, loops)
        known = True
    if known and not all_finite(k[result]):
        return at.NOT_FINITE
    if watched and end_is_across(work, t1, k[result], project, watch, system, loops):
        return step_control.STEP_CUT
    work.first_stage_valid = 1 if known else 0
    return at.RUNNING


@compiled
def take_dense_stages(
    work: RungeKuttaState, t1: float, near: bool, functions: Any, system: Any, loops: Any
) -> bool:
    """The further stages that dense output needs; False as for ``take_stages``."""
    t, argument, table, k = work.t, work.state[at.SCRATCH], work.table, work.k
    for i in range(work.stage_count + 1, k.shape[0]):
        instant = t + table[i, sums.ABSCISSA] * (t1 - t)
        sums.combine(argument, 1.0, work.state[at.Y], t1 - t, table, i, k)
        if not evaluate_stage(work, i, instant, argument, t1, near, functions, system, loops):
            return False
    return True


@compiled
def is_within_error(work: RungeKuttaState) -> bool:
    """True if the trial state differs from the other one by no more than a step may err."""
    y, trial, other = work.state[at.Y], work.state[at.TRIAL], work.state[at.OTHER]
    ratios = work.state[at.SCRATCH]
    for i in range(other.size):
        other[i] -= trial[i]
    size = work.error_size
    return scaled_largest(ratios, other, y, trial, size, work.rtol, work.tolerance, 0.0) <= 1.0


@compiled
def prepare_dense(work: RungeKuttaState, t1: float) -> None:
    """Terms of the dense output from t to t1, HNW II.6, from all stages."""
    state, k, terms = work.state, work.k, work.terms
    h, result = t1 - work.t, work.stage_count
    for i in range(state.shape[1]):
        rise = state[at.TRIAL, i] - state[at.Y, i]
        terms[0, i] = state[at.Y, i]
        terms[1, i] = rise
        terms[2, i] = h * k[0, i] - rise
        terms[3, i] = rise - h * k[result, i] - terms[2, i]
    first = k.shape[0] + work.estimate_count
    for row in range(4, terms.shape[0]):
        sums.combine(terms[row], 0.0, state[at.Y], h, work.table, first + row - 4, k)
    work.t_dense, work.h_dense = work.t, h
