"""Results from disk, with the way back to a model for what only a model can compute."""

import os
from collections.abc import Callable

from dap3d_core.formulations.machine import Machine
from dap3d_core.model import Model
from dap3d_core.result import Result
from dap3d_core.result import open_result as open_file
from dap3d_core.scene import parse
from dap3d_core.simulation.compiled import CompiledModel


def open_result(path: str | os.PathLike[str]) -> Result:
    """Open a result file.

    Positions, velocities, accelerations, multipliers and energies come from the file; the Jacobian
    and reactions are computed when asked for, which loads the types that the stored scene names
    (never types of a model's own file).

    Args:
        path: a NetCDF file that ``Result.save`` or ``dap3d run`` wrote.

    Raises:
        ResultError: missing, truncated, newer, or not a result.
    """
    return open_file(path, _rebuild)


def _rebuild(scene_text: str) -> tuple[Model, Callable[[], Machine]]:
    compiled = CompiledModel(parse(scene_text))
    return compiled.model, lambda: compiled.machine
