"""Points whose numbers are not just copied: each has its own model, made anew and not compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.result import INFORMATION
from dap3d_core.scene import Checked, SceneError, check
from dap3d_core.simulation import AssemblyError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.events.breakpoints import stops_of
from dap3d_core.simulation.initial.assemble import model_size
from dap3d_core.simulation.initial.undefined_directions import undefined_directions
from dap3d_core.simulation.initial_state import find_start, start_notes
from dap3d_core.study.parameters import Number, with_values

Floats = NDArray[np.float64]


class Modelled(NamedTuple):
    """A point made ready to run.

    Attributes:
        numbers: par, body and metric of its model, one behind the other.
        y0: (n,) the integrated state to start from.
        notes: warnings about its start.
    """

    numbers: Floats
    y0: Floats
    notes: tuple[str, ...]


class Modelling:
    """Makes the models of single points. Not for two threads at once: it works on a machine."""

    def __init__(
        self, compiled: CompiledModel, machine: Machine, numbers: tuple[Number, ...], t_end: float
    ) -> None:
        """Args: what was compiled, a machine of it that nobody else uses, and what varies."""
        self._compiled, self._machine, self._numbers = compiled, machine, numbers
        self._t_end = t_end
        self._stops, self._ending = compiled.pace(t_end).stops, machine.ending
        settings = compiled.scene.simulation
        self._asked = (bool(settings.correct), settings.hold, str(settings.correct_metric))
        self._rank = compiled.start(*self._asked).redundancy.rank.rank
        self.places = np.arange(_numbers_of(machine).size)

    def load(self, point: Floats) -> tuple[Checked, Model]:
        """Let the machine evaluate the model of a point.

        Raises:
            SceneError, ModelError: the scene with these numbers has mistakes.
            ValueError: its model is built otherwise.
        """
        compiled = self._compiled
        scene = with_values(compiled.scene, self._numbers, point.tolist())
        checked = check(scene, compiled.checked.registry)
        model = build_model(checked)
        self._machine.load(model)
        return checked, model

    def prepare(self, point: Floats) -> Modelled | None:
        """A point as it starts; None where it has to be run by itself, or cannot be."""
        machine = self._machine
        try:
            checked, model = self.load(point)
            start = find_start(machine, *self._asked)
        except (SceneError, ModelError, AssemblyError, ValueError):
            return None
        found = start.redundancy
        if found.rank.rank != self._rank or not found.is_plain:
            return None
        if stops_of(checked, model, self._t_end) != self._stops:
            return None
        if not np.array_equal(machine.ending, self._ending):
            return None
        if undefined_directions(checked.scene, model, start.u, model_size(machine)):
            return None
        notes = start_notes(start, machine, checked.scene)
        warnings = tuple(note for note in notes if not note.startswith(INFORMATION))
        return Modelled(_numbers_of(machine), machine.integrated(start.u), warnings)


def _numbers_of(machine: Machine) -> Floats:
    """par, body and metric of a machine, one behind the other, as places count them."""
    s = machine.system
    return np.concatenate([s.par, s.body.ravel(), s.metric.ravel()])
