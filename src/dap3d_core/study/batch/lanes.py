"""Runs points of a tree in joint coordinates several at a time, one in each lane of a vector.

Each point has its own steps and the bits of its run alone. A lane whose run has ended takes the
next point.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.assembly.arrays import STEPS, System
from dap3d_core.assembly.turns import STATE, STATE_WIDTH
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint import lanes as tree_lanes
from dap3d_core.integrators.runge_kutta.lanes import (
    IDLE,
    TAKES_STEP,
    Lanes,
    end_step,
    plan_step,
    take_stages,
)
from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler.types import INT, CompileError, Signature, Table, Tuple
from dap3d_core.kernels.compiler.units import Entry, Functions
from dap3d_core.kernels.runtime.array_struct import INTEGERS as INTEGER_VECTOR
from dap3d_core.kernels.runtime.array_struct import MATRIX, Arrays
from dap3d_core.kernels.runtime.cache import compiled, jit_is_on
from dap3d_core.kernels.runtime.function_lists import LOOP, LOOP_LIST
from dap3d_core.kernels.runtime.lanes import WideArrays, lane_count, wide_function
from dap3d_core.kernels.runtime.loop_modules import build_wide
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.study.batch.driver import POINT, Points, set_numbers, start, store_run

#: Bodies at most: the arrays of lanes, some 12 kB a body, are to fit into the processor's caches.
MOST_BODIES = 2000
#: No point.
NONE = -1
#: Numbers of a function in F, of which the last is that at the start of the run.
FUNCTION_WIDTH = 5
MakeWorks = Callable[[int], Sequence[RungeKuttaState]]
#: Signature of the right-hand side of all lanes.
_RATES = Signature((tree_lanes.Rates.type_of(), System.type_of(), LOOP_LIST))


@attrs.frozen(eq=False, kw_only=True, slots=False)
class LanePoints(Arrays):
    """Points in L lanes, and the numbers of a system that lanes have each for itself."""

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("loaded", "point"), INTEGER_VECTOR),
        **dict.fromkeys(("par", "body", "constants", "F", "turns"), MATRIX),
    }

    loaded: Integers  # (1,) the point whose numbers the system of one scene has
    point: Integers  # (L,) of each lane
    par: Floats  # (numbers, L) each: parts of a system that differ from point to point
    body: Floats
    constants: Floats
    F: Floats
    turns: Floats  # (L, numbers) states of angles (assembly/turns.py), which each run changes


@compiled
def exchange_turns(lane_points: LanePoints, k: int, system: System, to_lane: bool) -> None:
    """Copy the states of angles from the system to a lane, or back."""
    turns, par = lane_points.turns[k], system.par
    for c in range(turns.shape[0]):
        place = system.turns[0, STATE] + c
        if to_lane:
            turns[c] = par[place]
        else:
            par[place] = turns[c]


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
        elif place >= first_of_tree:
            constants[place - first_of_tree, k] = value
    for q in range(system.F.shape[0]):
        for c in range(FUNCTION_WIDTH):
            lane_points.F[FUNCTION_WIDTH * q + c, k] = system.F[q, c]
    exchange_turns(lane_points, k, system, True)


@compiled
def load(points: Points, lane_points: LanePoints, k: int, system: System) -> None:
    """Put the numbers of a lane's point into the system of one scene, unless it has them."""
    p = lane_points.point[k]
    if lane_points.loaded[0] != p:
        lane_points.loaded[0] = p
        set_numbers(points, p, system)
        last = FUNCTION_WIDTH - 1
        for q in range(system.F.shape[0]):
            system.F[q, last] = lane_points.F[FUNCTION_WIDTH * q + last, k]
    exchange_turns(lane_points, k, system, False)


@compiled
def next_step(
    points: Points,
    lane_points: LanePoints,
    k: int,
    work: RungeKuttaState,
    lanes: Lanes,
    functions: Any,
    starting: Sequence[Function],
    system: System,
    loops: Any,
) -> int:
    """Choose the next step of a lane, of its point or of the next one; 1 if there is one."""
    at, lanes.does[k] = points.at, IDLE
    while True:
        if lane_points.point[k] == NONE:
            p = at[POINT]
            if p == points.diagnostics.shape[0]:
                return 0
            at[POINT] = p + 1
            start(points, p, work, starting, system, loops)
            set_lane(points, p, lane_points, k, system)
            lane_points.point[k] = lane_points.loaded[0] = p
        load(points, lane_points, k, system)
        if plan_step(work, lanes, k, functions, system, loops):
            lanes.does[k] = TAKES_STEP
            return 1
        store_run(points, lane_points.point[k], work, starting, system, loops)
        lane_points.point[k] = NONE


@compiled
def run_lanes(
    points: Points,
    lane_points: LanePoints,
    works: Any,
    lanes: Lanes,
    wide: Any,
    functions: Any,
    starting: Any,
    system: System,
    loops: Any,
    budget: int,
) -> int:
    """Run points until none is left or more than ``budget`` right-hand sides are spent.

    Returns the number of lanes that have not ended. Arguments as of ``run_points`` (driver.py) and
    ``take_stages`` (integrators/runge_kutta/lanes.py).
    """
    spent, active = 0, 1
    while active > 0 and spent <= budget:
        active = 0
        for k, work in works:
            active += next_step(
                points, lane_points, k, work, lanes, functions, starting, system, loops
            )
        if active > 0:
            take_stages(works, lanes, wide, functions, system, loops)
        for k, work in works:
            if lanes.does[k] != IDLE:
                load(points, lane_points, k, system)
                end_step(work, lanes, k, functions, system, loops)
                exchange_turns(lane_points, k, system, True)
        spent += active * works[0][1].stage_count
    return active


class LaneBatch:
    """Runs points of one evaluator in lanes. Not for two threads at once.

    Attributes:
        count: lanes.
    """

    def __init__(self, evaluator: Evaluator, make: MakeWorks, starting: Any) -> None:
        """Args:
        evaluator: evaluates the model, in joint coordinates; its arrays stay what they are.
        make: makes the states of so many integrations.
        starting: as of ``run_points``.

        Raises:
            CompileError: kernels of the scene decide by a number.
        """
        self.count = lane_count()
        system, size = evaluator.system, evaluator.coordinates.size + 1
        rates = tree_lanes.Rates(
            t=np.zeros(1), y=np.zeros(size), out=np.zeros(size), bound=np.zeros(1)
        )
        self._rates = WideArrays(rates, self.count, ("t", "y", "out", "bound"))
        self._system = WideArrays(system, self.count, tree_lanes.ARRAYS)
        rhs = wide_function(tree_lanes.rhs, _RATES.arguments, self.count)
        of_rates = {name: self._rates.matrix(array) for name, array in rates.walk()}
        self._lanes = Lanes(
            does=np.zeros(self.count, dtype=np.int64),
            rejected=np.zeros(self.count, dtype=np.int64),
            h=np.zeros(self.count),
            end=np.zeros(self.count),
            error=np.zeros(self.count),
            t=of_rates["t"][0],
            bound=of_rates["bound"][0],
            y=of_rates["y"],
            out=of_rates["out"],
        )
        self._points = LanePoints(
            loaded=np.full(1, NONE),
            point=np.full(self.count, NONE),
            **{name: self._system.matrix(getattr(system, name)) for name in ("par", "body", "F")},
            constants=self._system.matrix(system.tree.constants),
            turns=np.zeros((self.count, STATE_WIDTH * len(system.turns))),
        )
        self._works = tuple(enumerate(make(self.count)))
        self._wide = (
            Functions(_RATES, [rhs]), self._rates, self._system,
            Functions(LOOP, _wide_loops(evaluator, self.count)),
        )  # fmt: skip
        self._arguments = evaluator.functions, starting, system, evaluator.loops
        work = RungeKuttaState.type_of()
        self._run: Entry = run_lanes.compile(
            [
                Points.type_of(), LanePoints.type_of(), Tuple((Tuple((INT, work)),) * self.count),
                Lanes.type_of(),
                Tuple((Table(_RATES), self._rates.type, self._system.type, LOOP_LIST)),
                STEPS, STEPS, System.type_of(), LOOP_LIST, INT,
            ]
        )  # fmt: skip
        self._units = rhs.unit, self._run.unit

    @property
    def is_ready(self) -> bool:
        """True once its code is optimised: before that points run faster one by one."""
        return all(unit.is_optimised for unit in self._units)

    def run(self, points: Points, budget: int) -> None:
        """Run points from states as given; Ctrl-C is answered after some right-hand sides."""
        self._system.spread()
        self._points.loaded[0] = NONE
        self._points.point[:] = NONE
        while self._run(
            points, self._points, self._works, self._lanes, self._wide, *self._arguments, budget
        ):
            pass


def _wide_loops(evaluator: Evaluator, count: int) -> list[Entry]:
    """The group loops that a right-hand side calls; of others those of one scene.

    Raises:
        CompileError: one of them decides by a number; names it.
    """
    loops = list(evaluator.loops.entries)
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        loop = write(group.type_info, kind) if kind in tree_lanes.LOOPS else None
        if loop is not None:
            try:
                loops[q] = build_wide(loop, count)
            except CompileError as error:
                raise CompileError(f"{loop.name} {error}") from error
    return loops


def lane_batch(
    evaluator: Evaluator, make: MakeWorks, starting: Any, has_stops: bool
) -> LaneBatch | str:
    """What runs points in lanes; in words why they are run one by one.

    Args:
        evaluator: evaluates the model.
        make, starting: as of ``LaneBatch``.
        has_stops: there are times that no step crosses.
    """
    model, coordinates = evaluator.model, evaluator.coordinates
    if not jit_is_on():
        return "kernels run as plain Python"
    if coordinates.kept or model.state_count:
        return "joints keep rows on the tree, or elements have states"
    if model.iterated_forces or evaluator.has_unknowns:
        return "forces depend on multipliers, or joints have unknowns of their own"
    if evaluator.switches or evaluator.watched > 1 or has_stops:
        return "it has switches, angles that are no coordinates, or times that no step crosses"
    if model.body_count > MOST_BODIES:
        return f"it has more than {MOST_BODIES} bodies"
    try:
        return LaneBatch(evaluator, make, starting)
    except CompileError as error:
        return str(error)
