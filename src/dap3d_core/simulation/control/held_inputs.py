"""The inputs of a run: set by name, checked, held."""

import math
from collections.abc import Mapping
from typing import Any

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators.stepping.hold import quick_view
from dap3d_core.registry.suggestions import nearest


class HeldInputs:
    """The values of the inputs that an evaluator's elements read, by name.

    Attributes:
        values: (inputs,) in the order of the scene.
        drives: True if a joint reads an input, so that velocities may jump with it.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        model = evaluator.model
        self._evaluator = evaluator
        self._index = {name: k for k, name in enumerate(model.input_names)}
        self._rows = model.input_rows.tolist()
        self._F = quick_view(evaluator.system.F)
        self.values: list[float] = evaluator.inputs.tolist()
        self.drives = any(
            bool((group.functions == row).any()) for group in model.joints for row in self._rows
        )

    def set(self, given: Mapping[str, Any]) -> bool:
        """Set inputs; whether one of them has another value now.

        Raises:
            ValueError: there is no input of such a name, or a value is no finite number.
        """
        values, index, changes = self.values, self._index, False
        for name, value in given.items():
            k = index.get(name)
            if k is None:
                raise ValueError(self._unknown(name))
            if value == values[k]:
                continue
            try:
                number = float(value)
            except (TypeError, ValueError):
                number = math.nan
            if not math.isfinite(number):
                raise ValueError(f"input {name} is set to {value!r}; it should be a finite number")
            values[k] = self._F[self._rows[k], 0] = number
            changes = True
        return changes

    def replace(self, values: list[float]) -> None:
        """Set all inputs, in their order."""
        self.values[:] = values
        self._evaluator.set_inputs(values)

    def _unknown(self, name: Any) -> str:
        near = nearest(name, self._index) if isinstance(name, str) else ""
        listed = ", ".join(self._index) or "none"
        hint = f"did you mean {near!r}?" if near else f"inputs of the scene: {listed}"
        return f"there is no input {name!r}; {hint}"
