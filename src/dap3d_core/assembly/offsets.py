"""Offsets into the integrated state for compiled code. Bodies count from 1; ground is 0."""

from dap3d_core.kernels.runtime.cache import compiled_into
from dap3d_core.model.state_layout import COORDINATES, STATE, VELOCITIES


@compiled_into
def coordinate_offset(b: int) -> int:
    """Index of the first coordinate of body b."""
    return COORDINATES * (b - 1)


@compiled_into
def velocity_offset(b: int, n: int) -> int:
    """Index of the first velocity of body b of n."""
    return COORDINATES * n + VELOCITIES * (b - 1)


@compiled_into
def states_offset(n: int) -> int:
    """Index of the first state of an element, in coordinates of n bodies; the work is last."""
    return STATE * n
