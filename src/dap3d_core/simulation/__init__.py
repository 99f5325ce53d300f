"""The simulation layer: initial conditions, method choice, integration, reporting."""

from dap3d_core.simulation.compiled_model import CompiledModel, compile_scene
from dap3d_core.simulation.errors import (
    AssemblyError,
    CheckpointError,
    RedundantError,
    SimulationError,
)
from dap3d_core.simulation.events.event import Event, Instant
from dap3d_core.simulation.open_result import open_result
from dap3d_core.simulation.output.monitor import RunProgress
from dap3d_core.simulation.rerun import Reproduction
from dap3d_core.simulation.settings import report_times
from dap3d_core.simulation.simulate import simulate

__all__ = [
    "AssemblyError", "CheckpointError", "CompiledModel", "Event", "Instant", "RedundantError",
    "Reproduction", "SimulationError", "RunProgress", "compile_scene", "open_result",
    "report_times", "simulate",
]  # fmt: skip
