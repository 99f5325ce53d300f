"""Progress snapshots of a running simulation, for user callbacks."""

from collections.abc import Callable

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import Integration
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.result.arrays import summary_of
from dap3d_core.result.post.point_motion import kinetic_energy


@attrs.frozen
class RunProgress:
    """Progress of a run.

    Attributes:
        t, t_end: simulated time, and where the run ends, s.
        steps: taken so far.
        step: mean of the latest ones, s; 0 before the first.
        drift: imbalance of energy so far: the change of kinetic energy less the work of forces and
            drivers, relative to the largest of both; at the end the ledger has it as "energy".
    """

    t: float
    t_end: float
    steps: int
    step: float
    drift: float


class Observer:
    """Reports the progress of the integrations of a run between their chunks to a callback."""

    def __init__(
        self, evaluator: Evaluator, t_end: float, watch: Callable[[RunProgress], None]
    ) -> None:
        if not callable(watch):
            raise TypeError(
                f"watch is a function that is called with how the run stands, not {watch!r}"
            )
        self._subject = summary_of(evaluator.model)
        self._evaluator, self._t_end, self._watch = evaluator, t_end, watch
        self._of: Integration | None = None
        self._t = self._step = self._largest = 0.0
        self._steps = self._earlier = 0
        self._start: tuple[float, float] | None = None

    def begin(self, integration: Integration) -> None:
        """An integration begins, or another one continues the run."""
        steps = integration.statistics.steps  # of one that continues, those it has taken
        self._earlier, self._steps = self._earlier + self._steps - steps, steps
        self._of, self._t = integration, integration.t
        if self._start is None:
            self._start = self._energies(integration.y)

    def update(self) -> None:
        """Report the present progress."""
        assert self._of is not None
        assert self._start is not None
        steps = self._of.statistics.steps
        if steps > self._steps:
            self._step = (self._of.t - self._t) / (steps - self._steps)
            self._t, self._steps = self._of.t, steps
        kinetic, work = self._energies(self._of.y)
        # Chunks may end where a motion turns back, and all work is undone.
        done = max(abs(work - self._start[1]), self._of.largest_work)
        self._largest = max(self._largest, kinetic, done)
        imbalance = (kinetic - self._start[0]) - (work - self._start[1])
        drift = abs(imbalance) / self._largest if self._largest else 0.0
        self._watch(RunProgress(self._of.t, self._t_end, self._earlier + steps, self._step, drift))

    def _energies(self, y: NDArray[np.float64]) -> tuple[float, float]:
        """Kinetic energy and the work done so far, J."""
        state = self._evaluator.body_state(y)
        u = u_from_y(state, self._evaluator.model.state_count)
        return float(kinetic_energy(self._subject, u[None])[0]), float(y[-1])
