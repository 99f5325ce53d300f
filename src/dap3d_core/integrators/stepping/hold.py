"""Holds: parts of a run at whose ends numbers from outside may change.

Steps end at the end of a hold. A report of that very instant is made again at the begin of the next
one, with the new numbers. What a hold costs besides its steps is one compiled call: scalars are
read and written through views.
"""

import math
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import RUNNING, IntegrationState

#: Right-hand sides of bodies in one compiled call, for which Ctrl-C waits.
WORK_OF_A_CALL = 100_000
#: The least number of right-hand sides in one.
LEAST_WORK = 100

_REAL, _INTEGER = IntegrationState.indices("real"), IntegrationState.indices("integer")
T, H, LIMIT, LAST_ERROR = (_REAL[n] for n in ("t", "h", "t_limit", "last_error"))
STATUS, REJECTED, VALID, ROWS, NEXT = (
    _INTEGER[n]
    for n in ("status", "rejected_count", "first_stage_valid", "row_count", "next_report")
)


def quick_view(array: NDArray[Any]) -> Any:
    """A view whose items Python reads and writes three times faster than those of the array."""
    buffer: Any = array
    return memoryview(buffer)


class Hold:
    """Takes an integration from the end of one hold to that of the next.

    Attributes:
        integration: the integration.
    """

    def __init__(self, integration: Integration, bodies: int) -> None:
        """Args: the integration, and the number of bodies, which says how long a step takes."""
        self.integration = integration
        work = integration.work
        self._real, self._integer = quick_view(work.real), quick_view(work.integer)
        self._rows, self._times = work.rows, work.times
        self._advance = integration.prepared()
        self._budget = max(LEAST_WORK, WORK_OF_A_CALL // max(1, bodies))
        self._is_simple = not work.switch_count and work.fixed_step == 0.0
        #: The step that a hold began with, and the steps rejected until then; -1.0: none has begun.
        self._first_h, self._first_rejected = -1.0, 0

    @property
    def t(self) -> float:
        """Time reached by accepted steps."""
        return float(self._real[T])

    @property
    def is_open(self) -> bool:
        """True in the course of a hold, until its end has been reached and reported."""
        return self._first_h >= 0.0

    def to(self, end: float, budget: int | None = None) -> bool:
        """Integrate to the end of a hold; True once it is reached.

        False where the rows are full, where ``budget`` right-hand sides are spent, or where the
        integration has come to its end: what ``integration`` tells. Then it is called again.
        """
        real = self._real
        if self._first_h < 0.0:
            self.begin()
        real[LIMIT] = end
        self._advance(self._budget if budget is None else budget)
        real[LIMIT] = math.inf
        if real[T] < end or self._integer[STATUS] != RUNNING or self._waits(end):
            return False
        self.land(end)
        return True

    def _waits(self, end: float) -> bool:
        """True if a report before the end of the hold waits until rows are taken."""
        integer, rows = self._integer, self._rows
        return integer[ROWS] == len(rows) and bool(self._times[integer[NEXT]] < end)

    def begin(self) -> None:
        """Note down the step that a hold begins with."""
        if self._first_h < 0.0:
            self._first_h, self._first_rejected = self._real[H], self._integer[REJECTED]

    def land(self, end: float) -> None:
        """Be at the end of a hold, which steps have reached, as if nothing was reported of it.

        The last step of a hold is cut, and says little about the length of the next one: unless
        steps were rejected, that is at least the one that the hold began with.
        """
        real, integer, h = self._real, self._integer, self._first_h
        real[T] = end  # a break of a function there has taken the run a rounding further
        if integer[ROWS] and self._rows[integer[ROWS] - 1, 0] == end:
            integer[ROWS] -= 1
            integer[NEXT] -= 1
        if real[H] < h and integer[REJECTED] == self._first_rejected:
            real[H] = h
        self._first_h = -1.0

    def forget(self) -> None:
        """No hold has begun: the state was set to another."""
        self._first_h = -1.0

    def jump(self) -> None:
        """Let the next step start anew, with its usual length: what the functions give has jumped.

        A method of several steps starts with a short one of order 1.
        """
        if self._is_simple and self.integration.keeps_step:
            self._integer[VALID] = 0
            self._real[LAST_ERROR] = 1e-4
            return
        h, work = self._real[H], self.integration.work
        self.integration.restart()
        work.segment_step = work.segment_step_count = 0
        if self.integration.keeps_step:
            self._real[H] = h

    def state(self) -> dict[str, Any]:
        """State as plain data."""
        return {"h": self._first_h, "rejected": self._first_rejected}

    def restore(self, found: Mapping[str, Any]) -> None:
        """Go on from what ``state`` gave."""
        self._first_h, self._first_rejected = float(found["h"]), int(found["rejected"])
