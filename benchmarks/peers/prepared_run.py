"""Runs from one start again and again: arrays put back, one compiled call.

What a run costs beside its steps, some 80 us to check arguments and allocate, is more than the
integration of a small scene; here it is 1 us. The points of a study are run so in compiled code
(study/batch/driver.py).
"""

from typing import Any

from dap3d_core.integrators.runge_kutta.integration import RungeKutta
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import FINISHED, Y
from dap3d_core.kernels.array_types import Floats

#: Right-hand sides of one call: all.
ALL = 10**15


class PreparedRun:
    """An integration that can be run again; each run equals that of a new one bit for bit.

    Attributes:
        integration: in the state in which the last run left it; its rows are those of that run.
    """

    def __init__(self, integration: Integration) -> None:
        """Args: an integration at its start, whose buffer takes all rows of a run.

        Raises:
            ValueError: it has begun, or its buffer is too small.
        """
        work = integration.work
        if work.step_count or work.next_report:
            raise ValueError("the integration has begun: prepare a new one")
        if len(work.rows) < len(work.times):
            raise ValueError(f"the buffer takes {len(work.rows)} of {len(work.times)} rows")
        self.integration = integration
        arrays = integration.state_arrays()
        if isinstance(integration, RungeKutta):  # what else it has is written before it is read
            arrays = [work.real, work.integer, work.switches, work.tolerance, work.lengths]
        if work.calls_accepted:  # the turns that are counted
            arrays.append(integration._arguments[1].par)
        arrays = [*(array.reshape(-1) for array in arrays if array.size), work.state[Y]]
        #: Views of the arrays, which are copied in half the time of arrays, and of their copies.
        self._views = [(array.data, array.copy().data) for array in arrays]
        self._integers, self._status = work.integer.data, type(work).indices("integer")["status"]
        self._call: Any = integration.prepared()

    def run(self, y0: Floats | None = None) -> bool:
        """Run from a state y0 (n,), by default that of the integration; True if it was finished.

        Otherwise ``integration.status`` says why not.
        """
        for view, first in self._views:
            view[:] = first
        if y0 is not None:
            self.integration.work.state[Y] = y0
        self._call(ALL)
        return bool(self._integers[self._status] == FINISHED)
