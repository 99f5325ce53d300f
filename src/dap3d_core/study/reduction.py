"""From the rows that runs report to the outputs of a study."""

from collections.abc import Callable, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.model import Model
from dap3d_core.result import Quantity, Record, Result, ResultError, UnknownNameError, find
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation import CompiledModel
from dap3d_core.study.outputs import REDUCTIONS, Output
from dap3d_core.study.parameters import Number

Floats = NDArray[np.float64]

#: Numbers that change the reporting times.
TIMING = (("simulation", "t_end"), ("simulation", "dt"))
#: Quantities of the whole that are computed with masses, and of joints, that are in the rows.
OF_MASSES, IN_ROWS = ("kinetic energy", "total energy"), "Lagrange multipliers"


class Reduction:
    """The outputs of a study.

    Attributes:
        outputs: those asked for, each vector in its components.
        labels, units: of each output, by name.
    """

    def __init__(
        self, compiled: CompiledModel, numbers: Sequence[Number], asked: Sequence[Output]
    ) -> None:
        """Look the outputs up.

        Raises:
            SceneError: there is no such quantity; or a series whose length would vary.
        """
        self._compiled = compiled
        self._tables = {number.table for number in numbers}
        self.labels: dict[str, str] = {}
        self.units: dict[str, str] = {}
        #: Whether each output is computed from the rows of many runs at once.
        self.of_rows: dict[str, bool] = {}
        #: Outputs that stand in one column of the rows as they are.
        self._column: dict[str, int] = {}
        self.outputs = self._expanded(asked)
        self._find_columns()
        timing = [number.name for number in numbers if number.path in TIMING]
        if timing and any(output.reduction == "series" for output in self.outputs):
            what = f"a series has the same length at each point, and {timing[0]} varies"
            raise SceneError(
                Mistake("outputs", o.name, what, remedy="ask for :end, :min, :max or :mean")
                for o in self.outputs
                if o.reduction == "series"
            )

    def reduce(self, rows: Floats, times: Floats) -> dict[str, Floats]:
        """Outputs of k runs that can be had of their rows (k, nt, width): (k,) or (k, nt)."""
        k, nt, width = rows.shape
        wanted = [output for output in self.outputs if self.of_rows[output.name]]
        if not wanted:
            return {}
        model, result, found = self._compiled.model, None, {}
        for output in wanted:
            column = self._column.get(output.name)
            if column is not None:
                values = rows[:, :, column]
            else:
                flat = rows.reshape(k * nt, width)
                result = result or self.result(model, flat, lambda: self._compiled.machine)
                values = result.quantity(str(output.of)).values.reshape(k, nt)
            found[output.name] = REDUCTIONS[output.reduction](values, times)
        return found

    @property
    def is_of_single_copies(self) -> bool:
        """Whether all outputs can be had of the rows of a pack, where what all share is NaN."""
        if not all(self.of_rows.values()):
            return False
        model = self._compiled.model
        layout = model.row_layout
        rows = np.random.default_rng(0).random((1, 3, layout.size))
        for name in ("work", "potential_energy", "residuals"):
            rows[..., layout[name]] = np.nan
        found = self.reduce(rows, np.arange(3.0))
        return all(bool(np.all(np.isfinite(values))) for values in found.values())

    def result(self, model: Model, rows: Floats, machine_of: Callable[[], Machine]) -> Result:
        """A result of rows, in memory."""
        record = Record(scene_text=self._compiled.scene_text)
        return Result.of_run(model, rows, record, machine_of)

    def _expanded(self, asked: Sequence[Output]) -> tuple[Output, ...]:
        machine = self._compiled.machine
        y = machine.integrated(machine.model.u0)
        row = np.concatenate([[0.0], y, np.zeros(machine.report_size)])
        probe = self.result(machine.model, row[None], lambda: machine)
        found: list[Output] = []
        mistakes: list[Mistake] = []
        for output in asked:
            if callable(output.of):
                parts, label, unit, alone = [output], output.name, "", False
            else:
                try:
                    quantity = find(probe, output.of)
                except (UnknownNameError, ResultError) as error:
                    near = getattr(error, "nearest", "")
                    what = str(error.args[0] if error.args else error)
                    mistakes.append(Mistake("outputs", output.name, what, near))
                    continue
                parts = _components(output, quantity.components)
                label, unit, alone = quantity.label, quantity.unit, self._is_of_rows(quantity)
            for part in parts:
                found.append(part)
                self.labels[part.name], self.units[part.name] = label, unit
                self.of_rows[part.name] = alone
        if mistakes:
            raise SceneError(mistakes)
        return tuple(found)

    def _find_columns(self) -> None:
        """A quantity that equals one column of rows of random numbers is that column."""
        machine = self._compiled.machine
        width = 1 + len(machine.integrated(machine.model.u0)) + machine.report_size
        rows = np.random.default_rng(0).random((3, width))
        result = self.result(machine.model, rows, lambda: machine)
        for output in self.outputs:
            if self.of_rows[output.name]:
                values = result.quantity(str(output.of)).values
                same = np.flatnonzero(np.all(rows == values[:, None], axis=0))
                if len(same):
                    self._column[output.name] = int(same[0])

    def _is_of_rows(self, quantity: Quantity) -> bool:
        """Whether a quantity is computed with nothing that varies from point to point."""
        if quantity.owner == "joint" and quantity.kind != IN_ROWS:
            return self._tables <= {"forces"}
        if quantity.owner == "force":
            return not self._tables
        if quantity.owner == "point":
            return "points" not in self._tables
        return quantity.kind not in OF_MASSES or "bodies" not in self._tables


def _components(output: Output, components: Sequence[str]) -> list[Output]:
    """An output for each component of a vector: ``crank.r:max`` -> ``crank.r.x:max``, ..."""
    if not components:
        return [output]
    head, colon, tail = output.name.rpartition(":")
    head, colon, tail = (head, colon, tail) if colon else (output.name, "", "")
    return [
        attrs.evolve(output, name=f"{head}.{c}{colon}{tail}", of=f"{output.of}.{c}")
        for c in components
    ]
