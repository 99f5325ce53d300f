"""Instants that no step crosses, such as break points of functions of time.

Where the right-hand side may jump steps end just before and start just behind, so that none has
samples of both sides; the state stays, which is right to the rounding of time, but for what the
constraints make of it there. Elsewhere, and with fixed steps on their grid, they end on the
instant.
"""

from collections.abc import Sequence

import numpy as np

from dap3d_core.assembly.arrays import MODE_ENDS
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import IntegrationState
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled


def stop_table(stops: Sequence[tuple[float, bool]], *, is_adaptive: bool) -> Floats:
    """``IntegrationState.stops`` of instants in ascending order, and whether rates jump there."""
    table = np.empty((at.STOP_ROWS, len(stops)))
    for k, (t, jumps) in enumerate(stops):
        ends = (-np.inf, np.inf) if jumps and is_adaptive else (t, t)
        table[:, k] = np.nextafter(t, ends[0]), t, np.nextafter(t, ends[1])
    return table


@compiled
def restart(work: IntegrationState) -> None:
    """Let the next step start anew: what the functions compute has changed.

    Switches are on the side where they are found, but those of contacts, on that of their modes: in
    its band one may have the other sign.
    """
    work.h = 0.0
    work.last_error, work.step_limit_at_switch = 1e-4, np.inf
    work.first_stage_valid = work.switch_rates_valid = 0
    work.last_rejected = work.cut_attempts = 0
    for q in range(work.switches.shape[1]):
        is_contact = work.switches[at.DOES, q] == MODE_ENDS
        work.switches[at.SIDE, q] = 1.0 if is_contact else 0.0


@compiled
def next_stop(work: IntegrationState) -> int:
    """Index of the first stop at or behind the time reached."""
    first, end = 0, work.stops.shape[1]
    while first < end:
        middle = (first + end) // 2
        if work.stops[at.INSTANT, middle] < work.t:
            first = middle + 1
        else:
            end = middle
    return first
