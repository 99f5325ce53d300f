"""Adams methods of order 1 to 12 with variable step: predict, evaluate, correct, evaluate.

Two right-hand sides a step, whatever the order: the choice for long smooth motions at tight
tolerances. Order and step are chosen together; a run starts itself with order 1.

Sources: Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975), chapters 5
to 7 (their code STEP: order selection, doubling of steps, start); Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I (HNW), III.5 (recursions of Krogh for divided differences, in
whose notation this is written) and III.7.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from collections.abc import Sequence
from typing import Any

from dap3d_core.integrators.adams.formulas import (
    CONSTANT,
    EQUAL,
    FAILURES,
    G_ROW,
    HIGHEST,
    ORDER_LAST,
    ORDER_NOW,
    PSI,
    PSI_NEXT,
    ROWS,
    STARTING,
    AdamsWork,
    coefficients,
    compare_orders,
    differences_at,
    interpolate,
    predict,
)
from dap3d_core.integrators.runge_kutta.tableau import Floats
from dap3d_core.integrators.stepping.event_location import (
    end_is_across,
    next_length,
    sample,
    settle,
)
from dap3d_core.integrators.stepping.integration_state import (
    ERROR_SIZE,
    FRESH,
    LIMIT,
    LONGEST,
    NEXT,
    NOT_FINITE,
    OTHER,
    OUTCOME,
    REJECTED,
    RHS,
    RTOL,
    RUNNING,
    SCRATCH,
    STATUS,
    STEP_FLOOR,
    STEPS,
    SWITCHES,
    T_STOP,
    TRIAL,
    WATCHED,
    Function,
    H,
    T,
    Y,
)
from dap3d_core.integrators.stepping.output import may_step, project_state
from dap3d_core.integrators.stepping.rounding import note_failure, watch_rounding
from dap3d_core.integrators.stepping.step_control import (
    EPSILON,
    LARGEST,
    STRETCH,
    first_step,
    step_floor,
)
from dap3d_core.integrators.stepping.vector_ops import all_finite, scaled_beyond, scaled_largest
from dap3d_core.kernels.runtime.cache import compiled, compiled_inside

#: The step is doubled, kept, or multiplied by a factor in between these.
SLOWEST, STEADY = 0.5, 0.9
#: The error that a next step is planned for, and how often a step fails before order 1 is taken.
PLANNED, PATIENCE = 0.5, 3


@compiled
def advance_adams(
    work: AdamsWork, functions: Sequence[Function], system: Any, loops: Any, budget: int
) -> None:
    """Go on as ``runge_kutta.advance`` does; functions and budget as there."""
    rhs, project, report = functions[0], functions[1], functions[2]
    real, integer = work.real, work.integer
    watch = functions[4] if integer[SWITCHES] != 0 else rhs
    limit = integer[RHS] + budget
    while may_step(work, state_at, limit, project, report, system, loops):
        steps, rejected, h = integer[STEPS], integer[REJECTED], real[H]
        step(work, rhs, project, watch, system, loops)
        watch_rounding(work, work.differences[0], h, rejected, rhs, system, loops)
        if integer[WATCHED] != 0 and integer[STEPS] > steps:
            functions[3](real[T], work.state[Y], real[OUTCOME:], system, loops)


@compiled_inside
def state_at(work: AdamsWork, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by the polynomial of the method."""
    interpolate(work, t - work.real[T], y)


@compiled_inside
def begin(work: AdamsWork, rhs: Function, system: Any, loops: Any) -> None:
    """The rates at the start, the first step, order 1."""
    real, integer, times, f = work.real, work.integer, work.times, work.differences
    y = work.state[Y]
    integer[RHS] += 1
    rhs(real[T], y, f[0], system, loops)
    integer[FRESH] = 1
    if not all_finite(f[0]):
        real[T_STOP], integer[STATUS] = real[T], NOT_FINITE
        return
    if real[H] == 0.0:
        scratch = work.state[SCRATCH]
        real[H] = first_step(
            real, integer, times, y, f, scratch, work.tolerance, rhs, system, loops
        )
    for i in range(y.size):
        f[1, i] = 0.0
    for j in range(ROWS):
        work.table[PSI, j] = j * real[H]
    integer[ORDER_NOW], integer[STARTING], integer[EQUAL] = 1, 1, 0


@compiled_inside
def step(
    work: AdamsWork, rhs: Function, project: Function, watch: Function, system: Any, loops: Any
) -> None:
    """Try one step: accept it, reject it, or stop the run."""
    real, integer, times = work.real, work.integer, work.times
    if integer[FRESH] == 0:
        begin(work, rhs, system, loops)
        if integer[STATUS] != RUNNING:
            return
    t, t_end, k = real[T], times[-1], integer[ORDER_NOW]
    h = min(real[H], real[LONGEST])
    end = t_end if t + STRETCH * h >= t_end else t + h
    t1 = min(end, real[LIMIT])
    h = t1 - t
    if integer[SWITCHES] != 0:
        h = min(h, next_length(work, end, work.differences[0], project, watch, system, loops))
        if h == 0.0:
            return
        t1 = t1 if h == t1 - t else t + h
    coefficients(work, h, k)
    predict(work, h, k)
    trial, table = work.state[TRIAL], work.table
    if integer[SWITCHES] != 0 and sample(work, t1, trial, watch, system, loops):
        return
    rates, change = work.scaled[ROWS - 1], work.state[SCRATCH]
    integer[RHS] += 1
    rhs(t1, trial, rates, system, loops)
    for i in range(trial.size):
        change[i] = rates[i] - change[i]  # Phi_k at t1
    sizes = differences_at(work, k, h)
    error = h * abs(table[G_ROW, k - 1] - table[G_ROW, k]) * sizes[0]
    here, below, lower = compare_orders(table, h, k, sizes)
    if 1.0 < error <= LARGEST and h * SLOWEST < step_floor(real, times):
        doubt, size, f0 = EPSILON * max(abs(t), abs(t1)), integer[ERROR_SIZE], work.differences[0]
        found = scaled_beyond(
            change, work.state[Y], trial, f0, rates, doubt, size, real[RTOL], work.tolerance
        )
        error = min(error, error * (found / sizes[0]))
    if error <= 1.0:
        g = h * table[G_ROW, k]
        for i in range(trial.size):
            trial[i] += g * change[i]
        failure = project_state(real, integer, t1, trial, project, system, loops)
        if failure == RUNNING:
            if find_rates(work, t1, rhs, watch, system, loops):
                accept(work, t1, k, here, below, lower)
        else:
            fail(work, t1, h, 1, 0.1, failure)
    elif error <= LARGEST:
        note_failure(real, integer, error, h, integer[FAILURES] != 0)
        integer[FAILURES] += 1
        factor = SLOWEST
        if integer[FAILURES] > PATIENCE:
            factor = max(0.1, min(SLOWEST, math.sqrt(PLANNED / here)))
        order = k - 1 if lower else k
        fail(work, t1, h, 1 if integer[FAILURES] >= PATIENCE else order, factor, STEP_FLOOR)
    else:
        fail(work, t1, h, 1, 0.1, NOT_FINITE)


@compiled_inside
def find_rates(
    work: AdamsWork, t1: float, rhs: Function, watch: Function, system: Any, loops: Any
) -> bool:
    """The rates at the trial state; False where they are not finite, or it lies across a switch."""
    real, integer, rates = work.real, work.integer, work.scaled[ROWS - 1]
    trial, total, watched = work.state[TRIAL], work.state[SCRATCH], integer[SWITCHES] != 0
    for i in range(trial.size):
        total[i] = rates[i] - total[i]  # the sum of Phi*_j again
    if watched or t1 < work.times[-1] or work.times[work.integer[NEXT]] < t1:
        integer[RHS] += 1
        rhs(t1, trial, rates, system, loops)
        if not all_finite(rates):
            real[T_STOP], integer[STATUS] = t1, NOT_FINITE
            return False
    return not (watched and end_is_across(work, t1, rates, watch, system, loops))


@compiled_inside
def accept(work: AdamsWork, t1: float, k: int, here: float, below: float, lower: bool) -> None:
    """Make the trial state the state; its differences; order and length of what comes."""
    real, integer, star, f = work.real, work.integer, work.scaled, work.differences
    y, trial, total, rates = work.state[Y], work.state[TRIAL], work.state[SCRATCH], star[ROWS - 1]
    h = t1 - real[T]
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
    real[T] = t1
    integer[STEPS] += 1
    integer[EQUAL] += 1
    integer[FAILURES], integer[ORDER_LAST] = 0, k
    plan(work, h, k, here, below, lower)
    settle(work, h, h, t1)


@compiled_inside
def plan(work: AdamsWork, h: float, k: int, here: float, below: float, lower: bool) -> None:
    """Order and length of the next step (Shampine, Gordon, chapter 7; their code STEP, block 4)."""
    real, integer, f = work.real, work.integer, work.differences
    if lower or k == HIGHEST:
        integer[STARTING] = 0
    order, error = k, here
    if integer[STARTING] != 0:
        order, error = k + 1, 0.0
    elif lower:
        order, error = k - 1, below
    elif integer[EQUAL] > k:
        y = work.state[Y]
        highest = work.state[OTHER]
        for i in range(y.size):
            highest[i] = h * f[k + 1, i]
        size = integer[ERROR_SIZE]
        above = work.table[CONSTANT, k + 1] * scaled_largest(
            highest, y, y, size, real[RTOL], work.tolerance, h
        )
        if k > 1 and below <= min(here, above):
            order, error = k - 1, below
        elif k < HIGHEST and above < (here if k > 1 else 0.5 * here):
            order, error = k + 1, above
    integer[ORDER_NOW] = order
    factor = 2.0
    if error * 2.0 ** (order + 1) > PLANNED:
        factor = 1.0
        if error > PLANNED:
            factor = max(SLOWEST, min(STEADY, (PLANNED / error) ** (1.0 / (order + 1))))
    real[H] = max(h * factor, step_floor(real, work.times))


@compiled_inside
def fail(work: AdamsWork, t1: float, h: float, order: int, factor: float, cause: int) -> None:
    """Try a shorter step again, of another order perhaps; at the floor, stop for ``cause``."""
    real, integer = work.real, work.integer
    integer[REJECTED] += 1
    integer[STARTING], integer[EQUAL], integer[ORDER_NOW] = 0, 0, order
    real[H] = h * factor
    if real[H] < step_floor(real, work.times):
        real[T_STOP], integer[STATUS] = t1, cause
