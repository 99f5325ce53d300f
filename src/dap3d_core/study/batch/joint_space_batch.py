"""Points in joint coordinates whose bodies start where they do in the scene as given.

All that the constants of a tree say of its joints is then the same at each point. Masses, inertias
and velocities change; velocities are corrected in coordinates of bodies, by method standard.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from dap3d_core.formulations.joint.coordinates import TreeCoordinates
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.state_layout import u_from_y
from dap3d_core.simulation.initial.assemble import SMALL_CORRECTION, distance
from dap3d_core.simulation.initial_state import InitialState
from dap3d_core.study.batch import driver
from dap3d_core.study.batch.compiled_batch import BatchRows, CompiledBatch
from dap3d_core.study.batch.initial_state import STARTING

MakeBatch = Callable[[], CompiledBatch]


class TreePoints:
    """Runs points whose poses at the start are those of the scene. Not for two threads at once."""

    def __init__(self, batch: CompiledBatch, start: InitialState, make_other: MakeBatch) -> None:
        """Args: what runs the points; start of the scene; makes what corrects velocities."""
        self._batch, self._u, self._make_other = batch, start.u, make_other

    @cached_property
    def _other(self) -> CompiledBatch:
        return self._make_other()

    def run(self, table: Floats, places: Integers, y0: Floats, start: int) -> BatchRows:
        """As ``CompiledBatch.run``; states (k, 13 n + 1), also those returned, are of bodies.

        Points whose correction moves bodies from where they start in the scene are not done.
        """
        coordinates = self._batch.evaluator.coordinates
        assert isinstance(coordinates, TreeCoordinates)
        first = coordinates.start(self._u)
        if start == driver.UNCORRECTED:
            rows = self._batch.run(table, places, np.repeat(first[None], len(table), axis=0))
            return rows._replace(given=y0, y0=y0)
        known = places < self._other.number_count
        corrected = self._other.run(table[:, known], places[known], y0, driver.CORRECT_ONLY)
        y = coordinates.starts(self._u, u_from_y(corrected.y0))
        rows = self._batch.run(table, places, y)
        rows.diagnostics[:, :STARTING] = corrected.diagnostics[:, :STARTING]
        moved, turned = distance(
            u_from_y(corrected.y0), self._u, self._batch.evaluator.model.body_count
        )
        stays = np.maximum(moved / self._batch.size, turned) <= SMALL_CORRECTION
        done = rows.done & corrected.done & stays
        return BatchRows(done, rows.rows, y0, corrected.y0, rows.diagnostics)
