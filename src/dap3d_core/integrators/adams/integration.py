"""One integration by Adams methods, seen from Python; it has the face of ``Integration``."""

from collections.abc import Container, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.integrators.adams.formulas import (
    ADAMS_INTEGERS,
    CONSTANT,
    ORDER_NOW,
    ROWS,
    AdamsWork,
    allowed_adams_integers,
    make_table,
)
from dap3d_core.integrators.adams.step import advance_adams
from dap3d_core.integrators.runge_kutta.integration import Integration, switches_of
from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.input_checks import (
    check_control,
    check_sizes,
    check_state_and_times,
)
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.integrators.stepping.restore import restored
from dap3d_core.integrators.stepping.rounding import tolerance_of


class AdamsIntegration(Integration):
    """An initial value problem on its way, integrated by Adams methods of order 1 to 12.

    Parameters
    ----------
    functions, system, loops, y0, times, rtol, atol, first_step, project_on, error_size,
    report_size, buffer_rows, length_count, watched, ends
        As for ``Integration``; steps near singular states are not placed.
    step
        Must be None: order and step are chosen together.

    Raises
    ------
    ValueError
        For a fixed step; for times, sizes or tolerances that make no sense.
    """

    name = "adams"
    adaptive = True

    def __init__(
        self,
        functions: Sequence[Function],
        system: Any,
        loops: Any,
        y0: ArrayLike,
        times: ArrayLike,
        *,
        rtol: float = 1e-8,
        atol: ArrayLike = 1e-10,
        step: float | None = None,
        first_step: float | None = None,
        project_on: bool = False,
        error_size: int | None = None,
        report_size: int = 0,
        buffer_rows: int = 256,
        length_count: int = 0,
        watched: bool = False,
        ends: ArrayLike = (),
    ) -> None:
        if step is not None:
            raise ValueError(
                f"adams chooses order and step together and takes no step ({step}); "
                "leave step out, or take rk4, dopri5 or dop853"
            )
        self._arguments = (functions, system, loops)
        y, instants = np.array(y0, dtype=np.float64), np.array(times, dtype=np.float64)
        check_state_and_times(y, instants)
        check_control(cast(Any, self), rtol, atol, instants, step=None, first_step=first_step)
        error_size = y.size if error_size is None else error_size
        check_sizes(error_size, y.size, buffer_rows)
        real = np.zeros(at.LENGTHS + length_count)
        real[at.RTOL] = rtol
        real[at.H], real[at.T] = first_step or 0.0, instants[0]
        integer = np.zeros(ADAMS_INTEGERS, dtype=np.int64)
        integer[at.ORDER], integer[at.ERROR_SIZE] = 2, error_size  # a first step of order 1
        integer[at.PROJECT_ON], integer[at.WATCHED] = project_on, watched
        real[[at.LIMIT, at.CUT, at.LONGEST]] = np.inf
        switches, crossings = switches_of(integer, ends)
        state = np.zeros((at.STATES, y.size))
        state[at.Y] = y
        self._work = AdamsWork(
            real=real,
            integer=integer,
            times=instants,
            state=state,
            rows=np.empty((buffer_rows, 1 + y.size + report_size)),
            differences=np.zeros((ROWS, y.size)),
            scaled=np.zeros((ROWS, y.size)),
            table=make_table(),
            switches=switches,
            crossings=crossings,
            tolerance=tolerance_of(y.size, atol),
        )
        self.work = cast(Any, self._work)  # its first arrays are those of Integration

    def _advance(self, budget: int) -> None:
        advance_adams(self._work, *self._arguments, budget)

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``; here the table holds where the past rates stand."""
        return [*super().state_arrays(), self._work.table]

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Integration.restored``."""
        if name == "table":
            return restored(name, array, found, (CONSTANT,))
        return super().restored(name, array, found)

    def allowed_integers(self, found: Integers) -> dict[int, Container[int]]:
        """As ``Integration.allowed_integers``."""
        return super().allowed_integers(found) | allowed_adams_integers(found)

    @property
    def slope(self) -> Floats | None:
        """(n,) dy/dt at ``t``, a copy; None where it is not known."""
        if self._work.integer[at.FRESH] == 0:
            return None
        slope: Floats = self._work.differences[0].copy()
        return slope

    @property
    def order(self) -> int:
        """Order of the next step."""
        return int(self._work.integer[ORDER_NOW])
