"""The state of an integration: arrays that compiled code reads and writes, and their scalars."""

import math
from collections.abc import Callable, Container
from enum import IntEnum
from typing import Any

import attrs

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, Matrix, Scalar

#: ``f(t, y, out, system, loops)``: rhs, project, report, accepted or watch (runge_kutta/step.py).
Function = Callable[..., None]


class Status(IntEnum):
    """State of progress of an integration."""

    RUNNING = 0
    FINISHED = 1
    STEP_FLOOR = 2  # the error requires a step that time cannot resolve
    NOT_FINITE = 3  # dy/dt, y or a reported quantity: beyond 1e100, or not a number
    PROJECTION_FAILED = 4
    SWITCHED = 5  # a switch of the model that ends the run became negative
    CHATTERED = 6  # a switch changed its sign again and again while time hardly advanced
    ENDED = 7  # a user event requested it
    STIFF = 8  # the scene has become stiff, and the integration was to stop then
    JUMPED = 9  # velocities or states jump here; who advances it changes them and goes on
    STALLED = 10  # steps are so short that the run would not end
    NO_ROOM = 11  # more contacts than an exported model has room for
    DRIVEN = 12  # friction of a contact is negative, or no number


# The same as plain integers, for compiled code.
RUNNING, FINISHED = int(Status.RUNNING), int(Status.FINISHED)
STEP_FLOOR, NOT_FINITE = int(Status.STEP_FLOOR), int(Status.NOT_FINITE)
PROJECTION_FAILED, SWITCHED = int(Status.PROJECTION_FAILED), int(Status.SWITCHED)
CHATTERED, STIFF, JUMPED = int(Status.CHATTERED), int(Status.STIFF), int(Status.JUMPED)
STALLED, NO_ROOM, DRIVEN = int(Status.STALLED), int(Status.NO_ROOM), int(Status.DRIVEN)

# Rows of ``state``: y at t; the state that a step tries to reach, or an interpolated one; scratch;
# the projected trial state, where it is known before (runge_kutta/lanes.py).
Y, TRIAL, SCRATCH, OTHER, GIVEN, STATES = range(6)
# Rows of ``stops``: the last instant before, the instant itself, the first one behind it.
BEFORE, INSTANT, BEHIND, STOP_ROWS = range(4)
# Rows of ``tolerance``: absolute tolerance; change of dy/dt by the rounding of y, most that a step
# may be off by for that, first of the components that are of the same kind (rounding.py).
ABSOLUTE, NOISE, MOST, KIND, TOLERANCES = range(5)
# Rows of ``switches``: value, side (the sign that it keeps; 0: none yet), rate and bend (change of
# the rate in time) at t; value and rate at the trial state; value at a sample, and at the one
# nearest to the middle of the step; what it does (assembly.system); how far beyond zero it is left
# on its side; since when its changes are counted, and how many there were; to which side it has
# just gone, where velocities jump for that.
(
    VALUE, SIDE, RATE, BEND, FOUND, FOUND_RATE, SAMPLE, MIDDLE, DOES, BAND, SINCE, COUNT, CROSSED,
    SWITCH_ROWS
) = range(14)  # fmt: skip
#: Rows of ``crossings``, the first ones of a run: time, which switch, to which side.
LOGGED = 1000


def _real() -> Scalar[float]:
    return Scalar("real")


def _integer() -> Scalar[int]:
    return Scalar("integer")


@attrs.define(eq=False, kw_only=True, slots=False)
class IntegrationState(Arrays):
    """State that every integrator has; n components.

    Numbers are in ``real`` and ``integer`` in this order, in checkpoints as well. Those of the
    step-size controller are explained at ``Tableau``.
    """

    # settings
    rtol = _real()
    fixed_step = _real()  # 0: error control
    exponent = _real()
    beta = _real()
    factor_min = _real()
    factor_max = _real()
    widest_gap_abscissa = _real()
    safety = _real()
    # what changes
    t = _real()
    h = _real()  # next step; 0: unknown
    last_error = _real()  # of the last accepted step
    t_dense = _real()  # start and length of the step that dense output belongs to
    h_dense = _real()
    segment_start = _real()  # of the present segment of equal steps
    t_stop = _real()  # of what stopped the run
    error_across_singularity = _real()  # of the last step that was to cross a singular state
    t_limit = _real()  # no step goes beyond, by whoever advances it
    step_limit_at_switch = _real()  # since a step met the other side, or was too long for turns
    t_stiff = _real()  # when the scene became stiff
    largest_work = _real()  # magnitude of the last component at an accepted state
    failed_error_rate = _real()  # error per length of the last step that failed
    t_attempted = _real()  # t when attempts were counted last (output.py)
    uncut_step = _real()  # of adams: length of its steps, as switches have not cut them
    longest_step = _real()  # a setting
    # output of project, followed by the singularity measures
    projection_moved = _real()
    projection_outcome = _real()
    position_residual = _real()
    velocity_residual = _real()

    # settings
    stage_count = _integer()
    order = _integer()
    error_size = _integer()  # leading components that steer the step
    estimate_count = _integer()
    error_uses_last_stage = _integer()
    has_dense_output = _integer()
    projects = _integer()
    calls_accepted = _integer()  # 0, NOTES or JUDGES (step_control.py)
    # what changes
    status = _integer()
    next_report = _integer()  # index in times
    row_count = _integer()  # rows that wait to be taken
    first_stage_valid = _integer()  # k[0] is f(t, y)
    last_rejected = _integer()
    segment_step = _integer()  # of segment_step_count equal steps
    segment_step_count = _integer()
    step_count = _integer()
    rejected_count = _integer()
    rhs_count = _integer()
    projection_count = _integer()
    report_count = _integer()
    near_singular_landings = _integer()  # in a row
    switch_count = _integer()  # a setting
    switch_rates_valid = _integer()  # values and rates of switches are those at t
    cut_attempts = _integer()  # in a row, which met the other side of a switch
    end_status = _integer()  # with which the run ends here
    terminal_switch = _integer()  # the one that ended it
    crossing_count = _integer()
    stiffness_stage = _integer()  # a setting
    stops_when_stiff = _integer()  # a setting
    stops_when_slow = _integer()  # a setting: another integration may go on with slow slip
    stiff_steps = _integer()  # and those in a row since that were not (stiffness.py)
    nonstiff_steps = _integer()
    stalled_steps = _integer()  # in a row, too short to change a switch by a bit
    near_switch = _integer()  # for which a step was made short last; -1 of none
    attempt_count = _integer()  # of steps, since t_attempted
    stall_start = _integer()  # rhs_count where steps became too short for the run to end
    rounding_state = _integer()  # of errors: 1 to be measured, 2 dominant (rounding.py)
    sampled_switch_count = _integer()  # a setting: switches that stages must not cross
    is_projected = _integer()  # the row GIVEN, and its outcome, are of the trial state
    follows_steps = _integer()  # a setting: dense output of each step, not of reports alone

    # found anew before each step
    step_limit = Scalar[float]("limits")  # no step goes beyond: t_limit, or the next stop
    middle_part = Scalar[float]("limits")  # of a step, where its switches are as in MIDDLE; 0: none

    real: Floats  # (MEASURES + m,) scalars; m singularity measures that project gives
    integer: Integers  # scalars
    times: Floats  # (nt,) reporting times, increasing, t0 first and t_end last
    state: Matrix  # (STATES, n)
    rows: Matrix  # (capacity, 1 + n + report_size) rows t, y, report that wait to be taken
    switches: Matrix  # (SWITCH_ROWS, q) of q switches of the model (event_location.py)
    crossings: Matrix  # (LOGGED, 3) where they changed their sign; no row without switches
    tolerance: Matrix  # (TOLERANCES, n)
    stops: Matrix  # (STOP_ROWS, s) instants that no step crosses (break_points.py)
    limits: Floats  # scalars; from LIMITS_END on what project gives of a state beside


#: Indices in ``real``: of the first number that project gives, and of the singularity measures.
PROJECTED = IntegrationState.indices("real")["projection_moved"]
MEASURES = len(IntegrationState.indices("real"))
LIMITS_END = len(IntegrationState.indices("limits"))
#: Scalars that never change in the course of a run.
REAL_SETTINGS = ("rtol", "fixed_step", "exponent", "beta", "factor_min", "factor_max",
                 "widest_gap_abscissa", "safety", "longest_step")  # fmt: skip
INTEGER_SETTINGS = ("stage_count", "order", "error_size", "estimate_count",
                    "error_uses_last_stage", "has_dense_output", "projects", "calls_accepted",
                    "switch_count", "stiffness_stage", "stops_when_stiff", "stops_when_slow",
                    "sampled_switch_count", "follows_steps")  # fmt: skip
#: Nothing is counted beyond: a count, and twice that, are exact in double precision.
MOST_COUNTED = 2**52


def allowed_integers(work: Any, found: Any) -> dict[str, Container[int]]:
    """Values of integers that are neither settings nor counts between two chunks of a run.

    Args:
        work: of the same run, with its settings.
        found: the integers to be compared, by name: some limit others.
    """
    instants, switches = work.times.size, work.switches.shape[1]
    running = found["status"] == RUNNING
    by_switch = {SWITCHED, CHATTERED} if switches else set()
    by_method = {STIFF} if work.stops_when_stiff or work.stops_when_slow else set()
    most_steps = 0
    if work.fixed_step != 0.0:
        most_steps = math.ceil((work.times[-1] - work.times[0]) / work.fixed_step) + 1
    return {
        "status": {*range(SWITCHED), Status.ENDED, STALLED, *by_switch, *by_method},
        "next_report": range(instants if running else instants + 1),
        **dict.fromkeys(("row_count", "is_projected"), (0,)),
        **dict.fromkeys(("first_stage_valid", "last_rejected", "switch_rates_valid"), (0, 1)),
        "rounding_state": (0, 1, 2),
        "segment_step_count": range(most_steps + 1),
        "segment_step": range(found["segment_step_count"] + 1),
        "end_status": {0, Status.ENDED, *by_switch},
        "terminal_switch": range(max(1, switches)),
        "near_switch": range(-1, max(1, switches)),
    }


def allowed_reals(work: Any) -> dict[str, tuple[float, float]]:
    """Least and greatest value of each such number in ``real``, without those of ``project``."""
    # a step may start just behind the last instant (``stops``)
    first, last = float(work.times[0]), math.nextafter(float(work.times[-1]), math.inf)
    largest = 1.7976931348623157e308
    return {
        "t": (first, last),
        **dict.fromkeys(("t_dense", "segment_start", "t_stop", "t_attempted"), (0.0, last)),
        **dict.fromkeys(("h", "h_dense", "last_error", "error_across_singularity"), (0.0, largest)),
        "t_limit": (math.inf, math.inf),
        **dict.fromkeys(
            ("step_limit_at_switch", "t_stiff", "largest_work", "failed_error_rate"),
            (0.0, math.inf),
        ),
    }
