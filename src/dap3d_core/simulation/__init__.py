"""The simulation floor: initial conditions, method choice, integration, reporting."""

from dap3d_core.simulation.asked import report_times
from dap3d_core.simulation.compiled import CompiledModel, compile_scene
from dap3d_core.simulation.errors import (
    AssemblyError,
    CheckpointError,
    RedundantError,
    SimulationError,
)
from dap3d_core.simulation.event import Event, Instant
from dap3d_core.simulation.opening import open_result
from dap3d_core.simulation.rerunning import Repetition
from dap3d_core.simulation.simulate import simulate
from dap3d_core.simulation.standing import Standing

__all__ = [
    "AssemblyError",
    "CheckpointError",
    "CompiledModel",
    "Event",
    "Instant",
    "RedundantError",
    "Repetition",
    "SimulationError",
    "Standing",
    "compile_scene",
    "open_result",
    "report_times",
    "simulate",
]
