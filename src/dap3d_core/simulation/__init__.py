"""The simulation floor: initial conditions, method choice, integration, reporting."""

from dap3d_core.simulation.compiled import CompiledModel, compile_scene
from dap3d_core.simulation.errors import AssemblyError, RedundantError, SimulationError
from dap3d_core.simulation.opening import open_result
from dap3d_core.simulation.simulate import report_times, simulate

__all__ = [
    "AssemblyError",
    "CompiledModel",
    "RedundantError",
    "SimulationError",
    "compile_scene",
    "open_result",
    "report_times",
    "simulate",
]
