"""Adams methods of order 1 to 12 with variable step: predict, evaluate, correct, evaluate.

Two right-hand sides a step, whatever the order: the choice for long smooth motions at tight
tolerances. Order and step are chosen together; a run starts itself with order 1.

Sources: Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975), chapters 5
to 7 (their code STEP: order selection, doubling of steps, start); Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I (HNW), III.5 (recursions of Krogh for divided differences, in
whose notation this is written) and III.7.
"""

import math
from collections.abc import Sequence
from typing import Any

from dap3d_core.integrators.adams.formulas import (
    CONSTANT,
    G_ROW,
    HIGHEST,
    PSI,
    PSI_NEXT,
    ROWS,
    AdamsState,
    compare_orders,
    difference_norms,
    interpolate,
    predict,
    update_coefficients,
)
from dap3d_core.integrators.stepping.event_location import (
    end_is_across,
    is_sample_across,
    next_length,
    update_switches_after_step,
)
from dap3d_core.integrators.stepping.integration_state import (
    NOT_FINITE,
    OTHER,
    RUNNING,
    SCRATCH,
    STEP_FLOOR,
    TRIAL,
    Function,
    Y,
)
from dap3d_core.integrators.stepping.output import may_step, project_state
from dap3d_core.integrators.stepping.rounding import record_failure, update_rounding
from dap3d_core.integrators.stepping.step_control import (
    EPSILON,
    FROM_END,
    LARGEST,
    STEP_FOR_TURNS,
    STRETCH,
    count_turns,
    first_step,
    step_floor,
    turns_are_certain,
    work_error,
)
from dap3d_core.integrators.stepping.vector_ops import all_finite, scaled_beyond, scaled_largest
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where, with_slopes

#: The first step is no longer part of the run: one of order 1 sees nothing of what comes to rest.
FIRST_PART = 0.01
#: The step is doubled, kept, or multiplied by a factor in between these.
SLOWEST, STEADY = 0.5, 0.9
#: The error that a next step is planned for, and how often a step fails before order 1 is taken.
PLANNED, PATIENCE = 0.5, 3
#: What each step keeps of the length of those before, which doubles anew where a switch cut one.
KEPT = 0.99


@compiled
def advance_adams(
    work: AdamsState, functions: Sequence[Function], system: Any, loops: Any, budget: int
) -> None:
    """Integrate as ``runge_kutta.advance`` does; functions and budget as there."""
    rhs, project, report = functions[0], functions[1], functions[2]
    watch = functions[4] if work.switch_count != 0 else rhs
    accepted = functions[3] if work.calls_accepted != 0 else rhs
    limit = work.rhs_count + budget
    while may_step(work, state_at, limit, project, report, system, loops):
        steps, rejected, h = work.step_count, work.rejected_count, work.h
        step(work, (rhs, project, accepted, watch), system, loops)
        update_rounding(work, work.differences[0], h, rejected, rhs, system, loops)
        if work.calls_accepted != 0 and work.step_count > steps:
            count_turns(work, accepted, system, loops, FROM_END)


@compiled
def state_at(work: AdamsState, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by the polynomial of the method."""
    interpolate(work, t - work.t, y)


@compiled
def begin(work: AdamsState, rhs: Function, system: Any, loops: Any) -> None:
    """The rates at the start, the first step, order 1."""
    f = work.differences
    y = work.state[Y]
    work.rhs_count += 1
    rhs(work.t, y, f[0], system, loops)
    work.first_stage_valid = 1
    if not all_finite(f[0]):
        work.t_stop, work.status = work.t, NOT_FINITE
        return
    if work.h == 0.0:
        longest = FIRST_PART * (work.times[-1] - work.times[0])
        work.h = with_slopes(min(first_step(work, f, rhs, system, loops), longest), 0.0)
    for i in range(y.size):
        f[1, i] = 0.0
    for j in range(ROWS):
        work.table[PSI, j] = j * work.h
    work.next_order, work.is_starting, work.equal_steps = 1, 1, 0


@compiled
def step(work: AdamsState, functions: Any, system: Any, loops: Any) -> None:
    """Try one step: accept it, reject it, or stop the run; functions as ``advance`` has them."""
    rhs, project, accepted, watch = functions
    if work.first_stage_valid == 0:
        begin(work, rhs, system, loops)
        if work.status != RUNNING:
            return
    t, t_end, k = work.t, work.times[-1], work.next_order
    h = with_slopes(min(work.h, work.longest_step), 0.0)  # chosen: not to be differentiated
    end = t_end if t + STRETCH * h >= t_end else t + h
    t1 = min(end, work.step_limit)
    h = t1 - t
    if work.switch_count != 0:
        h = min(h, next_length(work, end, work.differences[0], project, watch, system, loops))
        if h == 0.0:
            return
        t1 = t1 if h == t1 - t else t + h
    update_coefficients(work, h, k)
    predict(work, h, k)
    trial, table = work.state[TRIAL], work.table
    if work.switch_count != 0 and is_sample_across(work, t1, trial, watch, system, loops):
        return
    rates, change = work.scaled[ROWS - 1], work.state[SCRATCH]
    work.rhs_count += 1
    rhs(t1, trial, rates, system, loops)
    for i in range(trial.size):
        change[i] = rates[i] - change[i]  # Phi_k at t1
    sizes = difference_norms(work, k, h)
    error = error_of(work, t1, h, k, sizes[0])
    here, below, lower = compare_orders(table, h, k, sizes)
    if error <= 1.0:
        g = h * table[G_ROW, k]
        for i in range(trial.size):
            trial[i] += g * change[i]
        failure = project_state(work, t1, trial, project, system, loops)
        if failure != RUNNING:
            reject(work, t1, h, 1, 0.1, failure)
        elif complete_step(work, t1, rhs, watch, system, loops):
            if turns_are_certain(work, t1, accepted, system, loops):
                accept(work, t1, k, here, below, lower)
            else:
                reject(work, t1, h, k, STEP_FOR_TURNS, STEP_FLOOR)
    elif error <= LARGEST:
        record_failure(work, error, h, work.failure_count != 0)
        work.failure_count += 1
        factor = SLOWEST
        if work.failure_count > PATIENCE:
            factor = max(0.1, min(SLOWEST, math.sqrt(PLANNED / here)))
        order = k - 1 if lower else k
        reject(work, t1, h, 1 if work.failure_count >= PATIENCE else order, factor, STEP_FLOOR)
    else:
        reject(work, t1, h, 1, 0.1, NOT_FINITE)


@compiled
def error_of(work: AdamsState, t1: float, h: float, k: int, size: float) -> float:
    """Error of a step to t1 whose Phi_k has a scaled size; up to 1.0 it is good enough."""
    table, change, rates = work.table, work.state[SCRATCH], work.scaled[ROWS - 1]
    weight = h * abs(table[G_ROW, k - 1] - table[G_ROW, k])
    error = weight * size
    if 1.0 < error <= LARGEST and h * SLOWEST < step_floor(work):
        y, trial, f0 = work.state[Y], work.state[TRIAL], work.differences[0]
        doubt = EPSILON * max(abs(work.t), abs(t1))
        found = scaled_beyond(
            change, y, trial, f0, rates, doubt, work.error_size, work.rtol, work.tolerance
        )
        error = min(error, error * (found / size))
    of_work = work_error(work, h, weight * change[change.size - 1])
    return where(of_work > error, of_work, error)


@compiled
def complete_step(
    work: AdamsState, t1: float, rhs: Function, watch: Function, system: Any, loops: Any
) -> bool:
    """The rates at the trial state; False where they are not finite, or it lies across a switch."""
    rates = work.scaled[ROWS - 1]
    trial, total, watched = work.state[TRIAL], work.state[SCRATCH], work.switch_count != 0
    for i in range(trial.size):
        total[i] = rates[i] - total[i]  # the sum of Phi*_j again
    if watched or t1 < work.times[-1] or work.times[work.next_report] < t1:
        work.rhs_count += 1
        rhs(t1, trial, rates, system, loops)
        if not all_finite(rates):
            work.t_stop, work.status = t1, NOT_FINITE
            return False
    return not (watched and end_is_across(work, t1, rates, watch, system, loops))


@compiled
def accept(work: AdamsState, t1: float, k: int, here: float, below: float, lower: bool) -> None:
    """Make the trial state the state; its differences; order and length of what comes."""
    star, f = work.scaled, work.differences
    y, trial, total, rates = work.state[Y], work.state[TRIAL], work.state[SCRATCH], star[ROWS - 1]
    h = t1 - work.t
    for i in range(y.size):
        y[i] = trial[i]
        difference = rates[i] - total[i]
        f[k, i], f[k + 1, i] = difference, difference - star[k, i]
    for j in range(k - 1, -1, -1):
        for i in range(y.size):
            f[j, i] = f[j + 1, i] + star[j, i]
    for j in range(1, k + 2):
        work.table[PSI, j] = work.table[PSI_NEXT, j]
    work.table[PSI, 0] = 0.0
    work.t = t1
    work.step_count += 1
    work.equal_steps += 1
    work.failure_count, work.last_order = 0, k
    work.uncut_step = max(h, KEPT * work.uncut_step)
    plan(work, h, k, here, below, lower)
    update_switches_after_step(work, h, h, t1)


@compiled
def plan(work: AdamsState, h: float, k: int, here: float, below: float, lower: bool) -> None:
    """Order and length of the next step (Shampine, Gordon, chapter 7; their code STEP, block 4)."""
    f = work.differences
    if lower or k == HIGHEST:
        work.is_starting = 0
    order, error = k, here
    if work.is_starting != 0:
        order, error = k + 1, 0.0
    elif lower:
        order, error = k - 1, below
    elif work.equal_steps > k:
        y = work.state[Y]
        highest = work.state[OTHER]
        for i in range(y.size):
            highest[i] = h * f[k + 1, i]
        size = work.error_size
        above = work.table[CONSTANT, k + 1] * scaled_largest(
            work.state[SCRATCH], highest, y, y, size, work.rtol, work.tolerance, h
        )
        if k > 1 and below <= min(here, above):
            order, error = k - 1, below
        elif k < HIGHEST and above < (here if k > 1 else 0.5 * here):
            order, error = k + 1, above
    work.next_order = order
    factor = 2.0
    if error * 2.0 ** (order + 1) > PLANNED:
        factor = 1.0
        if error > PLANNED:
            factor = max(SLOWEST, min(STEADY, (PLANNED / error) ** (1.0 / (order + 1))))
    work.h = max(h * factor, step_floor(work))


@compiled
def reject(work: AdamsState, t1: float, h: float, order: int, factor: float, cause: int) -> None:
    """Try a shorter step again, of another order perhaps; at the floor, stop for ``cause``."""
    work.rejected_count += 1
    work.is_starting, work.equal_steps, work.next_order = 0, 0, order
    work.h = h * factor
    if work.h < step_floor(work):
        work.t_stop, work.status = t1, cause
