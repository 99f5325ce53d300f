"""Rebuilds the model of one point, where its parameters cannot be copied into arrays."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.switches import effects_of
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.model.groups import Floats
from dap3d_core.result.note import warnings_of
from dap3d_core.scene import SceneError, ValidatedScene, check
from dap3d_core.simulation import AssemblyError, CompiledModel
from dap3d_core.simulation.initial.assemble import model_size
from dap3d_core.simulation.initial.breakpoints import stops_of
from dap3d_core.simulation.initial.undefined_directions import undefined_directions
from dap3d_core.simulation.initial_state import find_start, start_notes
from dap3d_core.study.batch.compiled_batch import numbers_of
from dap3d_core.study.parameters import SceneParameter, with_values


class RebuiltPoint(NamedTuple):
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
        self._structure = self._structure_of(evaluator)

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

    def prepare(self, point: Floats) -> RebuiltPoint | None:
        """A point as it starts; None where it cannot be run in a batch."""
        evaluator = self._evaluator
        try:
            checked, model = self.load(point)
            start = find_start(evaluator, *self._options)
        except (SceneError, ModelError, AssemblyError, ValueError):
            return None
        if start.redundancy.rank.rank != self._rank or not start.redundancy.is_plain:
            return None
        if model.state_count and not self._has_same_tolerances(model):
            return None
        if stops_of(checked, model, self._t_end) != self._stops:
            return None
        if not np.array_equal(model.input_values, self._compiled.model.input_values):
            return None  # a batch shares the functions of time, and inputs stand with them
        if not np.array_equal(effects_of(evaluator.switches), self._terminal):
            return None
        if undefined_directions(checked.scene, model, start.u, model_size(evaluator)):
            return None
        notes = start_notes(start, evaluator, checked.scene)
        warnings = tuple(warnings_of(notes))
        y0 = evaluator.coordinates.start(start.u)  # before the numbers: they hold its reference
        if self._structure_of(evaluator) != self._structure:
            return None
        return RebuiltPoint(numbers_of(evaluator), y0, warnings)

    def _has_same_tolerances(self, model: Model) -> bool:
        """True if the states of elements have the tolerances of the integration."""
        from dap3d_core.model.element_states import tolerances

        given = tolerances(self._compiled.model.acting)
        return np.array_equal(tolerances(model.acting), given)

    @staticmethod
    def _structure_of(evaluator: Evaluator) -> bytes:
        """The nodes of a tree, where there is one: joints may move otherwise at a point."""
        tree = evaluator.system.tree
        return b"" if tree is None else bytes(tree.nodes.tobytes())
