"""Runs points several at a time, one in each lane of a vector.

The lanes take the stages of their steps together; all else each does by itself, with its own steps
and the bits of its run alone. A lane whose run has ended takes the next point.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import STEPS, System
from dap3d_core.formulations import WATCH
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.programs.change_over import MOST_BODIES as MOST_BODIES_OF_PROGRAM
from dap3d_core.formulations.wide_rates import SIGNATURE, WideRates
from dap3d_core.integrators.runge_kutta.lanes import (
    HAS_RATES,
    IDLE,
    TAKES_STEP,
    Lanes,
    argument_of,
    begin_stage,
    end_step,
    judge_step,
    plan_step,
    put_stage,
    take_projection,
)
from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.stepping.integration_state import SAMPLE
from dap3d_core.kernels.compiler.trace import TraceError
from dap3d_core.kernels.compiler.types import INT, CompileError, Table, Tuple
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.array_struct import Arrays, Matrix
from dap3d_core.kernels.runtime.cache import compiled, jit_is_on
from dap3d_core.kernels.runtime.function_lists import LOOP_LIST
from dap3d_core.kernels.runtime.lanes import lane_count
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.study.batch import driver
from dap3d_core.study.batch.driver import Points

#: Bodies at most: the arrays of lanes, some 12 kB a body, are to fit into the processor's caches.
MOST_BODIES = 2000
#: Components of a state at least: stages of fewer take less time than to bring them into lanes.
LEAST_COMPONENTS = 6
#: No point.
NONE = -1
#: Numbers of a function in F, of which the last is that at the start of the run.
FUNCTION_WIDTH = 5
MakeWorks = Callable[[int], Sequence[RungeKuttaState]]


@attrs.frozen(eq=False, kw_only=True, slots=False)
class LanePoints(Arrays):
    """Points in L lanes, and the numbers of a system that lanes have each for itself."""

    loaded: Integers  # (1,) the point whose numbers the system of one scene has
    point: Integers  # (L,) of each lane
    has: Integers  # functions of all lanes that there are (formulations/wide_rates.py)
    par: Matrix  # (numbers, L) each: parts of a system that differ from point to point
    body: Matrix
    metric: Matrix
    constants: Matrix
    F: Matrix
    smallest: Matrix
    places: Integers  # (k,) in par, of what each run changes: states of angles
    kept: Matrix  # (L, k + settings) these, and settings


@compiled
def exchange_kept(lane_points: LanePoints, k: int, system: System, to_lane: bool) -> None:
    """Copy what a run keeps from one evaluation to another from the system to a lane, or back."""
    kept, places, par, settings = (
        lane_points.kept[k],
        lane_points.places,
        system.par,
        system.settings,
    )
    count = places.shape[0]
    for c in range(count + settings.shape[0]):
        if to_lane:
            kept[c] = par[places[c]] if c < count else settings[c - count]
        elif c < count:
            par[places[c]] = kept[c]
        else:
            settings[c - count] = kept[c]
    if to_lane:
        for c in range(count):
            lane_points.par[places[c], k] = kept[c]


@compiled
def set_lane(points: Points, p: int, lane_points: LanePoints, k: int, system: System) -> None:
    """Give a lane the numbers of point p, which the system has, and its functions at the start."""
    par, body, constants = lane_points.par, lane_points.body, lane_points.constants
    first_body = par.shape[0]
    first_metric = first_body + body.shape[0]
    first_of_tree = first_metric + system.metric.shape[0] * system.metric.shape[1]
    for c in range(points.places.shape[0]):
        place, value = points.places[c], points.table[p, c]
        if place < first_body:
            par[place, k] = value
        elif place < first_metric:
            body[place - first_body, k] = value
        elif place < first_of_tree:
            lane_points.metric[place - first_metric, k] = value
        else:
            constants[place - first_of_tree, k] = value
    for q in range(system.F.shape[0]):
        for c in range(FUNCTION_WIDTH):
            lane_points.F[FUNCTION_WIDTH * q + c, k] = system.F[q, c]
    for i in range(system.smallest.shape[0]):
        lane_points.smallest[i, k] = system.smallest[i]
    exchange_kept(lane_points, k, system, True)


@compiled
def load(points: Points, lane_points: LanePoints, k: int, system: System) -> None:
    """Put the numbers of a lane's point into the system of one scene, unless it has them."""
    p = lane_points.point[k]
    if lane_points.loaded[0] != p:
        lane_points.loaded[0] = p
        driver.set_numbers(points, p, system)
        last = FUNCTION_WIDTH - 1
        for q in range(system.F.shape[0]):
            system.F[q, last] = lane_points.F[FUNCTION_WIDTH * q + last, k]
        for i in range(system.smallest.shape[0]):
            system.smallest[i] = lane_points.smallest[i, k]
    exchange_kept(lane_points, k, system, False)


@compiled
def next_step(run: Any, k: int, work: RungeKuttaState) -> int:
    """Choose the next step of a lane, of its point or of the next one; 1 if there is one."""
    points, lane_points, _works, lanes, _wide, functions, starting, system, loops = run
    at, lanes.does[k] = points.at, IDLE
    while True:
        if lane_points.point[k] == NONE:
            p = at[driver.POINT]
            if p == points.diagnostics.shape[0]:
                return 0
            at[driver.POINT] = p + 1
            lane_points.loaded[0] = p  # also where its run does not begin
            if not driver.start(points, p, work, starting, system, loops):
                points.diagnostics[p, driver.ENDED] = driver.NO_START
                continue
            set_lane(points, p, lane_points, k, system)
            lane_points.point[k] = p
        load(points, lane_points, k, system)
        if plan_step(work, lanes, k, functions, system, loops):
            exchange_kept(lane_points, k, system, True)  # it may have taken steps
            lanes.does[k] = TAKES_STEP
            return 1
        driver.store_run(points, lane_points.point[k], work, starting, system, loops)
        lane_points.point[k] = NONE


@compiled
def take_stages(run: Any) -> None:
    """Stages and errors of the steps of all lanes; rates of the trial states that are good."""
    _points, lane_points, works, lanes, wide, functions, _starting, system, loops = run
    table, rates, wide_system, wide_loops = wide
    rhs, project = table[0], functions[1]
    stages = works[0][1].stage_count
    for i in range(1, stages + 1):
        asked = 0
        for k, work in works:
            if lanes.does[k] > IDLE:
                asked += put_stage(work, lanes, k, i)
        if asked > 0:
            watch_stages(run)
            asked = 0
            for k, work in works:
                if lanes.does[k] > IDLE:
                    asked += begin_stage(work, lanes, k)
        if asked > 0:
            rhs(rates, wide_system, wide_loops)
            for k, work in works:
                if lanes.does[k] > IDLE:
                    take_rates(run, k, work, work.k[i])
    asked = 0
    for k, work in works:
        if lanes.does[k] > IDLE:
            asked += judge_step(work, lanes, k, project, system, loops)
    if asked > 0:
        rhs(rates, wide_system, wide_loops)
        for k, work in works:
            if lanes.does[k] == HAS_RATES:
                take_rates(run, k, work, work.k[stages])
        if lane_points.has[1] != 0:
            table[1](rates, wide_system, wide_loops)
            for k, work in works:
                if lanes.does[k] == HAS_RATES and work.projects != 0:
                    take_projection(work, lanes, k)


@compiled
def watch_stages(run: Any) -> None:
    """Values of the switches at the stages of all lanes, where their steps are sampled."""
    points, lane_points, works, lanes, wide, functions, _starting, system, loops = run
    table, rates, wide_system, wide_loops = wide
    if works[0][1].sampled_switch_count == 0:
        return
    is_wide = lane_points.has[2] != 0
    if is_wide:
        table[2](rates, wide_system, wide_loops)
    for k, work in works:
        if lanes.does[k] > IDLE:
            sample = work.switches[SAMPLE]
            if is_wide and lanes.bound[k] < 1.0:
                for j in range(sample.shape[0]):
                    sample[j] = lanes.switches[j, k]
            else:
                load(points, lane_points, k, system)
                functions[WATCH](lanes.t[k], argument_of(work, lanes, k), sample, system, loops)


@compiled
def take_rates(run: Any, k: int, work: RungeKuttaState, stage: Floats) -> None:
    """Rates of a lane into a stage; evaluated for it alone where those of all are not valid."""
    points, lane_points, _works, lanes, _wide, functions, _starting, system, loops = run
    if lanes.bound[k] < 1.0:
        for j in range(stage.shape[0]):
            stage[j] = lanes.out[j, k]
        return
    load(points, lane_points, k, system)
    functions[0](lanes.t[k], argument_of(work, lanes, k), stage, system, loops)
    exchange_kept(lane_points, k, system, True)


@compiled
def run_lanes(run: Any, budget: int) -> int:
    """Run points until none is left or more than ``budget`` right-hand sides are spent.

    Returns the number of lanes that have not ended.

    run: points, lane_points, works, lanes, wide, functions, starting, system, loops, as of
    ``run_points`` (driver.py) and of lanes (integrators/runge_kutta/lanes.py); wide: functions of
    all lanes, in a table, and their arguments (formulations/wide_rates.py).
    """
    points, lane_points, works, lanes, _wide, functions, _starting, system, loops = run
    spent, active = 0, 1
    while active > 0 and spent <= budget:
        active = 0
        for k, work in works:
            active += next_step(run, k, work)
        if active > 0:
            take_stages(run)
        for k, work in works:
            if lanes.does[k] != IDLE:
                load(points, lane_points, k, system)
                end_step(work, lanes, k, functions, system, loops)
                exchange_kept(lane_points, k, system, True)
        spent += active * works[0][1].stage_count
    return active


class LaneBatch:
    """Runs points of one evaluator in lanes. Not for two threads at once.

    Attributes:
        count: lanes.
    """

    def __init__(
        self, evaluator: Evaluator, wide: WideRates, make: MakeWorks, starting: Any
    ) -> None:
        """Args:
        evaluator: evaluates the model; its arrays stay what they are.
        wide: the right-hand side of all lanes.
        make: makes the states of so many integrations.
        starting: as of ``run_points``.
        """
        count = self.count = wide.lanes["bound"].shape[1]
        system = evaluator.system
        self._wide = wide
        self._lanes = Lanes(
            does=np.zeros(count, dtype=np.int64),
            rejected=np.zeros(count, dtype=np.int64),
            **{name: np.zeros(count) for name in ("h", "end", "length", "goal", "error")},
            **{name: wide.lanes[name][0] for name in ("t", "bound")},
            **{name: wide.lanes[name] for name in ("y", "out", "outcome", "switches")},
        )
        kept = np.r_[0:0, *evaluator.turn_places()]
        tree = np.zeros((0, count)) if system.tree is None else wide.matrix(system.tree.constants)
        parts = ("par", "body", "metric", "F", "smallest")
        self._points = LanePoints(
            loaded=np.full(1, NONE),
            point=np.full(count, NONE),
            has=wide.has,
            **{name: wide.matrix(getattr(system, name)) for name in parts},
            constants=tree,
            places=kept,
            kept=np.zeros((count, kept.size + system.settings.size)),
        )
        self._works = tuple(enumerate(make(count)))
        self._arguments = evaluator.functions, starting, system, evaluator.loops
        work = RungeKuttaState.type_of()
        self._run: Entry = run_lanes.compile(
            [
                Tuple((
                    Points.type_of(), LanePoints.type_of(), Tuple((Tuple((INT, work)),) * count),
                    Lanes.type_of(), Tuple((Table(SIGNATURE), *SIGNATURE.arguments)),
                    STEPS, STEPS, System.type_of(), LOOP_LIST,
                )),
                INT,
            ]
        )  # fmt: skip

    @property
    def is_ready(self) -> bool:
        """True once its code is optimised: before that points run faster one by one."""
        units = [*self._wide.units, self._run.unit]
        return all(unit.is_optimised for unit in units)

    def run(self, points: Points, budget: int) -> None:
        """Run points; Ctrl-C is answered after some right-hand sides.

        A projection that reads what the right-hand side left must be a program, or behind one of
        its own (formulations/programs): lanes share the arrays of one scene.
        """
        self._wide.spread()
        self._points.loaded[0] = NONE
        self._points.point[:] = NONE
        own = points, self._points, self._works, self._lanes, self._wide.call
        while self._run((*own, *self._arguments), budget):
            pass


def reason_against(evaluator: Evaluator, size: int) -> str:
    """Why points of a scene, with states of some size, are not run in lanes; "" where they are."""
    if not jit_is_on():
        return "kernels run as plain Python"
    if evaluator.model.iterated_forces or evaluator.has_unknowns:
        return "forces depend on multipliers, or joints have unknowns of their own"
    if size < LEAST_COMPONENTS:
        return f"its state has less than {LEAST_COMPONENTS} components"
    return ""


def wide_rates(
    evaluator: Evaluator,
    time: float,
    state: Floats,
    varied: Mapping[str, Integers],
    others: Sequence[Floats] = (),
) -> WideRates | str:
    """The right-hand side of all lanes; in words why there is none.

    Args:
        evaluator: evaluates the model.
        time, state: of a run.
        varied: numbers that differ from point to point (formulations/programs/symbolic_arrays.py).
        others: further states of a run, as projections are given them.
    """
    try:
        if evaluator.model.body_count <= MOST_BODIES_OF_PROGRAM:
            from dap3d_core.formulations.programs.wide_program import program_rates

            return program_rates(evaluator, lane_count(), time, state, varied, others)
        reason = f"it has more than {MOST_BODIES_OF_PROGRAM} bodies"
    except (CompileError, TraceError) as error:
        reason = str(error)
    tree = evaluator.system.tree
    is_tree = tree is not None and tree.kept is None
    if not is_tree or evaluator.model.state_count or evaluator.model.body_count > MOST_BODIES:
        return reason
    from dap3d_core.formulations.programs.wide_program import tree_rates

    try:
        return tree_rates(evaluator, lane_count())
    except CompileError as error:
        return str(error)
