"""Parts of the time of a step of dop853, by programs of the scene: what limits small scenes.

CPU time of this thread, the least of several rounds. Each part is repeated alone, so that the
processor works on several calls at once, which it cannot where a stage needs the one before: the
rest is that, and control of the step, reports, and some 10 us of Python for each run.
"""

import time
from functools import partial

import numpy as np
import programs
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.formulations import OUTCOMES
from dap3d_core.formulations.programs import change_over
from dap3d_core.integrators.runge_kutta.sums import combine, error_norm
from dap3d_core.integrators.stepping.integration import off_constraints
from dap3d_core.integrators.stepping.integration_state import SCRATCH, Y
from dap3d_core.kernels.runtime.cache import compiled

ROUNDS, CALLS, RTOL = 15, 2000, 1e-9
#: Scene, method, seconds of motion.
CASES = (
    ("free body", "unconstrained", 20.0),
    *programs.CASES,
    ("fourbar3", "joint", 2.0),
    ("tri", "joint", 2.0),
)


@compiled
def repeat_rates(functions, count, y0, out, system, loops):
    """Call the right-hand side count times."""
    rhs = functions[0]
    for _ in range(count):
        rhs(0.0, y0, out, system, loops)


@compiled
def repeat_projection(functions, count, y0, y, out, system, loops):
    """Project y0 count times, as behind its right-hand side."""
    project = functions[1]
    for _ in range(count):
        for i in range(y.size):
            y[i] = y0[i]
        out[0] = 1.0
        project(0.0, y, out, system, loops)


@compiled
def repeat_sums(work, count):
    """The sums of stages of a step, count times."""
    for _ in range(count):
        for i in range(1, work.stage_count + 1):
            combine(work.state[SCRATCH], 1.0, work.state[Y], 1e-3, work.table, i, work.k)


@compiled
def repeat_error(work, count):
    """The error of a step, count times."""
    total = 0.0
    for _ in range(count):
        total += error_norm(work, 1e-3)
    return total


def measure():
    """Rows of the table."""
    change_over.MAKE_AFTER, change_over.LOAD_AFTER, change_over.BESIDE = 0.0, 0.0, False
    return [_row(*case) for case in CASES]


def _least(function, count):
    """Least seconds of one of count calls."""
    seconds = np.inf
    for _ in range(ROUNDS):
        begun = time.thread_time()
        function()
        seconds = min(seconds, (time.thread_time() - begun) / count)
    return seconds


def _row(name, method, t_end):
    model = dap.compile(programs.scene_of(name), method=method)
    programs.integration_of(model, t_end, RTOL)[1].advance(10**15)
    wait_for_good_code()
    whole = np.inf
    for _ in range(ROUNDS):
        evaluator, integration = programs.integration_of(model, t_end, RTOL)
        change = change_over.ChangeOver(evaluator)
        change.during(integration, lambda: None)
        begun = time.thread_time()
        change.during(integration, partial(integration.advance, 10**15))
        whole = min(whole, time.thread_time() - begun)
    counts, y0 = integration.statistics, integration.trial
    steps = counts.steps + counts.rejected
    functions, others = evaluator.functions, (evaluator.system, evaluator.loops)
    parts = {}

    def take():
        rates, outcome = np.zeros_like(y0), np.zeros(OUTCOMES + evaluator.length_count)
        parts["right_hand_sides"] = counts.rhs * _least(
            lambda: repeat_rates(functions, CALLS, y0, rates, *others), CALLS
        )
        parts["projections"] = counts.projections * min(
            _least(
                lambda y0=y0: repeat_projection(functions, CALLS, y0, rates, outcome, *others),
                CALLS,
            )
            for y0 in (y0, off_constraints(integration.y))  # where its guards hold
        )

    # all are compiled before programs take the place of functions
    repeat_rates(functions, 0, y0, y0.copy(), *others)
    repeat_projection(functions, 0, y0, y0.copy(), y0.copy(), *others)
    repeat_sums(integration.work, 1), repeat_error(integration.work, 1)
    wait_for_good_code()
    change.call(take, functions.addresses, lambda: (0.0, y0), lambda: (10**9,) * 3)
    work = integration.work
    parts["sums"] = steps * _least(lambda: repeat_sums(work, CALLS), CALLS)
    parts["error_norm"] = steps * _least(lambda: repeat_error(work, CALLS), CALLS)
    shares = {part: seconds / whole for part, seconds in parts.items()}
    rest = 1.0 - sum(shares.values())
    return {"scene": name, "method": method, "step_us": 1e6 * whole / steps, **shares, "rest": rest}
