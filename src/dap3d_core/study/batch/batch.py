"""Runs points in compiled batches; points that cannot be batched are left open."""

import contextlib
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dap3d_core.assembly.arrays import EVEN, LENGTH, WEAK
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.switches import effects_of
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.note import warnings_of
from dap3d_core.scene import SceneError, ValidatedScene, check
from dap3d_core.simulation import AssemblyError, CompiledModel
from dap3d_core.simulation.failure.monitors import UnilateralMonitor
from dap3d_core.simulation.initial.assemble import (
    SMALL_CORRECTION,
    Initial,
    correction_notes,
    distance,
)
from dap3d_core.simulation.initial.breakpoints import stops_of
from dap3d_core.simulation.initial.tolerances import resolved_atol
from dap3d_core.simulation.initial.undefined_directions import undefined_directions
from dap3d_core.simulation.initial_state import InitialState, find_start, start_notes
from dap3d_core.study.batch import driver, initial_state
from dap3d_core.study.batch.compiled_batch import BatchRows, CompiledBatch, Starts, numbers_of
from dap3d_core.study.batch.parameter_map import Booleans, NotCopiedError, ParameterMap
from dap3d_core.study.outputs import Reduction
from dap3d_core.study.parameters import SceneParameter, with_values
from dap3d_core.study.study import Batch, PointStatus

if TYPE_CHECKING:
    from dap3d_core.study.batch.compiled_batch import TreePoints
    from dap3d_core.study.batch.slopes import DifferentiatedBatch


def batch_runner(reduction: Reduction, times: Floats) -> "BatchRunner | None":
    """A batch runner for this thread; None where the scene as given cannot start, or is to start at
    rest.

    Each point is then run individually, which searches its equilibrium, or reports what is wrong.
    """
    compiled = reduction.compiled
    settings = compiled.scene.simulation
    if settings.start != "scene":
        return None
    if any(switch.jumps for switch in compiled.evaluator.switches):
        return None  # velocities that jump are changed between compiled calls
    evaluator, collisions = compiled.evaluator, compiled.model.collisions
    if collisions is not None or integrator_named(settings.integrator).steps_contacts:
        return None  # so are those of contacts by stepping
    if compiled.model.breaks or not evaluator.coordinates.suits_batches:
        return None
    try:
        start = compiled.start(bool(settings.correct), settings.hold, str(settings.correct_metric))
    except (AssemblyError, SceneError):
        return None
    redundancy = start.redundancy
    takes_rows = not redundancy.rank.redundant or compiled.evaluator.formulation.accepts_redundant
    if not redundancy.is_plain or not takes_rows:
        return None
    if redundancy.rank.redundant and compiled.model.iterated_forces:
        return None  # a run judges whether they read what is not unique
    return BatchRunner(start, reduction, times)


class BatchRunner:
    """Runs points of one scene in compiled batches. Not for two threads at once.

    Attributes:
        parameter_map: puts values of parameters into the arrays of the model; None where each point
            needs a model of its own.
        compiled_batch: runs points.
    """

    def __init__(self, start: InitialState, reduction: Reduction, times: Floats) -> None:
        """Args: the start of the scene as given; reduction and times of the ensemble."""
        self._start, self._reduction, self._times = start, reduction, times
        compiled = self._compiled = reduction.compiled
        parameters = reduction.parameters
        evaluator = compiled.new_evaluator()
        end = float(times[-1])
        stops = compiled.breakpoints(end).stops
        self._rebuilder = ModelRebuilder(compiled, evaluator, parameters, end)
        self.compiled_batch = CompiledBatch(evaluator, compiled.scene.simulation, times, stops)
        self._runs = self._point_runs(start)
        self._pulling = UnilateralMonitor(compiled.model)
        self._differentiated: DifferentiatedBatch | None = None
        self.parameter_map: ParameterMap | None = None
        with contextlib.suppress(NotCopiedError):
            parameter_map = ParameterMap(compiled.checked, evaluator, parameters)
            has_start = evaluator.coordinates.are_of_bodies or parameter_map.keeps_poses
            if not compiled.model.length == evaluator.time == 1.0:
                has_start = False  # weights of rows follow the poses, tolerances the motion
            if has_start and (not parameter_map.moves_start or self._has_compiled_correction()):
                self.parameter_map = parameter_map

    def _point_runs(self, start: InitialState) -> "CompiledBatch | TreePoints":
        """What runs mapped points one by one, from states in coordinates of bodies."""
        batch, compiled = self.compiled_batch, self._compiled
        if batch.evaluator.coordinates.are_of_bodies:
            return batch
        from dap3d_core.study.batch.compiled_batch import TreePoints

        def of_bodies() -> CompiledBatch:
            return CompiledBatch(
                Evaluator(compiled.model, "standard"),
                compiled.scene.simulation,
                self._times,
                compiled.breakpoints(float(self._times[-1])).stops,
            )

        return TreePoints(batch, start, of_bodies)

    def run(self, values: Floats, batch: Batch, first: int) -> None:
        """Run points (k, d), and store those that reach their end in a batch from ``first`` on."""
        if self.parameter_map is not None:
            which, rows = self._run_mapped(self.parameter_map, values)
        else:
            which, start, notes = self._rebuilt(values)
            for k, note in zip(first + which, notes, strict=True):
                batch.notes[k] = note
            rows = self.compiled_batch.run(start)
        good = self._good(rows)
        which = which[good]
        self._note_corrections(rows, np.flatnonzero(good), first + which, batch.notes)
        batch.status[first + which] = PointStatus.DONE
        self._reduce(values[which], first + which, rows.rows[good], batch)

    def _run_mapped(
        self, parameter_map: ParameterMap, values: Floats
    ) -> tuple[Integers, BatchRows]:
        """Run points by the parameter map: indices of those that were run, and their rows."""
        self._refer_to_start()
        start, valid = self._mapped_starts(parameter_map, values)
        which = np.flatnonzero(valid)
        start = start.take(which)
        rows = self._runs.run(start)
        if parameter_map.moves:
            is_undefined = parameter_map.are_undefined(start.table, rows.y0, start.sizes)
            rows.done[is_undefined] = False
        return which, rows

    def _refer_to_start(self) -> None:
        """Let the numbers of a tree refer to the start of the scene."""
        self.compiled_batch.evaluator.coordinates.start(self._start.u)

    def _mapped_starts(
        self, parameter_map: ParameterMap, values: Floats, *, is_checked: bool = True
    ) -> tuple[Starts, Booleans]:
        """Starts of points (k, p) by the parameter map; those that the scene's check accepts.

        is_checked: as of ``ParameterMap.table``.
        """
        table, valid = parameter_map.table(values, is_checked=is_checked)
        model, moves_start = self._compiled.model, parameter_map.moves_start
        if moves_start:
            y0 = parameter_map.states(values, model.u0)
        else:
            y0 = self.compiled_batch.evaluator.integrated(self._start.u)[None]
            y0 = np.repeat(y0, len(values), axis=0)
        parameter_map.set_states(y0, values)
        start = driver.CORRECT if moves_start and model.row_count else driver.UNCORRECTED
        sizes = parameter_map.sizes(values)
        return Starts(table, parameter_map.places, y0, start, sizes), valid

    def _copied_starts(self, parameter_map: ParameterMap, values: Floats) -> Starts:
        """Starts of points (k, p) in coordinates of the formulation."""
        start, _ = self._mapped_starts(parameter_map, values, is_checked=False)
        coordinates = self.compiled_batch.evaluator.coordinates
        if coordinates.are_of_bodies:
            return start
        y0 = coordinates.start(self._start.u)
        return start._replace(y0=np.repeat(y0[None], len(values), axis=0))

    def _rebuilt_starts(self, values: Floats) -> Starts | None:
        """Starts of points (k, p) with models of their own; None where one cannot be run."""
        which, start, _ = self._rebuilt(values)
        return start if len(which) == len(values) else None

    def _rebuilt(self, values: Floats) -> tuple[Integers, Starts, list[str]]:
        """Indices of points that can be run with models of their own, their starts and notes."""
        points = [self._rebuilder.prepare(value) for value in values]
        self._rebuilder.restore()
        self.compiled_batch.evaluator.set_inputs(self._compiled.model.input_values)
        which = [k for k, point in enumerate(points) if point is not None]
        found = [point for point in points if point is not None]
        places = self._rebuilder.places
        table = np.array([point.table for point in found]).reshape(-1, len(places))
        y0 = np.array([point.y0 for point in found])
        y0 = y0.reshape(-1, self.compiled_batch.last_start.size)
        notes = ["; ".join(point.notes) for point in found]
        return np.array(which, dtype=np.int64), Starts(table, places, y0), notes

    def run_with_slopes(self, x: Floats, size: Floats) -> tuple[Floats, Floats] | None:
        """Rows (nt, width) of a point x (p,) and (nt, width, p) their derivatives.

        size: (p,) of the parameters. None where the point cannot be run so.
        """
        from dap3d_core.study.batch.slopes import (
            COPIES,
            MODELS,
            DifferentiatedBatch,
            starts_with_slopes,
        )
        from dap3d_core.study.sensitivities.sensitivities import directions_of

        by_map, batch = self.parameter_map, self.compiled_batch
        if by_map is None:
            found = starts_with_slopes(self._rebuilt_starts, x, size, *MODELS)
        else:
            if by_map.moves_start and not batch.evaluator.coordinates.are_of_bodies:
                return None
            self._refer_to_start()
            if not by_map.table(x[None])[1][0]:
                return None
            found = starts_with_slopes(partial(self._copied_starts, by_map), x, size, *COPIES)
        if found is None:
            return None
        if self._differentiated is None:
            self._differentiated = DifferentiatedBatch(batch, len(x), directions_of(len(x))[1])
        rows, slopes = self._differentiated.run(*found)
        start = found[0]
        if by_map is not None and by_map.moves:
            rows.done[by_map.are_undefined(start.table, rows.y0, start.sizes)] = False
        return (rows.rows[0], slopes) if self._good(rows)[0] else None

    def _good(self, rows: BatchRows) -> Booleans:
        """Points whose rows are those of a run alone; others are run individually, and noted."""
        multipliers = self._compiled.model.row_layout["Lam"].start
        good = rows.done & (rows.diagnostics[:, driver.FRICTION_FAILURES] == 0.0)
        return good & ~self._pulling.among(rows.rows[..., multipliers:])

    def _reduce(self, values: Floats, index: Integers, rows: Floats, batch: Batch) -> None:
        """Store the outputs of points with these rows (k, nt, width) in a batch."""
        reduction = self._reduction
        for name, of_rows in reduction.reduce(rows, self._times).items():
            batch.values[name][index] = of_rows
        others = [o for o in reduction.outputs if not reduction.of_rows[o.name]]
        for k, point, of_run in zip(index, values, rows, strict=True) if others else ():
            try:
                _, model = self._rebuilder.load(point)
            except (ModelError, ValueError):  # its joints move otherwise
                batch.status[k] = PointStatus.OPEN
                continue
            result = reduction.result(model, of_run, self.compiled_batch.evaluator, point)
            batch.store(int(k), result, others)
        if others:
            self._rebuilder.restore()

    def _note_corrections(
        self, rows: BatchRows, good: Integers, index: Integers, notes: list[str]
    ) -> None:
        """Warn of starts that were corrected by more than rounding."""
        evaluator = self.compiled_batch.evaluator
        large = (
            rows.diagnostics[good, initial_state.C_BEFORE]
            > SMALL_CORRECTION * rows.diagnostics[good, initial_state.SIZE]
        )
        good, index = good[large], index[large]
        moved, turned = distance(rows.given[good], rows.y0[good], evaluator.model.body_count)
        for j, k in enumerate(good):
            numbers = rows.diagnostics[k].tolist()
            initial = Initial(
                u=evaluator.model.u0,
                violation=(numbers[initial_state.C_BEFORE], numbers[initial_state.V_BEFORE]),
                residual=(numbers[initial_state.C_AFTER], numbers[initial_state.V_AFTER]),
                passes=int(numbers[initial_state.PASSES]),
                moved=float(moved[j]),
                turned=float(turned[j]),
            )
            messages = correction_notes(initial, evaluator, self._compiled.scene)
            notes[index[j]] = "; ".join(warnings_of(messages))

    def _has_compiled_correction(self) -> bool:
        """True if compiled code can correct a start: independent rows, metric "unit"."""
        settings, model = self._compiled.scene.simulation, self._compiled.model
        if not model.row_count or not settings.correct:
            return not model.row_count
        is_unit = str(settings.correct_metric) == "unit" and not settings.hold
        formulation = self._compiled.evaluator.formulation
        # the rows of a tree are independent, and none but they are run in batches
        return is_unit and (formulation.has_own_coordinates or not formulation.accepts_redundant)


class _RebuiltPoint(NamedTuple):
    """A point ready to run.

    Attributes:
        table: the numbers of its model (``numbers_of``).
        y0: (n,) the integrated state to start from.
        notes: warnings about its start.
    """

    table: Floats
    y0: Floats
    notes: tuple[str, ...]


class ModelRebuilder:
    """Rebuilds models of points, without compilation. It has an evaluator of its own."""

    def __init__(
        self,
        compiled: CompiledModel,
        evaluator: Evaluator,
        parameters: Sequence[SceneParameter],
        t_end: float,
    ) -> None:
        self._compiled, self._evaluator, self._parameters = compiled, evaluator, parameters
        self._t_end = t_end
        self._stops, self._terminal = (
            compiled.breakpoints(t_end).stops,
            effects_of(evaluator.switches),
        )
        settings = compiled.scene.simulation
        self._options = (bool(settings.correct), settings.hold, str(settings.correct_metric))
        self._rank = compiled.start(*self._options).redundancy.rank.rank
        self.places = np.arange(len(numbers_of(evaluator)))
        self._shared = self._structure()

    def load(self, point: Floats) -> tuple[ValidatedScene, Model]:
        """Load the model of a point into the evaluator.

        Raises:
            SceneError, ModelError: mistakes of the scene with these values.
            ValueError: its model has another structure.
        """
        scene = with_values(self._compiled.scene, self._parameters, point.tolist())
        checked = check(scene, self._compiled.checked.registry)
        model = build_model(checked)
        self._evaluator.load(model)
        return checked, self._evaluator.model

    def restore(self) -> None:
        """Load the model of the scene as given: points run with its scales and weights."""
        self._evaluator.load(self._compiled.model)

    def prepare(self, point: Floats) -> _RebuiltPoint | None:
        """A point as it starts; None where it cannot be run in a batch."""
        from dap3d_core.model.element_states import tolerances

        evaluator = self._evaluator
        try:
            checked, model = self.load(point)
            start = find_start(evaluator, *self._options)
        except (SceneError, ModelError, AssemblyError, ValueError):
            return None
        if start.redundancy.rank.rank != self._rank or not start.redundancy.is_plain:
            return None
        if model.state_count and not np.array_equal(
            tolerances(model.acting), tolerances(self._compiled.model.acting)
        ):
            return None  # the integration has those of the scene as given
        if stops_of(checked, model, self._t_end) != self._stops:
            return None
        if not np.array_equal(model.input_values, self._compiled.model.input_values):
            return None  # a batch shares the functions of time, and inputs stand with them
        if not np.array_equal(effects_of(evaluator.switches), self._terminal):
            return None
        if undefined_directions(checked.scene, model, start.u, evaluator.model.size):
            return None
        notes = start_notes(start, evaluator, checked.scene)
        warnings = tuple(warnings_of(notes))
        y0 = evaluator.coordinates.start(start.u)  # before the numbers: they hold its reference
        if self._structure() != self._shared:
            return None
        return _RebuiltPoint(numbers_of(evaluator), y0, warnings)

    def _structure(self) -> bytes:
        """What points share: scales, weights, tolerances, flags of masses, the nodes of a tree."""
        system, given = self._evaluator.system, self._compiled.scene.simulation.atol
        nodes = system.tree.nodes.tobytes() if system.tree is not None else b""
        shared = system.settings[[LENGTH, EVEN, WEAK]].tobytes() + system.weight.tobytes() + nodes
        return bytes(shared + repr(resolved_atol(given, self._evaluator)).encode())
