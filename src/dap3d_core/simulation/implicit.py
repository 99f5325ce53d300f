"""Runs with the implicit integrator, which is imported and compiled for them alone."""

from typing import Any

from numpy.typing import ArrayLike

from dap3d_core.formulations.machine import Machine
from dap3d_core.integrators import Integration
from dap3d_core.simulation.errors import SimulationError


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
