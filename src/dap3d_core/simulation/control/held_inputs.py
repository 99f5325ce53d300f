"""The inputs of a run: set by name, checked, held."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators.stepping.hold import quick_view
from dap3d_core.registry.suggestions import did_you_mean
from dap3d_core.scene.coerce import plain
from dap3d_core.scene.validate.coerce_values import LARGEST


def number_of(value: Any) -> float:
    """A number, numpy's as well; NaN where it is none, or several."""
    try:
        return float(value) if np.ndim(value) == 0 else float("nan")
    except (TypeError, ValueError):
        return float("nan")


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
        F, rows = evaluator.system.F, model.input_rows
        self._numbers = quick_view(F.reshape(-1))
        self._places = (F.shape[1] * rows).tolist()
        #: (inputs,) the numbers that elements read: rows of inputs follow one another.
        self.present = F[rows[0] : rows[0] + len(rows), 0] if len(rows) else F[:0, 0]
        self.values: list[float] = evaluator.inputs.tolist()
        self.drives = any(
            bool(np.isin(group.functions[:, : len(group.type_info.layout.functions)], rows).any())
            for group in model.joints
        )

    def set(self, given: Mapping[str, Any]) -> bool:
        """Set inputs; whether one of them has another value now.

        Raises:
            ValueError: there is no input of such a name, or a value is no finite number.
            TypeError: ``given`` is no mapping.
        """
        values, index, changes = self.values, self._index, False
        try:
            items = given.items()
        except AttributeError:
            raise TypeError(f"inputs are given as {{input: value}}, not as {given!r}") from None
        for name, value in items:
            k = index.get(name)
            if k is None:
                k = index.get(plain(name))
            if k is None:
                raise ValueError(self._unknown(name))
            if type(value) is not float:
                value = number_of(value)
            if value == values[k]:
                continue
            if not -LARGEST <= value <= LARGEST:
                raise ValueError(
                    f"input {name} is set to {given[name]!r}; it should be a finite number"
                )
            values[k] = self._numbers[self._places[k]] = value
            changes = True
        return changes

    def replace(self, values: list[float]) -> None:
        """Set all inputs, in their order."""
        self.values[:] = values
        self._evaluator.set_inputs(values)

    def _unknown(self, name: Any) -> str:
        known = f"inputs of the scene: {', '.join(self._index) or 'none'}"
        return f"there is no input {name!r}; {did_you_mean(name, self._index, otherwise=known)}"
