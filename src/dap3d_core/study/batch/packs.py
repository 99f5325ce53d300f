"""Points run several at a time, as one model of copies that share their steps (packed_model.py)."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.study.batch.compiled_batch import Found, Runs
from dap3d_core.study.batch.packed_model import Lanes, packed

if TYPE_CHECKING:
    from dap3d_core.study.study import Ensemble

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Packs:
    """Runs points of one model, ``count`` at a time. For one thread."""

    def __init__(self, ensemble: "Ensemble", one: Machine, count: int) -> None:
        """Args: whose points; a machine of the model; how many at a time."""
        compiled, times = ensemble.compiled, ensemble.times
        self._many = Machine(packed(compiled.model, count), compiled.method)
        self._lanes = Lanes(one, self._many, count)
        stops = compiled.pace(float(times[-1])).stops
        self._runs = Runs(self._many, compiled.scene.simulation, times, stops)
        self._width = one.model.row_layout.size
        self.count = count

    def run(self, table: Floats, places: Integers, y0: Floats) -> Found:
        """As ``Runs.run``, from states as they stand; the points that fill no pack are not done."""
        count, nt = self.count, len(self._runs.integration.work.times)
        packs = len(table) // count
        used = packs * count
        joined = table[:used].reshape(packs, count * table.shape[1])
        states = self._lanes.join(y0[:used].reshape(packs, count, y0.shape[1]))
        found = self._runs.run(joined, self._lanes.places(places).ravel(), states)
        rows = np.empty((len(table), nt, self._width))
        rows[:used] = self._lanes.rows_of(found.rows).reshape(used, nt, self._width)
        done = np.zeros(len(table), dtype=bool)
        done[:used] = np.repeat(found.done, count)
        numbers = np.zeros((len(table), found.numbers.shape[1]))
        return Found(done, rows, y0, y0, numbers)


def packs_for(ensemble: "Ensemble", one: Machine) -> Packs | None:
    """What runs the points of an ensemble in packs; None where they are not to be, or cannot.

    Switches of one copy would interrupt all, and friction is iterated for all; of what all share
    (work, potential energy, residuals) nothing may be asked for.
    """
    count, model = ensemble.study.pack, ensemble.compiled.model
    alone = one.formulation.accepts_redundant or bool(one.switches) or model.friction
    if count < 2 or alone or not ensemble.reduction.is_of_single_copies:
        return None
    return Packs(ensemble, one, count)
