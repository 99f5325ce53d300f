"""Runs with the implicit integrator, which is imported and compiled for them alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.integrators import Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.result import INFORMATION
from dap3d_core.simulation.errors import SimulationError

Floats = NDArray[np.float64]

#: What integrator "auto" begins with.
EXPLICIT = "dop853"
WHY_STIFF = "motions that have died away limit the steps, not the error of those that go on"


def implicit_integration(
    machine: Machine, y0: ArrayLike, times: ArrayLike, options: dict[str, Any]
) -> Integration:
    """An integration by Radau IIA.

    Args:
        machine: the model.
        y0, times, options: as ``RadauIntegration`` takes them.

    Raises:
        SimulationError: the formulation has other equations than Radau IIA solves.
    """
    if machine.method == "penalty":
        raise SimulationError(
            "integrator radau does not fit method penalty: it holds the constraints themselves, "
            "which penalty replaces by springs; use method standard, lsq or auto"
        )
    from dap3d_core.integrators.radau.integration import RadauIntegration

    return RadauIntegration(machine, y0, times, **options)


def implicit_rest(
    machine: Machine, before: Integration, times: Floats, options: dict[str, Any]
) -> Integration:
    """The integration by Radau IIA of what another one has left, from where it stands."""
    integration = implicit_integration(machine, before.y, times, options | {"first_step": None})
    take_over(integration, before)
    return integration


def take_over(integration: Integration, before: Integration) -> None:
    """Let an integration of the same run go on from where another one stands."""
    real, integer = integration.work.real, integration.work.integer
    integration.work.state[at.Y] = before.work.state[at.Y]
    real[at.T], integer[at.NEXT] = before.t, before.work.integer[at.NEXT]
    real[at.STIFF_AT], integer[at.STATUS] = np.inf, Status.RUNNING
    real[[at.ACROSS, at.FAILED_RATE]] = 0.0
    integer[[at.POOR, at.STIFF_STEPS, at.CALM_STEPS, at.STALLS]] = 0
    if not integration.implicit:
        integration.work.lengths[:] = np.nan
    integration.restart()


def change_note(t: float) -> str:
    """Note on where integrator auto has gone on with the implicit one."""
    return f"{INFORMATION}integrator auto: {EXPLICIT} until t = {t:.6g} s, then radau: {WHY_STIFF}"


def stiffness_notes(runs: Sequence[Integration], integrator: str) -> list[str]:
    """That the scene is stiff for the one integration of a run, where it is."""
    t = runs[0].stiff_at
    if t is None or len(runs) > 1:
        return []
    used = EXPLICIT if integrator == "auto" else integrator
    return [
        f"{INFORMATION}the scene is stiff from t = {t:.6g} s on: {WHY_STIFF}. {used} takes small "
        "steps for that; radau, or auto, takes fewer"
    ]
