"""Runs of one scene with other numbers: what a study does at its points."""

import threading
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.integrators import EXPLICIT, INTEGRATORS
from dap3d_core.result import INFORMATION, Result
from dap3d_core.scene import Scene, SceneError
from dap3d_core.simulation import CompiledModel, SimulationError, report_times, simulate
from dap3d_core.study.outputs import Output
from dap3d_core.study.parameters import Number, numbers_named, with_values
from dap3d_core.study.reduction import Reduction

Floats = NDArray[np.float64]
Announce = Callable[[str], None]

#: Numbers of rows that are kept at once, at most: 64 MB.
ROW_NUMBERS = 8_000_000


class PointStatus(IntEnum):
    """How the run at a point of a study ended."""

    OPEN = 0  # not run so far
    DONE = 1
    STOPPED = 2  # early: outputs are of what was computed
    FAILED = 3  # it could not begin: outputs are NaN


@attrs.frozen
class Study:
    """What is to be done at each point: data alone, which other processes can be sent.

    Attributes:
        scene: with the settings of the runs in its ``simulation``.
        names: dotted names of the numbers that vary.
        outputs: what is kept.
        allow_code: whether the model's own types may be loaded.
        pack: points that take their steps together, where the scene allows it: faster, and equal to
            single runs within the tolerances only.
    """

    scene: Scene
    names: tuple[str, ...]
    outputs: tuple[Output, ...]
    allow_code: bool = False
    pack: int = 1


@attrs.frozen(eq=False)
class Batch:
    """What came of some points.

    Attributes:
        status: (k,) of each, see ``PointStatus``.
        notes: what there is to say of each, "" for nothing.
        values: name of an output -> (k,), or (k, nt) of a series; NaN where there is none.
    """

    status: NDArray[np.int8]
    notes: tuple[str, ...]
    values: dict[str, Floats]


class Ensemble:
    """The compiled model of a study, which runs its points. Threads may use one at once.

    Points run many in one compiled call (study/batch/driver.py) that lets other threads go on. A
    point that does not go to its end there, or that cannot be run so, is run by ``simulate``, which
    says why. Both give the same numbers, bit for bit, whichever points are run together.

    Attributes:
        asked, study: the study as asked for, and as it is run: where nothing but ends is kept,
            runs report their end alone.
        compiled: the model, with the numbers as the scene gives them.
        numbers: those that vary.
        outputs: those of the study, each vector in its components.
        labels, units: of each output, by name.
        times: (nt,) reporting times.
    """

    def __init__(self, study: Study, announce: Announce | None = None) -> None:
        """Compile what the points share.

        Raises:
            SceneError: an unknown name, an unknown output, or mistakes of the scene.
        """
        self.asked, self.study = study, _at_the_end_alone(study)
        study = self.study
        allow = study.allow_code
        self.compiled = CompiledModel(study.scene, allow_code=allow, announce=announce)
        self.numbers: tuple[Number, ...] = numbers_named(self.compiled.checked, study.names)
        settings = study.scene.simulation
        self.times = report_times(settings.t_end, settings.dt)
        self.reduction = Reduction(self.compiled, self.numbers, study.outputs)
        self.outputs = self.reduction.outputs
        self.labels, self.units = self.reduction.labels, self.reduction.units
        self._own = threading.local()
        integrator = INTEGRATORS.get(settings.integrator, EXPLICIT)
        self._together = integrator.one_step and not any(
            number.table == "simulation" for number in self.numbers
        )

    def prepare(self, announce: Announce | None = None) -> None:
        """Compile what runs the points now: threads would wait for one another.

        Args:
            announce: called with what has to be compiled anew.
        """
        self._runner()

    def run(self, points: ArrayLike) -> Batch:
        """Run points (k, numbers): the values of the numbers at each."""
        values = np.asarray(points, dtype=float).reshape(-1, len(self.numbers))
        batch = self._empty(len(values))
        notes = [""] * len(values)
        together = self._runner()
        if together is not None:
            for part in self._parts(len(values)):
                together.run(values[part], batch, part, notes)
        for k in np.flatnonzero(batch.status == PointStatus.OPEN):
            notes[k] = self._run_one(int(k), values[k], batch)
        return attrs.evolve(batch, notes=tuple(notes))

    def result(self, point: Sequence[float]) -> Result:
        """The whole result of one point, as ``simulate`` gives it; errors as of that."""
        return self._result(self.asked.scene, point)

    def _result(self, scene: Scene, point: Sequence[float]) -> Result:
        scene = with_values(scene, self.numbers, point)
        registry = self.compiled.checked.registry
        return simulate(CompiledModel(scene, registry=registry))

    def _runner(self) -> Any:
        """What runs many points of this thread in one call; None where nothing does."""
        if not hasattr(self._own, "runner"):
            from dap3d_core.study.batch.batch import together

            self._own.runner = together(self) if self._together else None
        return self._own.runner

    def _parts(self, count: int) -> list[slice]:
        width = 2 + 20 * self.compiled.model.body_count + self.compiled.model.row_count + 4
        most = max(1, ROW_NUMBERS // (width * len(self.times)))
        return [slice(first, min(first + most, count)) for first in range(0, count, most)]

    def _empty(self, count: int) -> Batch:
        nt = len(self.times)
        return Batch(
            status=np.zeros(count, dtype=np.int8),
            notes=(),
            values={
                output.name: np.full((count, nt) if output.reduction == "series" else count, np.nan)
                for output in self.outputs
            },
        )

    def _run_one(self, k: int, point: Floats, batch: Batch) -> str:
        """Run a point by itself; its outputs into place k, and its note."""
        result: Result | None
        try:
            result = self._result(self.study.scene, point.tolist())
            status, note = PointStatus.DONE, self._note(result)
        except (SceneError, SimulationError) as error:
            result = getattr(error, "result", None)
            status = PointStatus.FAILED if result is None else PointStatus.STOPPED
            note = " ".join(str(error).split())
        batch.status[k] = status
        if result is not None:
            note = self.keep(k, result, self.outputs, batch) or note
        return note

    def keep(self, k: int, result: Result, outputs: Sequence[Output], batch: Batch) -> str:
        """Outputs of a result into place k; why the point failed there, "" where it did not."""
        try:
            for output in outputs:
                value = np.atleast_1d(output.value(result))
                if output.reduction == "series":
                    batch.values[output.name][k, : len(value)] = value
                else:
                    batch.values[output.name][k] = value[0]
        except SimulationError as error:  # a function of the user's
            batch.status[k] = PointStatus.FAILED
            for output in self.outputs:
                batch.values[output.name][k] = np.nan
            return str(error)
        return ""

    def _note(self, result: Result) -> str:
        """The warnings of a run that the scene as given does not have."""
        known = {*self.compiled.notes, f"method {self.compiled.method}: {self.compiled.reason}"}
        own = [n for n in result.notes if not n.startswith((INFORMATION, "method "))]
        return "; ".join(note for note in own if note not in known)


def _at_the_end_alone(study: Study) -> Study:
    """The study; its runs report at their end alone where nothing else is asked for."""
    settings = study.scene.simulation
    if any(output.reduction != "end" for output in study.outputs) or "simulation.dt" in study.names:
        return study
    if not INTEGRATORS.get(settings.integrator, EXPLICIT).adaptive or not settings.t_end:
        return study
    scene = study.scene.copy()
    scene.simulation.dt = None if "simulation.t_end" in study.names else settings.t_end
    return attrs.evolve(study, scene=scene)
