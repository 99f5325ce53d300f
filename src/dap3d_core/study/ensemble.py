"""Runs the points of a study."""

import threading
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import attrs
import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.model.groups import Floats
from dap3d_core.result import Computed, Result
from dap3d_core.result.note import warnings_of
from dap3d_core.scene import Scene, SceneError
from dap3d_core.simulation import CompiledModel, SimulationError, report_times, simulate
from dap3d_core.study.differences import OFFSETS, change_along, motion_of, weights_of
from dap3d_core.study.outputs import Reduction
from dap3d_core.study.parameters import SceneParameter, parameters_named, with_values
from dap3d_core.study.study import Batch, PointStatus, Study, derivative_name

if TYPE_CHECKING:
    from dap3d_core.study.batch.batch import BatchRunner

#: Largest number of values in the rows of one compiled call: 64 MB.
MAX_ROW_VALUES = 8_000_000


class Ensemble:
    """The compiled model of a study, which runs its points; threads may share it.

    Points run in compiled batches (study/batch), which release the lock of the interpreter. A point
    that cannot be run so, or does not reach its end there, is run by ``simulate``, which reports
    why. Both give the same values, bit for bit, whichever points are run together.

    Attributes:
        requested, study: the study as requested, and as executed: where only values at the end are
            needed, runs report their end alone.
        compiled: the model of the scene as given.
        parameters: those that vary.
        outputs: those of the study, each vector in its components.
        labels, units: of each output, by name.
        times: (nt,) reporting times.
    """

    def __init__(self, study: Study, announce: Callable[[str], None] | None = None) -> None:
        """Compile what the points share.

        Raises:
            SceneError: an unknown name, an unknown output, or mistakes of the scene.
        """
        self.requested, self.study = study, _with_end_alone(study)
        self._compile(announce, None)
        if self.compiled.requested_method == "auto" and self.compiled.method == "joint":
            runner = self._runner()
            if runner is None or runner.parameter_map is None:  # a tree for each point costs more
                self._compile(announce, False)

    def _compile(self, announce: Callable[[str], None] | None, joint: bool | None) -> None:
        """Compile the scene; joint: as of ``CompiledModel``."""
        scene, allow_code = self.study.scene, self.study.allow_code
        self.compiled = CompiledModel(scene, allow_code=allow_code, announce=announce, joint=joint)
        self._joint = joint
        self.parameters: tuple[SceneParameter, ...] = parameters_named(
            self.compiled.checked, self.study.names
        )
        settings = scene.simulation
        self.times = report_times(settings.t_end, settings.dt)
        self.reduction = Reduction(self.compiled, self.parameters, self.study.outputs)
        self.outputs = self.reduction.outputs
        self.labels, self.units = self.reduction.labels, self.reduction.units
        self._of_thread = threading.local()
        is_plain = not any(parameter.table == "simulation" for parameter in self.parameters)
        one_step = integrator_named(settings.integrator).one_step
        self._takes_batches = one_step and is_plain and not self.study.gradients
        if self.study.gradients:
            from dap3d_core.study.sensitivities.sensitivities import check_differentiable

            check_differentiable(self.parameters, "vary")

    def prepare(self) -> None:
        """Compile the code of batches in advance: threads would wait for one another."""
        self._runner()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes, for information, on how points are run."""
        runner = self._runner()
        if runner is None:
            return ("each point is run alone",)
        lanes = runner.compiled_batch.lanes
        if lanes is None:
            return ("points are run one by one: they are few",)
        if isinstance(lanes, str):
            return (f"points are run one by one: {lanes}",)
        return (f"points are run in {lanes.count} lanes of a vector",)

    def run(self, points: ArrayLike) -> Batch:
        """Run points (k, parameters): the values of the parameters at each."""
        values = np.asarray(points, dtype=float).reshape(-1, len(self.parameters))
        p = len(self.parameters) if self.study.gradients else 0
        batch = Batch.empty(self.outputs, len(values), len(self.times), p)
        runner = self._runner()
        if runner is not None:
            width = 2 + 20 * self.compiled.model.body_count + self.compiled.model.row_count + 4
            most = max(1, MAX_ROW_VALUES // (width * len(self.times)))
            for first in range(0, len(values), most):
                runner.run(values[first : first + most], batch, first)
        for k in np.flatnonzero(batch.status == PointStatus.OPEN):
            self._run_one(int(k), values[k], batch)
        return batch

    def series_with_slopes(
        self, point: Floats, size: Floats
    ) -> dict[str, tuple[Floats, Floats]] | None:
        """Output -> (nt,) its series at a point (p,) and (nt, p) its derivatives, of one run.

        size: (p,) of the parameters. None where the run fails, or has no derivatives.
        """
        runner, of = self._runner(), self.reduction
        if not self.is_differentiable:
            return None
        if runner is None or not all(of.of_rows.values()):
            return self._series_of_run(point)
        found = runner.run_with_slopes(point, size)
        if found is None:
            return self._series_of_run(point)
        rows, slopes = found
        motion, p = motion_of(self.compiled.model.body_count), len(point)
        ways = [change_along(rows[:, motion], slopes[:, motion, j]) or 1.0 for j in range(p)]
        along = np.moveaxis(slopes * ways, -1, 0)
        changed = [rows + k * along for k in OFFSETS[0]]
        series = of.reduce(np.concatenate([rows[None], *changed]), self.times)
        weights = weights_of(OFFSETS[0])
        return {
            name: (
                values[0],
                np.tensordot(weights, (values[1:] - values[0]).reshape(len(weights), p, -1), 1).T
                / ways,
            )
            for name, values in series.items()
        }

    def _series_of_run(self, point: Floats) -> dict[str, tuple[Floats, Floats]] | None:
        """As ``series_with_slopes``, of a run with a model of its own."""
        from dap3d_core.study.sensitivities.sensitivities import sensitivities

        try:
            found = sensitivities(self._model(self.study.scene, point.tolist()), self.study.names)
        except (SceneError, SimulationError):
            return None
        return {o.name: (o.value(found.result), found.of(str(o.of))) for o in self.outputs}

    @cached_property
    def is_differentiable(self) -> bool:
        """True if code is compiled and has derivatives by all parameters."""
        from dap3d_core.study.sensitivities.sensitivities import no_derivative

        return jit_is_on() and not any(map(no_derivative, self.parameters))

    def result(self, point: Sequence[float]) -> Result:
        """The whole result of one point, as ``simulate`` gives it; errors as of that."""
        return simulate(self._model(self.requested.scene, point))

    def _model(self, scene: Scene, point: Sequence[float]) -> CompiledModel:
        changed = with_values(scene, self.parameters, point)
        registry = self.compiled.checked.registry
        return CompiledModel(changed, registry=registry, joint=self._joint)

    def _with_derivatives(self, k: int, point: Floats, batch: Batch) -> Result:
        """The result of one point; stores the derivatives of its outputs."""
        from dap3d_core.study.sensitivities.sensitivities import sensitivities

        found = sensitivities(self._model(self.study.scene, point.tolist()), self.study.names)
        parts = [np.atleast_1d(output.value(found.result)) for output in self.outputs]
        slopes = found.derivative(
            lambda result: np.concatenate([np.atleast_1d(o.value(result)) for o in self.outputs])
        )
        ends = np.cumsum([len(part) for part in parts])[:-1]
        for output, slope in zip(self.outputs, np.split(slopes, ends), strict=True):
            stored = batch.values[derivative_name(output.name)]
            stored[k] = slope if output.reduction == "series" else slope[0]
        return found.result

    def _runner(self) -> "BatchRunner | None":
        """The batch runner of this thread; None where points have to be run individually."""
        if not hasattr(self._of_thread, "runner"):
            self._of_thread.runner = None
            if self._takes_batches:
                from dap3d_core.study.batch.batch import batch_runner

                self._of_thread.runner = batch_runner(self.reduction, self.times)
        return self._of_thread.runner

    def _run_one(self, k: int, point: Floats, batch: Batch) -> None:
        """Run one point by ``simulate`` and store its status, note and outputs."""
        result: Result | None
        try:
            if self.study.gradients:
                result = self._with_derivatives(k, point, batch)
            else:
                result = simulate(self._model(self.study.scene, point.tolist()))
            status, note = PointStatus.DONE, self._note(result)
        except (SceneError, SimulationError) as error:
            result = Computed.of(error).result
            status = PointStatus.FAILED if result is None else PointStatus.STOPPED
            note = " ".join(str(error).split())
        batch.status[k], batch.notes[k] = status, note
        if result is not None:
            batch.store(k, result, self.outputs)

    def _note(self, result: Result) -> str:
        """The warnings of a run that the scene as given does not have."""
        known = self.compiled.notes
        own = (n for n in warnings_of(result.notes) if not n.startswith("method "))
        return "; ".join(note for note in own if note not in known)


def _with_end_alone(study: Study) -> Study:
    """The study, with runs that report only their end where all outputs are values at the end."""
    settings = study.scene.simulation
    if any(output.reduction != "end" for output in study.outputs) or "simulation.dt" in study.names:
        return study
    if not integrator_named(settings.integrator).adaptive or not settings.t_end:
        return study
    scene = study.scene.copy()
    scene.simulation.dt = None if "simulation.t_end" in study.names else settings.t_end
    return attrs.evolve(study, scene=scene)
