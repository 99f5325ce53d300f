"""An integration by Adams methods."""

from collections.abc import Container, Mapping
from typing import Any

import numpy as np

from dap3d_core.integrators.adams.step import (
    CONSTANT,
    HIGHEST,
    ROWS,
    AdamsState,
    advance_adams,
    make_table,
    state_at,
)
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import MOST_COUNTED
from dap3d_core.integrators.stepping.restore import restored
from dap3d_core.kernels.array_types import Floats


class AdamsIntegration(Integration):
    """An initial value problem, integrated by Adams methods of order 1 to 12.

    Parameters
    ----------
    args, options
        As for ``Integration``; steps near singular states are not placed.
    step
        Must be None: order and step are chosen together.

    Raises
    ------
    ValueError
        For a fixed step; for times, sizes or tolerances that make no sense.
    """

    name = "adams"
    state_class = AdamsState
    takes_programs = True
    keeps_step = False
    loop = staticmethod(advance_adams)

    def __init__(self, *args: Any, step: float | None = None, **options: Any) -> None:
        if step is not None:
            raise ValueError(
                f"adams chooses order and step together and takes no step ({step}); "
                "leave step out, or take rk4, dopri5 or dop853"
            )
        super().__init__(*args, **options)
        self.work.order = 2  # a first step of order 1

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``."""
        return {
            "differences": np.zeros((ROWS, size)),
            "scaled": np.zeros((ROWS, size)),
            "table": make_table(),
        }

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``; here the table holds the times of past rates."""
        return [*super().state_arrays(), self.work.table]

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Integration.restored``."""
        if name == "table":
            return restored(name, array, found, (CONSTANT,))
        return super().restored(name, array, found)

    def allowed_integers(self, found: Mapping[str, int]) -> dict[str, Container[int]]:
        """As ``Integration.allowed_integers``."""
        return super().allowed_integers(found) | {
            "next_order": range(1 if found["first_stage_valid"] else 0, HIGHEST + 1),
            "last_order": range(HIGHEST + 1),
            "is_starting": (0, 1),
            **dict.fromkeys(("equal_steps", "failure_count"), range(MOST_COUNTED)),
        }

    def state_within(self, t: float) -> Floats | None:
        """As ``Integration.state_within``."""
        if self.work.first_stage_valid == 0 or self.work.step_count == 0:
            return None
        return self._interpolated(state_at, t)

    @property
    def dy_dt(self) -> Floats | None:
        """(n,) dy/dt at ``t``, a copy; None where it is not known."""
        if self.work.first_stage_valid == 0:
            return None
        return self.work.differences[0].copy()

    @property
    def order(self) -> int:
        """Order of the next step."""
        return int(self.work.next_order)
