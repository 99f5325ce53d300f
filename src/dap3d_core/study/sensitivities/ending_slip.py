"""Derivatives of the states that lead to the end of a slip.

Friction acts along the slip u, a direction that changes by du / |u|: next to the end of a slip that
is stiff, and its own motion does not show it. Where slip goes straight, one step reaches the end.
States are those of the run. Their derivatives are carried once more, from where steps became long
beside the time that was left, by steps that are a part of it.
"""

from collections import deque
from collections.abc import Callable
from functools import cached_property

import numpy as np

from dap3d_core.integrators import TABLEAUS, Integration, Status, explicit
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.lanes import Differentiation
from dap3d_core.simulation import SimulationError
from dap3d_core.simulation.run import Run

#: Most that a step is of the time left; part of the way at which the last one ends, from where
#: slopes are extrapolated; states that are kept; steps that are taken at most.
PART, NEAREST, KEPT, MOST_STEPS = 0.25, 1e-6, 256, 20_000
#: Part of the time below which the way is none: its steps would be rounding of it.
NO_WAY = 1e-9


class EndingSlip:
    """The latest states of a differentiated run, and the way from one to where slip ends."""

    def __init__(self, run: Run, differentiation: Differentiation) -> None:
        """Args: the run, which follows contacts by events; its derivatives."""
        self._run, self._differentiation = run, differentiation
        self._states: deque[tuple[float, Floats, Floats, Floats]] = deque(maxlen=KEPT)

    def advance(self, integration: Integration, budget: int) -> Status:
        """As ``Integration.advance``, step by step while slip of contacts has a direction."""
        law, most = self._run.jumps, integration.statistics.rhs + budget
        assert law is not None
        advance: Callable[..., Status] = type(integration).advance
        if not law.sliding():
            return advance(integration, budget)
        while True:
            if not self._states or integration.t > self._states[-1][0]:
                work = integration.work
                slopes = self._differentiation.slopes(work.state[Y]).copy()
                of_time = self._differentiation.slopes(work.real)[work.indices("real")["t"]].copy()
                self._states.append((integration.t, integration.y, slopes, of_time))
            status = advance(integration, 0)
            rhs, is_full = integration.statistics.rhs, integration.rows_are_full
            if status is not Status.RUNNING or rhs > most or is_full:
                return status

    def forget(self) -> None:
        """Where something jumps, what was before leads no further."""
        self._states.clear()

    def leads_to(self, t: float) -> bool:
        """True if a state before time t is known, from which slip has come."""
        return bool(self._states) and self._states[0][0] < t

    def begun_at_once(self, t: float) -> tuple[Floats, Floats] | None:
        """Slopes of state and time where the slip began that ends at time t, if it does at once."""
        begun, _, slopes, of_time = self._states[0]
        return (slopes, of_time) if t - begun <= NO_WAY * t else None

    def slopes(self, t: float) -> tuple[Floats, dict[float, Floats]]:
        """Slopes (n, lanes) of the state at time t, at which slip ends; of rows before, by time.

        Raises:
            SimulationError: they cannot be carried there.
        """
        carried, differentiation = self._carried, self._differentiation
        arrays = differentiation.arrays()
        present = [array.copy() for array in arrays]
        times = np.array([*(state[0] for state in self._states if state[0] < t), t])
        is_long = np.diff(times) > PART * (t - times[:-1])  # the last one is
        begun, y, slopes, of_time = self._states[int(np.argmax(is_long))]
        slopes = slopes - np.outer(self._run.evaluator.slope(begun, y), of_time)  # at that instant
        self._set(begun, y, slopes)
        found, rows = [(begun, slopes)], {}
        while (left := t - carried.t) > NEAREST * (t - begun):
            limit = t - (1.0 - PART) * left
            while carried.t < limit:
                status = carried.advance_to(limit)
                if status is not Status.RUNNING or carried.statistics.steps > MOST_STEPS:
                    what = f"there is no derivative of what happens at t = {t:.9g} s"
                    raise SimulationError(f"{what}: slip ends there, in what is stiff besides")
                of_rows = differentiation.slopes(carried.work.rows)
                for k, row in enumerate(carried.rows()):
                    rows[float(row[0])] = of_rows[k * row.size : (k + 1) * row.size].copy()
            of_state = differentiation.slopes(carried.work.state[Y])
            found.append((carried.t, of_state.copy()))
        (t_0, slopes_0), (t_1, slopes_1) = found[-2:]
        for array, numbers in zip(arrays, present, strict=True):
            array[...] = numbers
        return slopes_1 + (slopes_1 - slopes_0) * ((t - t_1) / (t_1 - t_0)), rows

    def _set(self, t: float, y: Floats, slopes: Floats) -> None:
        """Begin at a state of the run."""
        carried, differentiation = self._carried, self._differentiation
        work, arrays = carried.work, carried.state_arrays()
        for array, first in zip(arrays, self._first, strict=True):
            array[...] = first
        work.t, work.state[Y] = t, y
        work.next_report = np.searchsorted(work.times, t, side="right")
        carried.restart()
        differentiation.take()
        for array in arrays:
            if array.dtype == np.float64:
                differentiation.slopes(array)[:] = 0.0
        differentiation.slopes(work.state[Y])[:] = slopes

    @cached_property
    def _carried(self) -> Integration:
        """What goes on from a state of the run, without its switches."""
        run, times = self._run, self._run.present.work.times
        options = run.options | {"ends": (), "step": None, "first_step": None}
        carried = explicit(TABLEAUS["dop853"], run.evaluator, run.present.y, times, **options)
        carried.call = self._differentiation.call  # type: ignore[method-assign]
        for argument in carried.loop_arguments:
            self._differentiation.wide(argument)
        carried.compile()
        self._first = [array.copy() for array in carried.state_arrays()]
        return carried
