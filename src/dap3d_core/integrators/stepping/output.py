"""What is left of a step once it is done: states on the constraints, rows of the result."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from collections.abc import Callable
from typing import Any

from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers
from dap3d_core.integrators.stepping.integration_state import (
    ENDING,
    FINISHED,
    H_DENSE,
    LEAVE,
    LIMIT,
    MOST_WORK,
    NEXT,
    NOT_FINITE,
    OUTCOME,
    PROJECT_ON,
    PROJECTION_FAILED,
    PROJECTIONS,
    REPORTS,
    RHS,
    ROW,
    RTOL,
    RUNNING,
    STATUS,
    STIFF,
    STIFF_AT,
    T_DENSE,
    T_STOP,
    TRIAL,
    Function,
    T,
    Work,
    Y,
)
from dap3d_core.integrators.stepping.vector_ops import all_finite, interpolate
from dap3d_core.kernels.runtime.cache import compiled_inside, compiled_into

#: What project says in out[1]: it failed; the state is good, but too close to a singular one.
FAILED, POOR_PLACE = 1.0, 2.0


@compiled_inside
def project_state(
    real: Floats,
    integer: Integers,
    t: float,
    y: Floats,
    project: Function,
    system: Any,
    loops: Any,
    here: bool = False,
) -> int:
    """Project y where that is on; why that failed, or RUNNING.

    here: whether rhs was the last function called, at this very t and y.
    """
    real[OUTCOME] = 0.0
    if not all_finite(y):
        return NOT_FINITE
    if integer[PROJECT_ON] == 0:
        return RUNNING
    outcome = real[OUTCOME:]
    outcome[0], outcome[1] = 1.0 if here else 0.0, 0.0
    integer[PROJECTIONS] += 1
    project(t, y, outcome, system, loops)
    if outcome[1] == FAILED or not all_finite(y):
        return PROJECTION_FAILED
    return RUNNING


@compiled_inside
def dense_state(work: Work, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by the terms of its dense output."""
    interpolate(y, work.terms, (t - work.real[T_DENSE]) / work.real[H_DENSE])


@compiled_into
def may_step(
    work: Any,
    state_at: Callable[[Any, float, Floats], None],
    limit: int,
    project: Function,
    report: Function,
    system: Any,
    loops: Any,
) -> bool:
    """Report what is reached and end what is over; whether a step is to be tried now.

    state_at: as for ``report_reached``. limit: right-hand sides after which this call of the
    integration is left.
    """
    real, integer, times = work.real, work.integer, work.times
    while integer[STATUS] == RUNNING:
        if times[integer[NEXT]] <= real[T]:
            if not report_reached(work, state_at, project, report, system, loops):
                return False
        elif integer[ENDING] != 0:
            if not report_end(work, report, system, loops):
                return False
        elif integer[LEAVE] != 0 and real[STIFF_AT] < real[T]:
            integer[STATUS] = STIFF
        else:
            work_done = abs(work.state[Y, work.state.shape[1] - 1])
            real[MOST_WORK] = max(real[MOST_WORK], work_done)
            return integer[RHS] <= limit and real[T] < real[LIMIT]
    return False


@compiled_into
def report_reached(
    work: Any,
    state_at: Callable[[Any, float, Floats], None],
    project: Function,
    report: Function,
    system: Any,
    loops: Any,
) -> bool:
    """Write a row for each reporting time up to t; False where the rows are full.

    Sets the status where the last time is reported, or where a row is not finite.

    state_at: fills in the state at an instant within the last step.
    """
    real, integer, times = work.real, work.integer, work.times
    while integer[NEXT] < times.size and times[integer[NEXT]] <= real[T]:
        if integer[ROW] == work.rows.shape[0]:
            return False
        t, y = times[integer[NEXT]], work.state[Y]
        if t < real[T]:
            y = work.state[TRIAL]
            state_at(work, t, y)
            failure = project_state(real, integer, t, y, project, system, loops)
            closed = real[OUTCOME + 2] <= real[RTOL] and real[OUTCOME + 3] <= real[RTOL]
            if failure == PROJECTION_FAILED and closed:  # too close to a singular one for more
                failure = RUNNING
            if failure != RUNNING:
                real[T_STOP], integer[STATUS] = t, failure
                return True
        if not write_row(work, t, y, report, system, loops):
            return True
        integer[NEXT] += 1
    if integer[NEXT] == times.size:
        integer[STATUS] = FINISHED
    return True


@compiled_inside
def report_end(work: Any, report: Function, system: Any, loops: Any) -> bool:
    """End the run where it stands, with a row for this state; False where the rows are full."""
    real, integer, times = work.real, work.integer, work.times
    t, last = real[T], integer[NEXT] - 1
    if last < 0 or times[last] < t:
        if integer[ROW] == work.rows.shape[0]:
            return False
        if not write_row(work, t, work.state[Y], report, system, loops):
            return True
    real[T_STOP], integer[STATUS] = t, integer[ENDING]
    return True


@compiled_inside
def write_row(work: Any, t: float, y: Floats, report: Function, system: Any, loops: Any) -> bool:
    """One row; False, with the status, where it is not finite."""
    real, integer, n = work.real, work.integer, y.shape[0]
    row = work.rows[integer[ROW]]
    row[0] = t
    for i in range(n):
        row[1 + i] = y[i]
    integer[REPORTS] += 1
    report(t, y, row[1 + n :], system, loops)
    if not all_finite(row):
        real[T_STOP], integer[STATUS] = t, NOT_FINITE
        return False
    integer[ROW] += 1
    return True
