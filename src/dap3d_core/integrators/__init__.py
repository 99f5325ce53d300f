"""Explicit Runge-Kutta methods, compiled: they know a vector and three functions, no mechanics."""

from dap3d_core.integrators.dop853 import DOP853
from dap3d_core.integrators.dopri5 import DOPRI5
from dap3d_core.integrators.integration import Integration, Statistics
from dap3d_core.integrators.method import Method
from dap3d_core.integrators.rk4 import RK4
from dap3d_core.integrators.work import Status

#: The methods by name.
METHODS: dict[str, Method] = {method.name: method for method in (DOP853, DOPRI5, RK4)}

__all__ = ["METHODS", "Integration", "Method", "Statistics", "Status"]
