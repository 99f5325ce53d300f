"""Explicit methods, compiled: they know a vector and three functions, no mechanics."""

from typing import Any

from dap3d_core.integrators.runge_kutta.dop853 import DOP853
from dap3d_core.integrators.runge_kutta.dopri5 import DOPRI5
from dap3d_core.integrators.runge_kutta.integration import Integration, Statistics
from dap3d_core.integrators.runge_kutta.rk4 import RK4
from dap3d_core.integrators.runge_kutta.tableau import Method
from dap3d_core.integrators.stepping.integration_state import Status

#: The methods by name.
METHODS: dict[str, Method] = {method.name: method for method in (DOP853, DOPRI5, RK4)}


def make_adams(*problem: Any, **options: Any) -> Integration:
    """An ``AdamsIntegration``, imported and compiled for the runs that ask for it alone."""
    from dap3d_core.integrators.adams.integration import AdamsIntegration

    return AdamsIntegration(*problem, **options)


__all__ = ["METHODS", "Integration", "Method", "Statistics", "Status", "make_adams"]
