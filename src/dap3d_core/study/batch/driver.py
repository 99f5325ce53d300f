"""Runs many points of one model in one compiled call.

The integrator is that of a single run (integrators/runge_kutta/step.py), called by its address.
Before it the loop sets numbers and the initial state, after it it stores rows. Results of a point
are the same bit for bit whichever points ran before it, and as those of ``simulate``.
"""

from typing import Any

import attrs

from dap3d_core.assembly.arrays import UNSETTLED, System
from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.stepping.integration_state import FINISHED, NOISE, RUNNING, Y
from dap3d_core.kernels.runtime.array_struct import Arrays, Matrix
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.study.batch.initial_state import LEAST_PIVOT, OPEN, SIZE, STARTING, copy_into

# Entries of ``at``: the current point, whether its run has begun, how to start; whether states are
# in coordinates of the formulation's own, and rows have to be brought to those of bodies.
POINT, BEGUN, START, OWN = range(4)
# Start from the state as given, from the corrected state, or correct it and do not run.
UNCORRECTED, CORRECT, CORRECT_ONLY = range(3)
# Columns of ``diagnostics`` after those of the start: status, rows, steps, right-hand sides, and
# how often the iteration of friction did not converge.
ENDED, ROWS, TAKEN, CALLS, FRICTION_FAILURES, COLUMNS = range(STARTING, STARTING + 6)
#: Status of a point whose start could not be corrected here.
NO_START = -1
#: Least pivot as a fraction of its row, below which rows depend so closely on one another that the
#: point has to be run individually: 1e4 times what a rank is judged by.
MIN_PIVOT = 1e-10


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Points(Arrays):
    """k points of a model with n state components; w numbers change from point to point."""

    at: Integers  # (4,)
    places: Integers  # (w,) indices in par, body, metric and constants of a tree, concatenated
    table: Matrix  # (k, w) the numbers at these indices
    y0: Matrix  # (k, n) states to start from
    metric: Matrix  # of the model, where its numbers do not change from point to point
    unit: Floats  # (7,) constants of the metric of displacements at the start
    starting: Floats  # (STARTING + rows + n,) arguments and results of the start (initial_state.py)
    first_real: Floats  # the work as it is before a run
    first_integer: Integers
    first_switches: Matrix
    first_lengths: Matrix
    rows: Matrix  # (k nt, width) reported rows
    diagnostics: Matrix  # (k, COLUMNS); SIZE is given


@compiled
def set_numbers(points: Points, p: int, system: System) -> None:
    """Copy the numbers of point p into the arrays of the system."""
    places, par, body, metric = points.places, system.par, system.body, system.metric
    first_body = par.shape[0]
    first_metric = first_body + body.shape[0] * body.shape[1]
    first_of_tree = first_metric + metric.shape[0] * metric.shape[1]
    for c in range(places.shape[0]):
        place, value = places[c], points.table[p, c]
        if place < first_body:
            par[place] = value
        elif place < first_metric:
            k = place - first_body
            body[k // body.shape[1], k % body.shape[1]] = value
        elif place < first_of_tree:
            k = place - first_metric
            metric[k // metric.shape[1], k % metric.shape[1]] = value
        else:
            system.tree.constants[place - first_of_tree] = value


@compiled
def reset_work(points: Points, p: int, work: RungeKuttaState) -> None:
    """Reset the work to that before a run, with the state of point p."""
    copy_into(work.real, points.first_real)
    copy_into(work.integer, points.first_integer)
    for k in range(work.switches.shape[0]):
        copy_into(work.switches[k], points.first_switches[k])
    for k in range(work.lengths.shape[0]):
        copy_into(work.lengths[k], points.first_lengths[k])
    for i in range(work.tolerance.shape[1]):
        work.tolerance[NOISE, i] = 0.0
    copy_into(work.state[Y], points.y0[p])


@compiled
def start(
    points: Points, p: int, work: RungeKuttaState, starting: Any, system: System, loops: Any
) -> bool:
    """Start the run of point p; returns False if it has to be run individually."""
    diagnostics, metric = points.diagnostics[p], system.metric
    reset_work(points, p, work)
    set_numbers(points, p, system)
    t, y = work.t, work.state[Y]
    if points.at[START] != 0:
        for b in range(1, metric.shape[0]):
            copy_into(metric[b], points.unit)
        points.starting[SIZE] = diagnostics[SIZE]
        starting[1](t, y, points.starting, system, loops)
        copy_into(diagnostics[:STARTING], points.starting[:STARTING])
        for b in range(1, metric.shape[0]):
            copy_into(metric[b], points.metric[b])
        set_numbers(points, p, system)
        if diagnostics[OPEN] != 0.0 or not diagnostics[LEAST_PIVOT] > MIN_PIVOT:
            return False
        copy_into(points.y0[p], y)
    starting[0](t, y, diagnostics, system, loops)
    return True


@compiled
def store_row(
    target: Floats, row: Floats, work: RungeKuttaState, starting: Any, system: System, loops: Any
) -> None:
    """Store a reported row with its state brought to coordinates of bodies."""
    end, length = 1 + work.state.shape[1], target.shape[0]
    target[0] = row[0]
    starting[2](row[0], row[1:end], target[1:], system, loops)
    copy_into(target[length - row.shape[0] + end :], row[end:])


@compiled
def store_run(
    points: Points, p: int, work: RungeKuttaState, starting: Any, system: System, loops: Any
) -> None:
    """Store rows and diagnostics of the run of point p, which has ended."""
    diagnostics, nt = points.diagnostics, work.rows.shape[0]
    for k in range(work.row_count):
        if points.at[OWN] == 0:
            copy_into(points.rows[p * nt + k], work.rows[k])
        else:
            store_row(points.rows[p * nt + k], work.rows[k], work, starting, system, loops)
    diagnostics[p, ENDED], diagnostics[p, ROWS] = work.status, work.row_count
    diagnostics[p, TAKEN], diagnostics[p, CALLS] = work.step_count, work.rhs_count
    diagnostics[p, FRICTION_FAILURES] = system.settings[UNSETTLED]


@compiled
def run_points(
    points: Points,
    work: RungeKuttaState,
    functions: Any,
    drives: Any,
    starting: Any,
    system: System,
    loops: Any,
    budget: int,
) -> None:
    """Run points until none is left or more than ``budget`` right-hand sides are spent.

    Rows of a run that is not FINISHED, by its ``diagnostics``, are not valid.
    """
    at, diagnostics = points.at, points.diagnostics
    drive, spent = drives[0], 0
    while at[POINT] < diagnostics.shape[0] and spent <= budget:
        p = at[POINT]
        if at[BEGUN] == 0:
            if not start(points, p, work, starting, system, loops):
                diagnostics[p, ENDED] = NO_START
                at[POINT] += 1
                continue
            if at[START] == CORRECT_ONLY:
                diagnostics[p, ENDED] = FINISHED
                at[POINT] += 1
                continue
            at[BEGUN] = 1
        calls = work.rhs_count
        drive(work, functions, system, loops, budget - spent)
        spent += work.rhs_count - calls
        if work.status != RUNNING:
            store_run(points, p, work, starting, system, loops)
            at[POINT] += 1
            at[BEGUN] = 0
