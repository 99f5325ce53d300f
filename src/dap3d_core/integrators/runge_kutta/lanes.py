"""Steps of several runs at once: their stages are taken together, one run in each lane.

Each run has its own state, time, step, error control and output, as alone, and calls of the
right-hand side beside those of stages are its own (step.py): its numbers are the same bit for bit.
Runs have no switches and no singular poses, as trees in joint coordinates have none.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any, ClassVar

import attrs

from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.step import find_first_stage, finish_step, step_error
from dap3d_core.integrators.runge_kutta.tableau import ABSCISSA
from dap3d_core.integrators.stepping.integration_state import (
    NOT_FINITE,
    SCRATCH,
    TRIAL,
    Function,
    Y,
)
from dap3d_core.integrators.stepping.output import dense_state, may_step
from dap3d_core.integrators.stepping.rounding import update_rounding
from dap3d_core.integrators.stepping.step_control import (
    count_turns,
    end_of_step,
    first_step,
)
from dap3d_core.integrators.stepping.vector_ops import combine
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import INTEGERS as INTEGER_VECTOR
from dap3d_core.kernels.runtime.array_struct import MATRIX, Arrays
from dap3d_core.kernels.runtime.cache import compiled

#: What a lane does: nothing; it takes a step; the rates of its trial state are known; rates that it
#: was given are not those of its run alone, and end it.
IDLE, TAKES_STEP, HAS_RATES, LOST = 0, 1, 2, -1
#: Right-hand sides after which a run is left: never within its steps.
ALL = 10**15


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Lanes(Arrays):
    """Steps of L runs of n components; the vectors have a number for each lane."""

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("does", "rejected"), INTEGER_VECTOR),
        **dict.fromkeys(("y", "out"), MATRIX),
    }

    does: Integers
    rejected: Integers  # steps of the run that had failed before this one
    h: Floats  # the run's next step, as it was chosen before this one
    end: Floats  # of the step
    error: Floats
    t: Floats  # arguments and results of the right-hand side of all lanes (formulations/joint)
    bound: Floats
    y: Floats  # (n, L)
    out: Floats  # (n, L)


@compiled
def plan_step(
    work: RungeKuttaState, lanes: Lanes, k: int, functions: Any, system: Any, loops: Any
) -> bool:
    """Report what a run has reached and choose its next step; False where it has ended."""
    rhs, project, report = functions[0], functions[1], functions[2]
    while may_step(work, dense_state, ALL, project, report, system, loops):
        lanes.h[k], lanes.rejected[k] = work.h, work.rejected_count
        if work.first_stage_valid != 0 or find_first_stage(work, rhs, system, loops):
            if work.fixed_step == 0.0 and work.h == 0.0:
                work.h = first_step(work, work.k, rhs, system, loops)
            lanes.end[k] = end_of_step(work)
            return True
    return False


@compiled
def take_stages(
    works: Any,
    lanes: Lanes,
    wide: Any,
    functions: Any,
    system: Any,
    loops: Any,
) -> None:
    """Stages and errors of the steps of all lanes; rates of the trial states that are good.

    Args:
        works: (lane, state of its run) of each.
        lanes: of them.
        wide: the right-hand side of all lanes, in a table, and its arguments.
        functions, system, loops: of one run.
    """
    table, rates, wide_system, wide_loops = wide
    rhs, project = table[0], functions[1]
    stages = works[0][1].stage_count
    for i in range(1, stages + 1):
        asked = 0
        for k, work in works:
            if lanes.does[k] > IDLE:
                asked += put_stage(work, lanes, k, i)
        if asked > 0:
            rhs(rates, wide_system, wide_loops)
            for k, work in works:
                if lanes.does[k] > IDLE:
                    take_rates(work, lanes, k, i)
    asked = 0
    for k, work in works:
        if lanes.does[k] > IDLE:
            asked += judge_step(work, lanes, k, project, system, loops)
    if asked > 0:
        rhs(rates, wide_system, wide_loops)
        for k, work in works:
            if lanes.does[k] == HAS_RATES:
                take_rates(work, lanes, k, stages)


@compiled
def put_stage(work: RungeKuttaState, lanes: Lanes, k: int, i: int) -> int:
    """State of a stage, and as the argument of the right-hand side; 1 where that is wanted."""
    t1, table, stages = lanes.end[k], work.table, work.stage_count
    h, c = t1 - work.t, table[i, ABSCISSA]
    x = work.state[TRIAL] if i == stages else work.state[SCRATCH]
    combine(x, 1.0, work.state[Y], h, table, i, work.k)
    if i == stages and work.error_uses_last_stage == 0:
        return 0
    work.rhs_count += 1
    put_argument(lanes, k, t1 if c == 1.0 else work.t + c * h, x)
    return 1


@compiled
def put_argument(lanes: Lanes, k: int, t: float, x: Floats) -> None:
    """Time and state at which a lane wants its rates."""
    lanes.t[k] = t
    for j in range(x.shape[0]):
        lanes.y[j, k] = x[j]


@compiled
def take_rates(work: RungeKuttaState, lanes: Lanes, k: int, i: int) -> None:
    """Rates of a lane into stage i."""
    stage = work.k[i]
    if not lanes.bound[k] < 1.0:
        lanes.does[k] = LOST
    for j in range(stage.shape[0]):
        stage[j] = lanes.out[j, k]


@compiled
def judge_step(
    work: RungeKuttaState, lanes: Lanes, k: int, project: Function, system: Any, loops: Any
) -> int:
    """Error of a step; 1 where the next one begins with the rates of its trial state."""
    t1 = lanes.end[k]
    lanes.error[k] = step_error(work, t1, t1 - work.t, False, project, system, loops)
    if work.fixed_step != 0.0 or work.error_uses_last_stage != 0 or not lanes.error[k] <= 1.0:
        return 0
    lanes.does[k] = HAS_RATES
    put_argument(lanes, k, t1, work.state[TRIAL])
    return 1


@compiled
def end_step(
    work: RungeKuttaState, lanes: Lanes, k: int, functions: Any, system: Any, loops: Any
) -> None:
    """Accept or reject the step of a lane whose stages are known."""
    rhs, project = functions[0], functions[1]
    accepted = functions[3] if work.calls_accepted != 0 else rhs
    if lanes.does[k] == LOST:
        work.status = NOT_FINITE
        return
    t1, error, has_rates = lanes.end[k], lanes.error[k], lanes.does[k] == HAS_RATES
    h, steps = t1 - work.t, work.step_count
    of_step = rhs, project, accepted, rhs
    finish_step(work, t1, h, h, t1, False, error, has_rates, of_step, system, loops)
    update_rounding(work, work.k[0], lanes.h[k], lanes.rejected[k], rhs, system, loops)
    if work.calls_accepted != 0 and work.step_count > steps:
        count_turns(work, accepted, system, loops)
