"""Sets up the compiled loop over points (driver.py) and calls it."""

from collections.abc import Callable
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.arrays import STEPS, System, step_functions
from dap3d_core.formulations import Formulation
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint.coordinates import TreeCoordinates
from dap3d_core.formulations.programs.change_over import ChangeOver
from dap3d_core.integrators import EXPLICIT, IMPLICIT, INTEGRATORS
from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.step import advance
from dap3d_core.integrators.stepping.integration import off_constraints
from dap3d_core.integrators.stepping.integration_state import Status
from dap3d_core.kernels.compiler.types import INT, Signature
from dap3d_core.kernels.runtime.cache import jit_is_on, table_of
from dap3d_core.kernels.runtime.function_lists import LOOP_LIST
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.scene import Simulation
from dap3d_core.simulation.initial.assemble import SMALL_CORRECTION, distance
from dap3d_core.simulation.initial_state import InitialState
from dap3d_core.simulation.settings import fits, integration_options
from dap3d_core.study.batch import driver, initial_state
from dap3d_core.study.batch.initial_state import STARTING

if TYPE_CHECKING:
    from dap3d_core.study.batch.lanes import LaneBatch

#: Points of a call from which on they are run in lanes; right-hand sides times bodies from which on
#: that is tried, because loading their code takes as long; right-hand sides of a point, at first.
LEAST_IN_LANES, BEFORE_LANES, USUAL_CALLS = 4, 500_000, 300.0
#: Right-hand sides after which a compiled call returns, so that Ctrl-C is answered.
CALL = 200_000
#: States of a run, at most, where the ways of projections are sought; right-hand sides between
#: them, at first.
MOST_STATES, FIRST_CALLS = 8, 50

_DRIVE = Signature((RungeKuttaState.type_of(), STEPS, System.type_of(), LOOP_LIST, INT))

MakeBatch = Callable[[], "CompiledBatch"]


class Starts(NamedTuple):
    """What k points start from.

    Attributes:
        table: (k, w) numbers that differ from the model's.
        places: (w,) their indices in the numbers (``numbers_of``).
        y0: (k, n) states to start from.
        start: UNCORRECTED, CORRECT, or CORRECT_ONLY (driver.py).
        sizes: (k,) or (1,) of their models, m, by which a start is corrected.
    """

    table: Floats
    places: Integers
    y0: Floats
    start: int = driver.UNCORRECTED
    sizes: Floats = np.zeros(1)

    def take(self, which: Any) -> "Starts":
        """Some of the points."""
        sizes = np.broadcast_to(self.sizes, len(self.table))[which]
        return self._replace(table=self.table[which], y0=self.y0[which], sizes=sizes)


class BatchRows(NamedTuple):
    """Rows and diagnostics of k runs.

    Attributes:
        done: (k,) True if a run reached its end; the others are to be run individually.
        rows: (k, nt, width) reported rows, as the integrator delivers them.
        given, y0: (k, n) the state that each was given, and the one it started from.
        diagnostics: (k, COLUMNS) see driver.py and initial_state.py.
    """

    done: NDArray[np.bool_]
    rows: Floats
    given: Floats
    y0: Floats
    diagnostics: Floats


class CompiledBatch:
    """Runs one model with other numbers in its arrays. Not for two threads at once.

    Attributes:
        evaluator: evaluates the model.
        integration: of the runs.
        size: a length of the model, m.
        constants: arguments of ``Points`` that all points share.
        last_start: (n,) the state that the last run started from.
        takes_lanes: points may be run in lanes; False for comparisons.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        settings: Simulation,
        times: Floats,
        stops: list[tuple[float, bool]],
    ) -> None:
        """Args:
        evaluator: evaluates the model; its numbers change.
        settings: of the runs; the integrator is a one-step one, or "auto": a run that turns
            out stiff is then not done.
        times: (nt,) reporting times.
        stops: times that no step crosses, and whether something jumps there.
        """
        self.evaluator, self.size = evaluator, evaluator.model.size
        y0 = self.last_start = evaluator.coordinates.start(evaluator.model.u0)
        may_turn_stiff = settings.integrator == "auto" and fits(IMPLICIT, evaluator.formulation)

        def make() -> Any:
            return INTEGRATORS.get(str(settings.integrator), EXPLICIT).make(
                evaluator,
                y0,
                times,
                buffer_rows=len(times),
                stops=stops,
                stop_when_stiff=may_turn_stiff,  # as Run does
                **integration_options(evaluator, settings),
            )

        self._make, self.integration = make, make()
        work = self.integration.work
        self.constants: dict[str, Any] = {
            "metric": evaluator.system.metric.copy(),
            **start_constants(evaluator, len(y0)),
            "first_real": work.real.copy(),
            "first_integer": work.integer.copy(),
            "first_switches": work.switches.copy(),
            "first_lengths": work.lengths.copy(),
        }
        self._begin, self.takes_lanes = begin_functions(evaluator.formulation), True
        self._programs: tuple[Any, ChangeOver] | None = None
        self._lanes: tuple[Any, LaneBatch | str] | None = None
        self._calls, self._point_calls = 0.0, USUAL_CALLS
        #: Numbers of the model, and the places of those that have differed in a point.
        self._numbers, self._varied = numbers_of(evaluator), np.zeros(0, dtype=np.int64)
        none = np.zeros(0, dtype=np.int64)
        self.run(Starts(np.zeros((0, 0)), none, y0[None][:0]))  # to compile it

    @property
    def lanes(self) -> "LaneBatch | str | None":
        """What ran points in lanes of vectors; in words why none; None where none was needed."""
        return None if self._lanes is None else self._lanes[1]

    def _lanes_for(self, point: Starts) -> "LaneBatch | str":
        """What runs many points in lanes; in words why they are run one by one.

        point: one that is run to see the ways of projections.
        """
        from dap3d_core.study.batch.lanes import LaneBatch, reason_against, wide_rates

        key = id(self.evaluator.system), self._varied.tobytes()
        if self._lanes is None or self._lanes[0] != key:
            found: LaneBatch | str = reason_against(self.evaluator, self._place[1].size)
            if not found:
                varied = varied_at(self.evaluator.system, self._varied)
                projects = self.integration.work.projects != 0
                states = self._states_of_run(self.points(point)) if projects else []
                wide = wide_rates(self.evaluator, *self._place, varied, states)
                found = (
                    wide
                    if isinstance(wide, str)
                    else LaneBatch(self.evaluator, wide, self._lane_works, self._begin)
                )
            self._lanes = key, found
        return self._lanes[1]

    def _states_of_run(self, point: driver.Points) -> list[Floats]:
        """Some states in the course of the run of one point, as projections were given them."""
        *arguments, _ = self.arguments(point)
        states: list[Floats] = []
        calls = FIRST_CALLS
        with np.errstate(all="ignore"):  # as compiled code does
            while point.at[driver.POINT] == 0:
                driver.run_points(*arguments, calls)
                states.append(self.integration.trial)
                if len(states) > MOST_STATES:
                    states, calls = states[1::2], 2 * calls
        return [*states, off_constraints(self.integration.y)]

    @property
    def _place(self) -> tuple[float, Floats]:
        """Time and state where branches of programs are decided."""
        return self.integration.t, self.integration.trial

    def _programs_for(self, points: driver.Points) -> ChangeOver:
        """Programs of the scene in which numbers that differ from point to point are loaded."""
        if len(points.table):  # their constants are those of a point, whatever was loaded last
            driver.set_numbers(points, 0, self.evaluator.system)
        differ = points.places[np.any(points.table != self._numbers[points.places], axis=0)]
        self._varied = np.union1d(self._varied, differ)
        key = id(self.evaluator.system), self._varied.tobytes()
        if self._programs is None or self._programs[0] != key:
            varied = varied_at(self.evaluator.system, self._varied)
            self._programs = key, ChangeOver(self.evaluator, varied)
        return self._programs[1]

    def _is_long(self, count: int) -> bool:
        """True if so many points are worth lanes."""
        calls = self._calls + count * self._point_calls
        enough = calls * self.evaluator.model.body_count >= BEFORE_LANES
        return count >= LEAST_IN_LANES and enough

    def _lane_works(self, count: int) -> list[RungeKuttaState]:
        """States of as many integrations as this one's."""
        works = [self._make().work for _ in range(count)]
        for work in works:
            work.tolerance[:] = self.integration.work.tolerance
        return works

    def points(self, starts: Starts) -> driver.Points:
        """Points to run."""
        table, places, y0, start, sizes = starts
        count, nt = len(table), len(self.integration.work.rows)
        diagnostics = np.zeros((count, driver.COLUMNS))
        diagnostics[:, initial_state.SIZE] = sizes
        own = not self.evaluator.coordinates.are_of_bodies
        return driver.Points(
            at=np.array([0, 0, start, own], dtype=np.int64),
            places=np.ascontiguousarray(places, dtype=np.int64),
            table=np.array(table, dtype=float, order="C"),
            y0=np.array(y0, dtype=float),
            rows=np.empty((count * nt, self.evaluator.model.row_layout["inputs"].start)),
            diagnostics=diagnostics,
            **self.constants,
        )

    def arguments(self, points: driver.Points) -> tuple[Any, ...]:
        """Arguments of ``driver.run_points``."""
        of, tables = self.evaluator, (self.evaluator.functions, _drives(), self._begin)
        return points, self.integration.work, *tables, of.system, of.loops, CALL

    def run(self, starts: Starts) -> BatchRows:
        """Run points."""
        work, count = self.integration.work, len(starts.table)
        points = self.points(starts)
        diagnostics = points.diagnostics
        arguments = self.arguments(points)
        programs = self._programs_for(points)

        def run(call: Callable[[], Any], *, needs_programs: bool = False) -> None:
            with np.errstate(all="ignore"):  # as compiled code does
                if jit_is_on() and count:
                    addresses = self.evaluator.functions.addresses
                    programs.call(
                        call, addresses, lambda: self._place, counts, needs_programs=needs_programs
                    )
                else:
                    call()

        def counts() -> tuple[int, int, int]:
            columns = driver.CALLS, driver.TAKEN, driver.ROWS
            calls, steps, reports = diagnostics[:, columns].sum(axis=0).astype(int).tolist()
            return calls + work.rhs_count, steps + work.step_count, reports + work.report_count

        may_take_lanes = self.takes_lanes and starts.start != driver.CORRECT_ONLY
        if may_take_lanes and self._is_long(count):
            from dap3d_core.formulations.programs.scene_program import reads_rates

            lanes = self._lanes_for(starts.take(slice(1)))
            if not isinstance(lanes, str) and lanes.is_ready:
                run(lambda: lanes.run(points, CALL), needs_programs=reads_rates(self.evaluator))
        while True:
            run(lambda: driver.run_points(*arguments))
            if points.at[driver.POINT] == count:
                break
        if count:
            self.last_start = points.y0[-1]
            self._calls += float(np.sum(diagnostics[:, driver.CALLS]))
            self._point_calls = float(np.mean(diagnostics[:, driver.CALLS]))
        return self.rows_of(points, starts.y0)

    def rows_of(self, points: driver.Points, given: Floats) -> BatchRows:
        """Rows of points that were run; given: the states that were given."""
        rows, diagnostics = points.rows, points.diagnostics
        rows = rows.reshape(len(diagnostics), len(self.integration.work.rows), rows.shape[1])
        done = diagnostics[:, driver.ENDED] == Status.FINISHED
        return BatchRows(done, rows, given, points.y0, diagnostics)


def arrays_of_numbers(evaluator: Evaluator) -> list[Floats]:
    """Arrays of a model's numbers: par, body, metric and, where there is a tree, its constants."""
    s = evaluator.system
    return [s.par, s.body, s.metric, *([] if s.tree is None else [s.tree.constants])]


def numbers_of(evaluator: Evaluator) -> Floats:
    """The numbers of a model, all of them."""
    return np.concatenate([array.ravel() for array in arrays_of_numbers(evaluator)])


def varied_at(system: System, places: Integers) -> dict[str, Integers]:
    """Members of a system in which numbers at some places (``numbers_of``) stand, and where."""
    found, first = {}, 0
    for name in ("par", "body", "metric", "tree.constants"):
        array = getattr(system.tree, "constants", None) if "." in name else getattr(system, name)
        if array is not None:
            here = (first <= places) & (places < first + array.size)
            found[name], first = places[here] - first, first + array.size
    return found


def start_constants(evaluator: Evaluator, room: int = 0) -> dict[str, Floats]:
    """What compiled code makes a start with: for displacements in m and rad, and for corrections.

    ``unit`` are constants of a metric; ``starting`` are arguments of initial_state.py, with room
    for as many numbers more.
    """
    model, first = evaluator.model, initial_state.STARTING
    starting = np.zeros(first + evaluator.plan.row_size + room)
    starting[initial_state.SIZE] = model.size  # points of a batch have sizes of their own
    starting[first + evaluator.system.row[np.flatnonzero(~model.position_row)]] = 1.0
    return {"unit": np.array([model.length, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), "starting": starting}


@cache
def begin_functions(formulation: Formulation) -> Any:
    """Compiled functions that store the references of a start, and correct it."""
    if formulation.has_own_coordinates:
        from dap3d_core.study.batch.initial_state import begin_tree, state_of_bodies

        return step_functions(begin_tree, begin_tree, state_of_bodies)  # none corrects a start
    if not formulation.needs_joints:
        return step_functions(initial_state.begin_free)
    redundant = formulation.accepts_redundant
    begin = initial_state.begin_regularised if redundant else initial_state.begin_standard
    return step_functions(begin, initial_state.assemble_start)


@cache
def _drives() -> Any:
    """The integrator, by its address: compiled code that calls it has no copy of it."""
    return table_of(_DRIVE, (advance,))


class TreePoints:
    """Runs points whose poses at the start are those of the scene. Not for two threads at once."""

    def __init__(self, batch: CompiledBatch, start: InitialState, make_other: MakeBatch) -> None:
        """Args: what runs the points; start of the scene; makes what corrects velocities."""
        self._batch, self._u, self._make_other = batch, start.u, make_other

    @cached_property
    def _other(self) -> CompiledBatch:
        return self._make_other()

    def run(self, starts: Starts) -> BatchRows:
        """As ``CompiledBatch.run``; states (k, 13 n + 1), also those returned, are of bodies.

        Points whose correction moves bodies from where they start in the scene are not done.
        """
        coordinates = self._batch.evaluator.coordinates
        assert isinstance(coordinates, TreeCoordinates)
        first = coordinates.start(self._u)
        table, places, y0, start, sizes = starts
        if start == driver.UNCORRECTED:
            y = np.repeat(first[None], len(table), axis=0)
            return self._batch.run(starts._replace(y0=y))._replace(given=y0, y0=y0)
        known = places < len(numbers_of(self._other.evaluator))
        to_correct = Starts(table[:, known], places[known], y0, driver.CORRECT_ONLY, sizes)
        corrected = self._other.run(to_correct)
        y = coordinates.starts(self._u, u_from_y(corrected.y0))
        rows = self._batch.run(Starts(table, places, y))
        rows.diagnostics[:, :STARTING] = corrected.diagnostics[:, :STARTING]
        moved, turned = distance(
            u_from_y(corrected.y0), self._u, self._batch.evaluator.model.body_count
        )
        stays = np.maximum(moved / self._batch.size, turned) <= SMALL_CORRECTION
        done = rows.done & corrected.done & stays
        return BatchRows(done, rows.rows, y0, corrected.y0, rows.diagnostics)
