"""Errors of runs."""

from collections.abc import Sequence
from typing import Any

from dap3d_core.result import ResultError


class SimulationError(Exception):
    """A run could not start or go on; ``result`` is what was computed until then, or None."""

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class RedundantError(SimulationError):
    """The scene has redundant constraints, which the chosen formulation cannot solve."""


class AssemblyError(SimulationError):
    """The initial conditions could not be brought onto the constraints.

    Attributes:
        joints: names of the joints that are open, the worst first; empty where a row is not finite.
    """

    def __init__(self, message: str, joints: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.joints = tuple(joints)


class CheckpointError(ResultError):
    """A checkpoint that cannot be read, or a run that cannot go on from it; says what to do."""
