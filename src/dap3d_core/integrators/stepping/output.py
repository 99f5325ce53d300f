"""Output of a step: projected states, rows of the result."""

from collections.abc import Callable
from typing import Any

from dap3d_core.assembly.arrays import MODE_ENDS
from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.break_points import next_stop, restart
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.vector_ops import all_finite, interpolate
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: What project says in out[1]: it failed; the state is good, but too close to a singular one.
FAILED, NEAR_SINGULAR = 1.0, 2.0
#: Steps that are a smaller part of the run, on average over so many attempts, stall it; after so
#: many right-hand sides, times components, about a second, it ends.
STALLED_STEP, ATTEMPTS, STALL_WORK = 1e-9, 1000, 10_000_000
#: The same part where another integration may go on with slow slip; so many attempts are enough.
SLOW_STEP = 1e-7


@compiled
def project_state(
    work: Any, t: float, y: Floats, project: Function, system: Any, loops: Any, here: bool = False
) -> int:
    """Project y where that is on; the failure, or RUNNING.

    here: whether rhs was the last function called, at this very t and y; the projected state and
    what comes with it may be known then.
    """
    work.projection_moved = 0.0
    if not all_finite(y):
        return at.NOT_FINITE
    if work.projects == 0:
        return at.RUNNING
    outcome = work.real[at.PROJECTED :]
    work.projection_count += 1
    if here and work.is_projected != 0:
        copy(y, work.state[at.GIVEN])
    else:
        outcome[0], outcome[1] = 1.0 if here else 0.0, 0.0
        project(t, y, outcome, system, loops)
    if outcome[1] == FAILED or not all_finite(y):
        return at.PROJECTION_FAILED
    return at.RUNNING


@compiled
def needs_dense(work: Any, t1: float) -> bool:
    """True if dense output of a step to t1 is to be prepared."""
    is_read = work.follows_steps != 0 or work.times[work.next_report] < t1
    return work.has_dense_output != 0 and is_read


@compiled
def dense_state(work: Any, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by the terms of its dense output."""
    interpolate(y, work.terms, (t - work.t_dense) / work.h_dense)


@compiled_into
def may_step(
    work: Any,
    state_at: Callable[[Any, float, Floats], None],
    limit: int,
    project: Function,
    report: Function,
    system: Any,
    loops: Any,
    starts_projected: bool = False,
) -> bool:
    """Report what is reached and end what is over; True if a step is to be tried now.

    state_at: as for ``report_reached``. limit: right-hand sides after which this call of the
    integration is left. starts_projected: the integration itself projects a state that it starts
    from.
    """
    times = work.times
    while work.status == at.RUNNING:
        if times[work.next_report] <= work.t:
            if not report_reached(work, state_at, project, report, system, loops):
                return False
        elif work.end_status != 0:
            if not report_end(work, report, system, loops):
                return False
        elif work.stops_when_stiff != 0 and work.t_stiff < work.t:
            work.status = at.STIFF
        else:
            work_done = abs(work.state[at.Y, work.state.shape[1] - 1])
            work.largest_work = max(work.largest_work, work_done)
            if work.rhs_count > limit:
                return False
            if pass_stop(work, starts_projected, project, system, loops):
                continue
            if work.t >= work.step_limit:
                return False
            pace = judge_pace(work)
            if pace == at.RUNNING:
                return True
            work.t_stop, work.status = work.t, pace
    return False


@compiled
def pass_stop(
    work: Any, starts_projected: bool, project: Function, system: Any, loops: Any
) -> bool:
    """Set ``step_limit``; True where the run has come to a stop, or behind it, without a step.

    On it reports that are due come first. Behind it the integration starts anew, from a state on
    the constraints as they are there.
    """
    stops = work.stops
    work.step_limit = work.t_limit
    for k in range(next_stop(work), stops.shape[1]):
        if work.t < stops[at.BEFORE, k]:
            work.step_limit = min(work.t_limit, stops[at.BEFORE, k])
            return False
        if work.t < stops[at.INSTANT, k]:
            work.t = stops[at.INSTANT, k]
            return True
        if work.t < stops[at.BEHIND, k]:
            work.t = stops[at.BEHIND, k]
            restart(work)
            if not starts_projected:
                failure = project_state(work, work.t, work.state[at.Y], project, system, loops)
                if failure != at.RUNNING:
                    work.t_stop, work.status = work.t, failure
            return True
    return False


@compiled
def judge_pace(work: Any) -> int:
    """STALLED if steps are so short that the run would not end, for about a second of work.

    STIFF where another integration may get on; else RUNNING. Called before each attempt. What is to
    be reached is ``step_limit``, or the end of the run.
    """
    work.attempt_count += 1
    if work.attempt_count < ATTEMPTS:
        return at.RUNNING
    work.attempt_count = 0
    done, work.t_attempted = work.t - work.t_attempted, work.t
    asked = min(work.times[-1] - work.times[0], work.step_limit - work.t)
    if done > ATTEMPTS * STALLED_STEP * asked or work.fixed_step != 0.0:
        work.stall_start = work.rhs_count
    if (work.rhs_count - work.stall_start) * work.state.shape[1] > STALL_WORK:
        return at.STALLED if work.stops_when_stiff == 0 else at.STIFF
    is_slow = work.stops_when_slow != 0 and done < ATTEMPTS * SLOW_STEP * asked
    return at.STIFF if is_slow else at.RUNNING


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
    times = work.times
    while work.next_report < times.size and times[work.next_report] <= work.t:
        if work.row_count == work.rows.shape[0]:
            return False
        t, y = times[work.next_report], work.state[at.Y]
        if t < work.t:
            y = work.state[at.TRIAL]
            state_at(work, t, y)
            failure = project_state(work, t, y, project, system, loops)
            closed = work.position_residual <= work.rtol and work.velocity_residual <= work.rtol
            if failure == at.PROJECTION_FAILED and closed:  # too close to a singular one for more
                failure = at.RUNNING
            if failure != at.RUNNING:
                work.t_stop, work.status = t, failure
                return True
        if not write_row(work, t, y, report, system, loops):
            return True
        work.next_report += 1
    if work.next_report == times.size:
        work.status = at.FINISHED
    return True


@compiled
def report_end(work: Any, report: Function, system: Any, loops: Any) -> bool:
    """End the run at t, with a row for this state; False where the rows are full."""
    times = work.times
    t, last = work.t, work.next_report - 1
    if last < 0 or times[last] < t:
        if work.row_count == work.rows.shape[0]:
            return False
        if not write_row(work, t, work.state[at.Y], report, system, loops):
            return True
    work.t_stop, work.status = t, work.end_status
    return True


@compiled
def left_of_stop(work: Any, t: float) -> float:
    """The time to report at: on a stop and just behind it that before it, where there are contacts.

    Their modes are those before it, and one that is about to lift would pull with functions as they
    are from there on.
    """
    stops, k, has_contacts = work.stops, next_stop(work), False
    if k > 0 and t <= stops[at.BEHIND, k - 1]:
        k -= 1
    if k == stops.shape[1] or t < stops[at.INSTANT, k] or t == work.times[0]:
        return t
    for q in range(work.switches.shape[1]):
        has_contacts |= work.switches[at.DOES, q] == MODE_ENDS
    return stops[at.BEFORE, k] if has_contacts else t


@compiled
def write_row(work: Any, t: float, y: Floats, report: Function, system: Any, loops: Any) -> bool:
    """One row; False, with the status, where it is not finite."""
    n = y.shape[0]
    row = work.rows[work.row_count]
    row[0] = t
    for i in range(n):
        row[1 + i] = y[i]
    work.report_count += 1
    report(left_of_stop(work, t), y, row[1 + n :], system, loops)
    if not all_finite(row):
        work.t_stop, work.status = t, at.NOT_FINITE
        return False
    work.row_count += 1
    return True
