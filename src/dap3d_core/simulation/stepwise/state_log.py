"""The states between the steps of a run, kept as they are and reported later."""

import numpy as np

from dap3d_core.formulations import REPORT
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators.stepping.hold import quick_view
from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.control.held_inputs import HeldInputs

#: Rows that there is room for at first; it doubles.
FIRST_ROWS = 1024


class StateLog:
    """Rows t, y, inputs, and the numbers by which turns of angles are counted.

    Attributes:
        count: rows so far.
    """

    def __init__(self, evaluator: Evaluator, y: Floats, inputs: HeldInputs) -> None:
        """Args: the evaluator of the run, its integrated state, the inputs that act on it."""
        self._evaluator = evaluator
        numbers = np.arange(len(evaluator.system.par))
        turns = [numbers[place] for place in evaluator.turn_places()]
        self._turns = np.concatenate(turns) if turns else numbers[:0]
        self._inputs = quick_view(inputs.present)
        self._y_end = 1 + len(y)
        self._end = self._y_end + len(inputs.values)
        self._width = self._end + len(self._turns)
        self.count = 0
        self._make_room(FIRST_ROWS)
        self.attach(y)

    def attach(self, y: Floats) -> None:
        """Keep the state y from here on."""
        self._y = quick_view(y)

    def add(self, t: float) -> None:
        """Keep the present state, of time t."""
        first = self.count * self._width
        if first == len(self._flat):
            self._make_room(2 * self.count)
        flat, y_end, end = self._flat, first + self._y_end, first + self._end
        flat[first] = t
        flat[first + 1 : y_end] = self._y
        if end > y_end:
            flat[y_end:end] = self._inputs
        if len(self._turns):
            self._rows[self.count, self._end :] = self._evaluator.system.par[self._turns]
        self.count += 1

    def _make_room(self, rows: int) -> None:
        log: Floats = np.empty((rows, self._width))
        if self.count:
            log[: self.count] = self._rows
        self._rows: Floats = log
        self._flat = quick_view(log.reshape(-1))

    @IGNORE_FLOAT_ERRORS
    def reports(self) -> Floats:
        """Rows as a run reports them: accelerations and reactions are computed here."""
        evaluator, log = self._evaluator, self._rows[: self.count]
        y_end, end = self._y_end, self._end
        par, places = evaluator.system.par, self._turns
        before, rows = par[places], np.zeros((len(log), y_end + evaluator.report_size))
        with evaluator.held_inputs():
            for row, noted in zip(rows, log, strict=True):
                row[:y_end] = noted[:y_end]
                evaluator.set_inputs(noted[y_end:end])
                par[places] = noted[end:]
                evaluator.functions[REPORT](
                    float(noted[0]), noted[1:y_end].copy(), row[y_end:], evaluator.system,
                    evaluator.loops,
                )  # fmt: skip
        par[places] = before
        return evaluator.with_inputs(evaluator.body_rows(rows), log[:, y_end:end])
