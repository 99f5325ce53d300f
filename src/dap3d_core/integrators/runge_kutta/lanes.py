"""Steps of several runs at once: their stages are taken together, one run in each lane.

Each run has its own state, time, step, error control and output, as alone, and calls of the
right-hand side beside those of stages are its own (step.py): its numbers are the same bit for bit.
A step near a singular pose is taken as that of a run alone.
"""

from typing import Any

import attrs

from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.step import find_first_stage, finish_step, step, step_error
from dap3d_core.integrators.runge_kutta.sums import ABSCISSA, combine
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.event_location import is_cut_at_sample, next_length
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.output import dense_state, may_step
from dap3d_core.integrators.stepping.rounding import update_rounding
from dap3d_core.integrators.stepping.singular_poses import (
    is_near_singularity,
    limit_step_at_singularity,
)
from dap3d_core.integrators.stepping.step_control import count_turns, end_of_step, first_step
from dap3d_core.integrators.stepping.switch_values import count_from_far_edges
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, Matrix
from dap3d_core.kernels.runtime.cache import compiled

#: What a lane does: nothing; it takes a step; the rates of its trial state are known; its step is
#: cut, as a stage lies across a switch.
IDLE, TAKES_STEP, HAS_RATES, CUT = 0, 1, 2, -1
#: Right-hand sides after which a run is left: never within its steps.
ALL = 10**15


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Lanes(Arrays):
    """Steps of L runs of n components; the vectors have a number for each lane."""

    does: Integers
    rejected: Integers  # steps of the run that had failed before this one
    h: Floats  # the run's next step, as it was chosen before this one
    end: Floats  # of the step
    length: Floats  # of the step
    goal: Floats  # where it would end without switches
    error: Floats
    t: Floats  # arguments and results of functions of all lanes (formulations/wide_rates.py)
    bound: Floats
    y: Matrix  # (n, L)
    out: Matrix  # (n, L)
    outcome: Matrix  # (m, L)
    switches: Matrix  # (s, L)


@compiled
def plan_step(
    work: RungeKuttaState, lanes: Lanes, k: int, functions: Any, system: Any, loops: Any
) -> bool:
    """Report what a run has reached and choose its next step; False at its end or its limit."""
    rhs, project, report = functions[0], functions[1], functions[2]
    watch = functions[4] if work.switch_count != 0 else rhs
    while may_step(work, dense_state, ALL, project, report, system, loops):
        lanes.h[k], lanes.rejected[k] = work.h, work.rejected_count
        if work.first_stage_valid == 0 and not find_first_stage(work, rhs, system, loops):
            continue
        adaptive = work.fixed_step == 0.0
        if adaptive and work.h == 0.0:
            work.h = first_step(work, work.k, rhs, system, loops)
        steps, end = work.step_count, end_of_step(work)
        h = longest = end - work.t
        near = work.projects != 0 and is_near_singularity(work, h)
        if near or (adaptive and limit_step_at_singularity(work, h) < h):
            accepted = functions[3] if work.calls_accepted != 0 else rhs
            step(work, (rhs, project, accepted, watch), system, loops)
        else:
            limit = min(work.step_limit, work.t + work.step_limit_at_switch)
            if work.switch_count != 0 or limit < end:
                h = min(h, next_length(work, end, work.k[0], rhs, project, watch, system, loops))
            if h != 0.0:
                lanes.length[k], lanes.goal[k] = h, end
                lanes.end[k] = work.t + h if h < longest else end
                return True
        after_step(work, lanes, k, steps, functions, system, loops)
    return False


@compiled
def after_step(
    work: RungeKuttaState, lanes: Lanes, k: int, steps: int, functions: Any, system: Any, loops: Any
) -> None:
    """What ``advance`` does behind a step of a lane that had taken so many."""
    rhs = functions[0]
    update_rounding(work, work.k[0], lanes.h[k], lanes.rejected[k], rhs, system, loops)
    if work.calls_accepted != 0 and work.step_count > steps:
        count_turns(work, functions[3], system, loops)


@compiled
def put_stage(work: RungeKuttaState, lanes: Lanes, k: int, i: int) -> int:
    """State of a stage, and as the argument of the right-hand side; 1 where that is wanted."""
    t1, table, stages = lanes.end[k], work.table, work.stage_count
    h, c = lanes.length[k], table[i, ABSCISSA]
    x = work.state[at.TRIAL] if i == stages else work.state[at.SCRATCH]
    combine(x, 1.0, work.state[at.Y], h, table, i, work.k)
    if i == stages and work.error_uses_last_stage == 0:
        return 0
    put_argument(lanes, k, t1 if c == 1.0 else work.t + c * h, x)
    return 1


@compiled
def begin_stage(work: RungeKuttaState, lanes: Lanes, k: int) -> int:
    """1 where the rates of a stage are wanted still; 0 where it lies across a switch.

    The switches are in ``SAMPLE``, without bands.
    """
    if work.sampled_switch_count != 0:
        count_from_far_edges(work.switches, at.SAMPLE)
        if is_cut_at_sample(work, lanes.t[k], lanes.end[k] - work.t):
            lanes.does[k] = CUT
            return 0
    work.rhs_count += 1
    return 1


@compiled
def argument_of(work: RungeKuttaState, lanes: Lanes, k: int) -> Floats:
    """The state at which a lane wants its rates, for a function of one scene."""
    argument = work.state[at.OTHER]
    for j in range(argument.shape[0]):
        argument[j] = lanes.y[j, k]
    return argument


@compiled
def put_argument(lanes: Lanes, k: int, t: float, x: Floats) -> None:
    """Time and state at which a lane wants its rates."""
    lanes.t[k] = t
    for j in range(x.shape[0]):
        lanes.y[j, k] = x[j]


@compiled
def judge_step(
    work: RungeKuttaState, lanes: Lanes, k: int, project: Function, system: Any, loops: Any
) -> int:
    """Error of a step; 1 where the next one begins with the rates of its trial state."""
    t1 = lanes.end[k]
    lanes.error[k] = step_error(work, t1, lanes.length[k], False, project, system, loops)
    if work.fixed_step != 0.0 or work.error_uses_last_stage != 0 or not lanes.error[k] <= 1.0:
        return 0
    lanes.does[k] = HAS_RATES
    put_argument(lanes, k, t1, work.state[at.TRIAL])
    return 1


@compiled
def take_projection(work: RungeKuttaState, lanes: Lanes, k: int) -> None:
    """The projected trial state of a lane, where it is that of its run alone."""
    if lanes.bound[k] < 1.0:
        work.is_projected = 1
        given, outcome = work.state[at.GIVEN], work.real[at.PROJECTED :]
        for j in range(given.shape[0]):
            given[j] = lanes.y[j, k]
        for j in range(outcome.shape[0]):
            outcome[j] = lanes.outcome[j, k]


@compiled
def end_step(
    work: RungeKuttaState, lanes: Lanes, k: int, functions: Any, system: Any, loops: Any
) -> None:
    """Accept or reject the step of a lane whose stages are known."""
    rhs, project = functions[0], functions[1]
    if lanes.does[k] == CUT:
        after_step(work, lanes, k, work.step_count, functions, system, loops)
        return
    accepted = functions[3] if work.calls_accepted != 0 else rhs
    t1, error, has_rates = lanes.end[k], lanes.error[k], lanes.does[k] == HAS_RATES
    watch = functions[4] if work.switch_count != 0 else rhs
    h, steps, end = lanes.length[k], work.step_count, lanes.goal[k]
    of_step, longest = (rhs, project, accepted, watch), end - work.t
    finish_step(work, t1, h, longest, end, False, error, has_rates, of_step, system, loops)
    work.is_projected = 0
    after_step(work, lanes, k, steps, functions, system, loops)
