"""The state of an integration: arrays that the compiled core reads and writes, and their places."""

import math
from collections.abc import Callable, Container
from enum import IntEnum
from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import INTEGERS as INTEGER_VECTOR
from dap3d_core.kernels.runtime.array_struct import MATRIX, Arrays

#: ``f(t, y, out, system, loops)``: rhs, project, report, accepted or watch (runge_kutta/step.py).
Function = Callable[..., None]


class Status(IntEnum):
    """Where an integration stands."""

    RUNNING = 0
    FINISHED = 1
    STEP_FLOOR = 2  # the error asks for a step that time cannot resolve
    NOT_FINITE = 3  # dy/dt, y or a reported quantity: beyond 1e100, or not a number
    PROJECTION_FAILED = 4
    SWITCHED = 5  # a switch of the model that ends the run became negative
    CHATTERED = 6  # a switch changed its sign again and again while time hardly went on
    ENDED = 7  # an event of the user's asked for it
    STIFF = 8  # the scene has become stiff, and the integration was to leave it then


# The same as plain integers, for compiled code.
RUNNING, FINISHED = int(Status.RUNNING), int(Status.FINISHED)
STEP_FLOOR, NOT_FINITE = int(Status.STEP_FLOOR), int(Status.NOT_FINITE)
PROJECTION_FAILED, SWITCHED = int(Status.PROJECTION_FAILED), int(Status.SWITCHED)
CHATTERED, STIFF = int(Status.CHATTERED), int(Status.STIFF)

# Places in ``real``. Settings; a STEP of 0 lets the error choose it. CALM, SAFETY: see Method.
RTOL, STEP, EXPONENT, BETA, FACTOR_MIN, FACTOR_MAX, CALM, SAFETY = range(8)
# What changes: time, next step, error of the last accepted step, start and length of the step that
# the dense output belongs to, start of the present run of equal steps, time of what stopped
# the run, error of the last step that was to go across a singular state; the instant that the next
# step may not go beyond, its greatest length since one met the other side of a switch; when the
# scene was found stiff; the largest magnitude of the last component, which is the work done, at an
# accepted state; error per length of the last step that failed; the longest step that error control
# may take; and what project gives: four numbers, then lengths.
(
    T, H, ERROR_OLD, T_DENSE, H_DENSE, GAP_START, T_STOP, ACROSS, LIMIT, CUT, STIFF_AT, MOST_WORK,
    FAILED_RATE, LONGEST, OUTCOME
) = range(8, 23)  # fmt: skip
LENGTHS = OUTCOME + 4
#: Places in ``real`` and ``integer`` that never change in the course of a run.
REAL_SETTINGS = (*range(T), LONGEST)
# Places in ``integer``. Settings.
STAGES, ORDER, ERROR_SIZE, ERRORS, ERROR_USES_RESULT, DENSE, PROJECT_ON, WATCHED = range(8)
# What changes. POOR: landings in a row that project called poor. FRESH: k[0] is f(t, y).
# GAP_STEP of GAP_STEPS: in the present run of equal steps.
STATUS, NEXT, ROW, FRESH, LAST_REJECTED, GAP_STEP, GAP_STEPS = range(8, 15)
STEPS, REJECTED, RHS, PROJECTIONS, REPORTS, POOR = range(15, 21)
# Number of switches. LOOKED: their values and rates at t are known; steps in a row that were cut
# because they met the other side; the status with which the run ends here, and the switch that is
# to blame; how often a switch has changed its sign.
SWITCHES, LOOKED, CUTS, ENDING, CULPRIT, CROSSINGS = range(21, 27)
# LATE_STAGE: see Method; whether the run ends where the scene becomes stiff; steps that looked so,
# and those in a row that did not since (stiffness.py). STALLS: steps in a row towards a crossing,
# so short that the switch did not change by a bit. ROUNDED: whether rounding makes a part of the
# errors is to be looked at (1), or is so (2). SAMPLED: switches that stages have to keep to.
LATE_STAGE, LEAVE, STIFF_STEPS, CALM_STEPS, STALLS, ROUNDED, SAMPLED, INTEGERS = range(27, 35)
INTEGER_SETTINGS = (*range(STATUS), SWITCHES, LATE_STAGE, LEAVE, SAMPLED)
# Rows of ``state``: y at t; the state that a step tries to reach, or an interpolated one; scratch.
Y, TRIAL, SCRATCH, OTHER, STATES = range(5)
# Rows of ``tolerance``: absolute tolerance; change of dy/dt by the rounding of y (rounding.py).
ABSOLUTE, NOISE, TOLERANCES = range(3)
# Rows of ``switches``: value, side (the sign that it keeps; 0: none yet), rate and bend (change of
# the rate in time) at t; value and rate at the trial state; value at a sample; what it does
# (assembly.system); how far beyond zero it is left on its side; since when its changes are counted,
# and how many there were.
VALUE, SIDE, RATE, BEND, FOUND, FOUND_RATE, SAMPLE, DOES, BAND, SINCE, COUNT, SWITCH_ROWS = range(
    12
)
#: Rows of ``crossings``, the first ones of a run: time, which switch, to which side.
LOGGED = 1000


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Work(Arrays):
    """All that ``advance`` reads and writes; n components, S stages (method.Method)."""

    types: ClassVar[dict[str, Any]] = {
        "integer": INTEGER_VECTOR,
        **dict.fromkeys(("state", "k", "terms", "rows", "table", "lengths", "switches",
                         "crossings", "tolerance"), MATRIX),
    }  # fmt: skip

    real: Floats  # (LENGTHS + m,) m lengths that project gives
    integer: Integers  # (INTEGERS,)
    times: Floats  # (nt,) reporting times, increasing, t0 first and t_end last
    state: Floats  # (STATES, n)
    k: Floats  # (S, n) stages; k[0] is f(t, y)
    terms: Floats  # (4 + rows of d, n) of the dense output over the last step
    rows: Floats  # (capacity, 1 + n + report_size) rows t, y, report that wait to be taken
    table: Floats  # method.combinations
    lengths: Floats  # (2, m) at t, and their rates over the last step (singular_poses.py)
    switches: Floats  # (SWITCH_ROWS, q) of q switches of the model (event_location.py)
    crossings: Floats  # (LOGGED, 3) where they changed their sign; no row without switches
    tolerance: Floats  # (TOLERANCES, n)


#: Nothing is counted beyond: a count, and twice that, are exact in double precision.
MOST_COUNTED = 2**52


def allowed_integers(work: Any, found: Integers) -> dict[int, Container[int]]:
    """What each place of ``integer`` that is no setting may hold between two chunks of a run.

    Args:
        work: of the same run, with its settings.
        found: (INTEGERS,) what is to be compared: some places limit others.
    """
    instants, switches, real = work.times.size, work.switches.shape[1], work.real
    running, steps = found[STATUS] == RUNNING, int(found[GAP_STEPS])
    by_switch = {SWITCHED, CHATTERED} if switches else set()
    by_method = {STIFF} if work.integer[LEAVE] else set()
    fixed = real[STEP] != 0.0
    most_steps = math.ceil((work.times[-1] - work.times[0]) / real[STEP]) + 1 if fixed else 0
    return {
        STATUS: {*range(SWITCHED), Status.ENDED, *by_switch, *by_method},
        NEXT: range(instants if running else instants + 1),
        ROW: (0,),
        **dict.fromkeys((FRESH, LAST_REJECTED, LOOKED), (0, 1)),
        ROUNDED: (0, 1, 2),
        GAP_STEPS: range(most_steps + 1),
        GAP_STEP: range(steps + 1),
        ENDING: {0, Status.ENDED, *by_switch},
        CULPRIT: range(max(1, switches)),
        **dict.fromkeys(
            (STEPS, REJECTED, RHS, PROJECTIONS, REPORTS, POOR, CUTS, CROSSINGS, STIFF_STEPS,
             CALM_STEPS, STALLS), range(MOST_COUNTED)
        ),
    }  # fmt: skip


def allowed_reals(work: Any) -> dict[int, tuple[float, float]]:
    """Least and greatest value of each such place of ``real`` but those that ``project`` gives."""
    # a step may go on just behind the last instant (Integration.stops)
    first, last = float(work.times[0]), math.nextafter(float(work.times[-1]), math.inf)
    largest = 1.7976931348623157e308
    return {
        T: (first, last),
        **dict.fromkeys((T_DENSE, GAP_START, T_STOP), (0.0, last)),
        **dict.fromkeys((H, H_DENSE, ERROR_OLD, ACROSS), (0.0, largest)),
        LIMIT: (math.inf, math.inf),
        **dict.fromkeys((CUT, STIFF_AT, MOST_WORK, FAILED_RATE), (0.0, math.inf)),
    }
