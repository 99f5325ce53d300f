"""Runs with the implicit integrator, which is imported and compiled for them alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.integrators import EXPLICIT, IMPLICIT, Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.result import INFORMATION

Floats = NDArray[np.float64]

WHY_STIFF = "motions that have died away limit the steps, not the error of those that go on"


def implicit_rest(
    machine: Machine, before: Integration, times: Floats, options: dict[str, Any]
) -> Integration:
    """The integration by Radau IIA of what another one has left, from where it stands."""
    integration = IMPLICIT.make(machine, before.y, times, **options | {"first_step": None})
    take_over(integration, before)
    return integration


def take_over(integration: Integration, before: Integration) -> None:
    """Let an integration of the same run go on from where another one stands."""
    work = integration.work
    work.state[at.Y] = before.work.state[at.Y]
    work.t, work.next_report = before.t, before.work.next_report
    work.t_stiff, work.status = np.inf, Status.RUNNING
    work.error_across_singularity = work.failed_error_rate = 0.0
    work.near_singular_landings = work.stalled_steps = 0
    work.stiff_steps = work.nonstiff_steps = 0
    if not integration.implicit:
        work.lengths[:] = np.nan
    integration.restart()


def change_note(t: float) -> str:
    """Note on where integrator auto has gone on with the implicit one."""
    until = f"{EXPLICIT.name} until t = {t:.6g} s"
    return f"{INFORMATION}integrator auto: {until}, then {IMPLICIT.name}: {WHY_STIFF}"


def stiffness_notes(runs: Sequence[Integration], integrator: str) -> list[str]:
    """That the scene is stiff for the one integration of a run, where it is."""
    t = runs[0].t_stiff
    if t is None or len(runs) > 1:
        return []
    used = EXPLICIT.name if integrator == "auto" else integrator
    return [
        f"{INFORMATION}the scene is stiff from t = {t:.6g} s on: {WHY_STIFF}. {used} takes small "
        f"steps for that; {IMPLICIT.name}, or auto, takes fewer"
    ]
