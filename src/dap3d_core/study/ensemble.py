"""Runs of one scene with other numbers: what a study does at its points."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.result import Record, Result, ResultError, UnknownNameError
from dap3d_core.scene import Mistake, Scene, SceneError
from dap3d_core.simulation import CompiledModel, SimulationError, report_times, simulate
from dap3d_core.study.names import Number, numbers_named, with_values
from dap3d_core.study.outputs import Output

Floats = NDArray[np.float64]
Announce = Callable[[str], None]


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
    """

    scene: Scene
    names: tuple[str, ...]
    outputs: tuple[Output, ...]
    allow_code: bool = False


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

    Attributes:
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
        self.study = study
        allow = study.allow_code
        self.compiled = CompiledModel(study.scene, allow_code=allow, announce=announce)
        self.numbers: tuple[Number, ...] = numbers_named(self.compiled.checked, study.names)
        settings = study.scene.simulation
        self.times = report_times(settings.t_end, settings.dt)
        self.labels: dict[str, str] = {}
        self.units: dict[str, str] = {}
        self.outputs = self._expanded(study.outputs)
        self._refuse_series_of_other_length()

    def run(self, points: ArrayLike) -> Batch:
        """Run points (k, numbers): the values of the numbers at each."""
        values = np.asarray(points, dtype=float).reshape(-1, len(self.numbers))
        batch = self._empty(len(values))
        notes = [self._run_one(k, point, batch) for k, point in enumerate(values)]
        return attrs.evolve(batch, notes=tuple(notes))

    def _empty(self, count: int) -> Batch:
        nt = len(self.times)
        return Batch(
            status=np.zeros(count, dtype=np.int8),
            notes=("",) * count,
            values={
                output.name: np.full((count, nt) if output.reduction == "series" else count, np.nan)
                for output in self.outputs
            },
        )

    def _run_one(self, k: int, point: Floats, batch: Batch) -> str:
        """Run a point by the ordinary door; its outputs into place k, and its note."""
        note = ""
        result: Result | None
        try:
            result, status = self.result(point.tolist()), PointStatus.DONE
        except (SceneError, SimulationError) as error:
            found = getattr(error, "result", None)
            note = " ".join(str(error).split())
            status = PointStatus.FAILED if found is None else PointStatus.STOPPED
            result = found
        batch.status[k] = status
        if result is not None:
            for output in self.outputs:
                value = np.atleast_1d(output.value(result))
                if output.reduction == "series":
                    batch.values[output.name][k, : len(value)] = value
                else:
                    batch.values[output.name][k] = value[0]
        return note

    def result(self, point: Sequence[float]) -> Result:
        """The whole result of one point, as ``simulate`` gives it; errors as of that."""
        scene = with_values(self.study.scene, self.numbers, point)
        compiled = CompiledModel(
            scene, allow_code=self.study.allow_code, registry=self.compiled.checked.registry
        )
        return simulate(compiled)

    def _expanded(self, asked: Sequence[Output]) -> tuple[Output, ...]:
        """Outputs with each vector in its components; labels and units are noted."""
        probe = self._probe()
        found: list[Output] = []
        mistakes: list[Mistake] = []
        for output in asked:
            if callable(output.of):
                found.append(output)
                self.labels[output.name], self.units[output.name] = output.name, ""
                continue
            try:
                quantity = probe.quantity(output.of)
            except (UnknownNameError, ResultError) as error:
                near = getattr(error, "nearest", "")
                what = error.args[0] if error.args else str(error)
                mistakes.append(Mistake("outputs", output.name, str(what), near))
                continue
            _, label, unit = quantity
            parts = self._components(probe, output)
            for part in parts:
                found.append(part)
                self.labels[part.name], self.units[part.name] = label, unit
        if mistakes:
            raise SceneError(mistakes)
        return tuple(found)

    def _components(self, probe: Result, output: Output) -> list[Output]:
        from dap3d_core.result import find

        quantity = find(probe, str(output.of))
        if not quantity.components:
            return [output]
        head, colon, tail = output.name.rpartition(":")
        head, colon, tail = (head, colon, tail) if colon else (output.name, "", "")
        return [
            attrs.evolve(output, name=f"{head}.{c}{colon}{tail}", of=f"{output.of}.{c}")
            for c in quantity.components
        ]

    def _probe(self) -> Result:
        """A result of one instant, of which names and units can be asked."""
        machine = self.compiled.machine
        y = machine.integrated(machine.model.u0)
        row: Any = np.concatenate([[0.0], y, np.zeros(machine.report_size)])
        record = Record(scene_text=self.compiled.scene_text)
        return Result.of_run(machine.model, row[None], record, lambda: machine)

    def _refuse_series_of_other_length(self) -> None:
        timing = [n.name for n in self.numbers if n.path in TIMING]
        if timing:
            mistakes = [
                Mistake("outputs", o.name, f"a series has the same length at each point, and "
                        f"{timing[0]} varies", remedy="ask for :end, :min, :max or :mean")
                for o in self.outputs
                if o.reduction == "series"
            ]  # fmt: skip
            if mistakes:
                raise SceneError(mistakes)


#: Numbers that change the reporting times.
TIMING = (("simulation", "t_end"), ("simulation", "dt"))
