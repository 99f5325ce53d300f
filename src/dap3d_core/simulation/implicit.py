"""Runs with the implicit integrator, which is imported and compiled for them alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.formulations.machine import Machine
from dap3d_core.integrators import Integration
from dap3d_core.integrators.work import NEXT
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
    from dap3d_core.integrators.implicit import RadauIntegration

    return RadauIntegration(machine, y0, times, **options)


def implicit_rest(
    machine: Machine, before: Integration, times: Floats, options: dict[str, Any]
) -> Integration:
    """The integration by Radau IIA of what another one has left, from where it stands."""
    rest = np.concatenate([[before.t], times[times > before.t]])
    integration = implicit_integration(machine, before.y, rest, options | {"first_step": None})
    integration.work.integer[NEXT] = 1  # its first instant is no reporting time
    return integration


def stiffness_notes(runs: Sequence[Integration], integrator: str) -> list[str]:
    """What became of the scene being stiff, where it was; in the order of the integrations."""
    t = runs[0].stiff_at
    if t is None:
        return []
    if len(runs) > 1:
        return [
            f"{INFORMATION}integrator auto: {EXPLICIT} until t = {runs[0].t:.6g} s, then radau: "
            f"{WHY_STIFF}"
        ]
    used = EXPLICIT if integrator == "auto" else integrator
    return [
        f"{INFORMATION}the scene is stiff from t = {t:.6g} s on: {WHY_STIFF}. {used} takes small "
        "steps for that; radau, or auto, takes fewer"
    ]
