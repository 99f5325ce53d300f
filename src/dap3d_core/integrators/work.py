"""The state of an integration: arrays that the compiled core reads and writes, and their places."""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.method import Floats, Integers
from dap3d_core.kernels.by_address import INTEGERS as INTEGER_VECTOR
from dap3d_core.kernels.by_address import MATRIX, Arrays

#: ``f(t, y, out, system, loops)``: rhs, project, report, accepted or watch (runge_kutta.py).
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
RTOL, ATOL, STEP, EXPONENT, BETA, FACTOR_MIN, FACTOR_MAX, CALM, SAFETY = range(9)
# What changes: time, next step, error of the last accepted step, start and length of the step that
# the dense output belongs to, start of the present run of equal steps, time of what stopped
# the run, error of the last step that was to go across a singular state; the instant that the next
# step may not go beyond, its greatest length since one met the other side of a switch; when the
# scene was found stiff; and what project gives: four numbers, then lengths.
(
    T, H, ERROR_OLD, T_DENSE, H_DENSE, GAP_START, T_STOP, ACROSS, LIMIT, CUT, STIFF_AT, OUTCOME
) = range(9, 21)  # fmt: skip
LENGTHS = OUTCOME + 4
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
# so short that the switch did not change by a bit.
LATE_STAGE, LEAVE, STIFF_STEPS, CALM_STEPS, STALLS, INTEGERS = range(27, 33)
# Rows of ``state``: y at t; the state that a step tries to reach, or an interpolated one; scratch.
Y, TRIAL, SCRATCH, OTHER, STATES = range(5)
# Rows of ``switches``: value, side (the sign that it keeps; 0: none yet), rate and bend (change of
# the rate in time) at t; value and rate at the trial state; value at a sample; whether it ends the
# run; since when its changes are counted, and how many there were.
VALUE, SIDE, RATE, BEND, FOUND, FOUND_RATE, SAMPLE, ENDS, SINCE, COUNT, SWITCH_ROWS = range(11)
#: Rows of ``crossings``, the first ones of a run: time, which switch, to which side.
LOGGED = 1000


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Work(Arrays):
    """All that ``advance`` reads and writes; n components, S stages (method.Method)."""

    types: ClassVar[dict[str, Any]] = {
        "integer": INTEGER_VECTOR,
        **dict.fromkeys(
            ("state", "k", "terms", "rows", "table", "lengths", "switches", "crossings"), MATRIX
        ),
    }

    real: Floats  # (LENGTHS + m,) m lengths that project gives
    integer: Integers  # (INTEGERS,)
    times: Floats  # (nt,) reporting times, increasing, t0 first and t_end last
    state: Floats  # (STATES, n)
    k: Floats  # (S, n) stages; k[0] is f(t, y)
    terms: Floats  # (4 + rows of d, n) of the dense output over the last step
    rows: Floats  # (capacity, 1 + n + report_size) rows t, y, report that wait to be taken
    table: Floats  # method.combinations
    lengths: Floats  # (2, m) at t, and their rates over the last step (crossing.py)
    switches: Floats  # (SWITCH_ROWS, q) of q switches of the model (switches.py)
    crossings: Floats  # (LOGGED, 3) where they changed their sign; no row without switches
