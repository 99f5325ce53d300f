"""Radau IIA on the stabilised equations of index 2: a compiled loop that can stop.

It works as runge_kutta/step.py does, chunk by chunk, with the same functions and the same arrays;
what it knows of mechanics is in formulations/stabilized_index2/stage_equations.py and tangent.py.
Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.8, VII.4, and their code
RADAU.
"""

import math
from collections.abc import Sequence
from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.assembly.evaluate import copy
from dap3d_core.formulations.common.constraints import slide_sharing
from dap3d_core.formulations.stabilized_index2.jacobian import BENT, MAY_BEND, Tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import StageMatrix
from dap3d_core.integrators.radau.convergence import is_at_rounding
from dap3d_core.integrators.radau.dense_output import dense_state, prepare_dense
from dap3d_core.integrators.radau.error import bound_stage_noise
from dap3d_core.integrators.radau.newton import SAME_STEP, method_index, most_iterations, predict
from dap3d_core.integrators.radau.order import change_order, lower_order, raise_order
from dap3d_core.integrators.radau.state import OLD, OLD_SLOPE, SLOPE, TRIAL_SLOPE, Given, RadauState
from dap3d_core.integrators.radau.tableau import FEWEST
from dap3d_core.integrators.stepping import event_location, step_control
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.output import may_step, needs_dense, project_state
from dap3d_core.integrators.stepping.rounding import can_measure, record_failure
from dap3d_core.integrators.stepping.switch_values import evaluate
from dap3d_core.integrators.stepping.vector_ops import all_finite
from dap3d_core.kernels.runtime.cache import compiled

#: Of the steps of RADAU5.
SAFETY = 0.9
#: A step is not longer than this many of the one before, and not shorter than this part of it.
GROWTH, SHRINKAGE = 8.0, 0.2
#: The tangent is kept where the iteration converged faster than this; the step, and with it the
#: factors, where the next one would be up to this factor longer.
GOOD_TANGENT, SAME_FACTORS = 1e-3, 1.2
#: An iteration that converges slower than this is not gone on with.
HOPELESS = 0.9
#: Where the step is limited by the iteration its rate is about proportional to h^3. At this rate
#: iterations for a second of motion are fewest.
BEST_RATE, RATE_EXPONENT = 0.3, 1.0 / 6.0


@compiled
def advance(
    work: RadauState,
    functions: Sequence[Function],
    parts: Sequence[Any],
    tangents: Sequence[Any],
    system: System,
    loops: Any,
    tangent: Tangent,
    matrix: StageMatrix,
    budget: int,
) -> None:
    """Integrate until more than ``budget`` stages are evaluated, the rows are full, or the end."""
    given = system, loops, tangent, matrix
    rhs, project, report = functions[0], functions[1], functions[2]
    watch = functions[4] if work.switch_count != 0 else rhs
    accepted = functions[3] if work.calls_accepted != 0 else rhs
    limit = work.rhs_count + budget
    while may_step(work, dense_state, limit, project, report, system, loops, True):
        steps, rejected = work.step_count, work.rejected_count
        if work.first_stage_valid == 0:
            tangent.bends[0] = 0.0
            start(work, rhs, project, system, loops)
        else:
            step(work, parts, tangents, (rhs, project, accepted, watch), given)
            h = work.factored_step
            if work.rounding_state != 0 and h > 0.0 and can_measure(work, rejected):
                measure = parts[4]
                measure(work.t, h, work, given)
                bound_stage_noise(h, work, rhs, system, loops)
        if work.calls_accepted != 0 and work.step_count > steps:
            step_control.count_turns(work, accepted, system, loops)


@compiled
def start(work: RadauState, rhs: Function, project: Function, system: System, loops: Any) -> None:
    """Project the state where a motion starts, and compute its rates and multipliers."""
    y = work.state[at.Y]
    failure = project_state(work, work.t, y, project, system, loops)
    if failure == at.RUNNING:
        work.rhs_count += 1
        rhs(work.t, y, work.k[0], system, loops)
        if not all_finite(work.k[0]):
            failure = at.NOT_FINITE
    if failure != at.RUNNING:
        work.t_stop, work.status = work.t, failure
        return
    change_order(work, FEWEST)
    work.last_stages = FEWEST
    keep_multipliers(work, system)
    copy(work.state[SLOPE], work.k[0])
    work.first_stage_valid = work.tangent_needed = 1
    work.has_last_step = 0
    work.convergence_factor = 1.0
    if work.fixed_step == 0.0 and work.h == 0.0:
        work.h = step_control.first_step(work, work.k, rhs, system, loops)


@compiled
def keep_multipliers(work: RadauState, system: System) -> None:
    """Let multipliers of the rates at the state be those that the next step begins with."""
    for k in range(work.last_multipliers.shape[2]):
        work.last_multipliers[work.last_stages - 1, 1, k] = -system.multipliers[k]


@compiled
def step(
    work: RadauState, parts: Sequence[Any], tangents: Sequence[Any], functions: Any, given: Given
) -> None:
    """Try one step: accept, reject or stop; functions: rhs, project, accepted, watch."""
    system, loops, _tangent, _matrix = given
    rhs, project, accepted, watch = functions
    estimate_error, find_slope, find_work = parts[2], parts[3], parts[5]
    state, adaptive, t = work.state, work.fixed_step == 0.0, work.t
    end = t1 = step_control.end_of_step(work)
    longest = h = t1 - t
    if work.switch_count != 0 or min(work.step_limit, t + work.step_limit_at_switch) < t1:
        h = event_location.next_length(work, t1, state[SLOPE], rhs, project, watch, system, loops)
        if h == 0.0:
            return
        t1 = t1 if h == longest else t + h
    shorter = search(t, h, work, parts, tangents, given)
    if shorter != 0.0:
        reject_iteration(work, t1, h, shorter)
        return
    if work.switch_count != 0 and stage_is_across(work, t, h, watch, system, loops):
        return
    for k in range(state.shape[1]):
        state[at.TRIAL, k] = state[at.Y, k] + work.Z[work.stages - 1, k]
    error = estimate_error(t, h, work, given) if adaptive else 0.0
    if error < 1.0:
        find_work(t, h, work, given)
        failure = project_state(work, t1, state[at.TRIAL], project, system, loops)
        if failure == at.RUNNING:
            find_slope(t, h, work, given)
            failure = complete_step(work, t1, h, project, watch, system, loops)
        if failure == at.RUNNING:
            failure = step_control.judge_turns(work, t1, accepted, system, loops)
        if failure == step_control.STEP_CUT:
            return
        if failure == at.RUNNING and adaptive and step_control.lands_near_singularity(work, t1):
            work.near_singular_landings += 1
            step_control.reject(work, t1, h * step_control.STEP_AFTER_SINGULAR_END, at.STEP_FLOOR)
        elif failure == at.RUNNING:
            work.near_singular_landings = 0
            accept(work, t1, h, error)
            if slide_sharing(system):  # no iteration corrects the share, and rounding of it grows
                work.rhs_count += 1
                rhs(t1, state[at.Y], work.k[0], system, loops)
                keep_multipliers(work, system)
            event_location.update_switches_after_step(work, h, longest, end)
        else:
            step_control.reject(work, t1, h * step_control.STEP_AFTER_FAILURE, failure)
    elif error <= step_control.LARGEST:
        reject_error(work, t1, h, error)
    else:
        step_control.reject(work, t1, h * step_control.STEP_AFTER_FAILURE, at.NOT_FINITE)


@compiled
def stage_is_across(
    work: RadauState, t: float, h: float, watch: Function, system: System, loops: Any
) -> bool:
    """True if an inner stage lies beyond a switch; then the step is cut."""
    x, c = work.state[at.SCRATCH], work.method.c[method_index(work.stages)]
    for i in range(work.stages - 1):
        for k in range(x.shape[0]):
            x[k] = work.state[at.Y, k] + work.Z[i, k]
        if event_location.is_sample_across(work, t + c[i] * h, h, x, watch, system, loops):
            return True
    return False


@compiled
def search(t: float, h: float, work: RadauState, parts: Any, tangents: Any, given: Given) -> float:
    """Predict and find the stages of a step h, by up to three attempts; as find_stages."""
    system, _loops, tangent, _matrix = given
    predict(h, work, True, system)
    shorter = iterate(t, h, work, parts, tangents, given)
    if shorter > 0.0 and work.convergence_rate < HOPELESS:  # once more, with the tangent at the end
        work.tangent_needed = 1
        shorter = iterate(t, h, work, parts, tangents, given)
    if shorter > 0.0 and tangent.bends[0] == BENT:  # the prediction may lie beyond the bend
        predict(h, work, False, system)
        work.tangent_needed = 1
        shorter = iterate(t, h, work, parts, tangents, given)
    if shorter != 0.0 and work.tangent_is_current != 0:
        tangent.bends[0] = max(tangent.bends[0], MAY_BEND)
    return shorter


@compiled
def iterate(t: float, h: float, work: RadauState, parts: Any, tangents: Any, given: Given) -> float:
    """Find the stages from their present values, with a new tangent if needed; as find_stages."""
    factorise_both, find_stages, find_tangent = parts[0], parts[1], tangents[0]
    wrong = 0.0
    if work.tangent_needed != 0:
        work.tangent_step = h
        find_tangent(work, given)
        wrong = 0.0 if work.tangent_is_current != 0 else math.nan
    if wrong == 0.0 and not abs(h - work.factored_step) <= SAME_STEP * h:
        wrong = factorise_both(t, h, work, given)
    if wrong == 0.0:
        wrong = find_stages(t, h, work, given)
    return wrong


@compiled
def reject_iteration(work: RadauState, t1: float, h: float, shorter: float) -> None:
    """Shorten a step whose stages were not found; a fixed one is tried with a new tangent first."""
    stale = work.tangent_is_current == 0
    work.tangent_needed = 1
    if not shorter > 0.0:  # NaN
        step_control.reject(work, t1, h * step_control.STEP_AFTER_FAILURE, at.NOT_FINITE)
    elif work.fixed_step == 0.0 or not stale:
        if not is_at_rounding(work.state_change, work.newton_limit, work):
            record_failure(work, work.state_change, h, work.last_rejected != 0)
        blame(work, h)
        again = work.last_rejected
        step_control.reject(work, t1, h * shorter, at.STEP_FLOOR)
        if work.status == at.RUNNING and lower_order(work, again) and work.regularisation != 0.0:
            # off the constraints dependent rows hold the motion, and their multipliers are no start
            work.first_stage_valid, work.h = 0, 0.0


@compiled
def reject_error(work: RadauState, t1: float, h: float, error: float) -> None:
    """Shorten a step whose error is too large."""
    record_failure(work, error, h, work.last_rejected != 0)
    work.error_refusals += 1
    factor = max(SHRINKAGE, safety_factor(work) / error ** (1.0 / (work.stages + 1)))
    lower_order(work, work.last_rejected)
    step_control.reject(work, t1, h * factor, at.STEP_FLOOR)
    if work.has_last_step == 0:
        work.h = min(work.h, 0.1 * h)
    work.tangent_needed = max(work.tangent_needed, 1 - work.tangent_is_current)


@compiled
def blame(work: RadauState, h: float) -> None:
    """Count a step whose stages were not found, and the component that changed most at the last."""
    if work.factored_step != h:
        work.singular_refusals += 1
        return
    work.iteration_refusals += 1
    worst, largest = 0, -1.0
    for i in range(work.stages):
        for k in range(work.error_size):
            scale = work.tolerance[at.ABSOLUTE, k] + work.rtol * abs(work.state[at.Y, k])
            size = abs(work.R[i, k]) / scale
            if size > largest:
                worst, largest = k, size
    work.blamed[worst] += 1.0


@compiled
def safety_factor(work: RadauState) -> float:
    """Safety factor of the next step: smaller where the iteration took long (HW IV.8)."""
    most = 2.0 * most_iterations(work.stages)
    return min(SAFETY, SAFETY * (1.0 + most) / (work.last_iterations + most))


@compiled
def complete_step(
    work: RadauState, t1: float, h: float, project: Function, watch: Function, system: System,
    loops: Any,
) -> int:  # fmt: skip
    """Prepare dense output where a reporting time lies in the step; the failure, or RUNNING."""
    slope = work.state[TRIAL_SLOPE]
    if not all_finite(slope):
        return at.NOT_FINITE
    if work.switch_count != 0:
        evaluate(work, t1, work.state[at.TRIAL], at.FOUND, watch, system, loops)
        if event_location.end_is_across(work, t1, slope, project, watch, system, loops):
            return step_control.STEP_CUT
    if needs_dense(work, t1):
        prepare_dense(h, work)
    return at.RUNNING


@compiled
def accept(work: RadauState, t1: float, h: float, error: float) -> None:
    """Make the trial state the state; choose the next step (Gustafsson's control, HW IV.8)."""
    state = work.state
    for k in range(state.shape[1]):
        state[OLD, k], state[at.Y, k] = state[at.Y, k], state[at.TRIAL, k]
        state[OLD_SLOPE, k], state[SLOPE, k] = state[SLOPE, k], state[TRIAL_SLOPE, k]
        for i in range(work.stages):
            work.Z_old[i, k] = work.Z[i, k]
    for i in range(work.stages):
        for r in range(2):
            copy(work.last_multipliers[i, r], work.multipliers[i, r])
    work.last_stages = work.stages
    work.step_count += 1
    work.tangent_is_current = 0
    good = work.convergence_rate <= GOOD_TANGENT
    if work.fixed_step != 0.0:
        work.segment_step += 1
    else:
        choose_next(work, h, error, good)
    if not good:
        work.tangent_needed = 1
    work.t, work.accepted_step = t1, h
    if work.fixed_step == 0.0:
        raise_order(work)
    work.has_last_step, work.last_rejected = 1, 0


@compiled
def choose_next(work: RadauState, h: float, error: float, good: bool) -> None:
    """The next step, after an accepted one."""
    exponent = 1.0 / (work.stages + 1)
    divisor = error**exponent / safety_factor(work)
    if work.has_last_step != 0 and work.steps_at_order > 0:
        trend = (error * error / work.accepted_error) ** exponent
        divisor = max(divisor, work.accepted_step / h * trend / SAFETY)
    if work.last_iterations > 1:
        divisor = max(divisor, (work.convergence_rate / BEST_RATE) ** RATE_EXPONENT)
    factor = 1.0 / min(1.0 / SHRINKAGE, max(1.0 / GROWTH, divisor))
    if work.last_rejected != 0:
        factor = min(factor, 1.0)
    work.accepted_error = max(error, 0.01)
    if not (good and 1.0 <= factor <= SAME_FACTORS):
        work.h = max(h * factor, step_control.step_floor(work))
    else:
        work.h = h
