"""Rotation matrix and unit Euler parameters of a body, from Euler parameters of any length."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.kernels.runtime.cache import compiled_into
from dap3d_core.kernels.runtime.loop_support import A, P


@compiled_into
def orient_by_state(b: Floats, o: int, e: Any) -> None:
    """The same of the state, of any length; A waits for no square root."""
    square = square_of(e)
    put_rotation(b, o + A, e, 2.0 / square)
    h = 1.0 / np.sqrt(square)
    b[o + P], b[o + P + 1], b[o + P + 2], b[o + P + 3] = e[0] * h, e[1] * h, e[2] * h, e[3] * h


@compiled_into
def square_of(e: Any) -> float:
    """E . e of four numbers."""
    return (e[0] * e[0] + e[1] * e[1]) + (e[2] * e[2] + e[3] * e[3])


@compiled_into
def put_rotation(b: Floats, k: int, e: Any, h: float) -> None:
    """Store the rotation matrix of Euler parameters at k; h: 2/(e . e)."""
    e0, e1, e2, e3 = e
    b[k] = 1.0 - h * (e2 * e2 + e3 * e3)
    b[k + 1] = h * (e1 * e2 - e0 * e3)
    b[k + 2] = h * (e1 * e3 + e0 * e2)
    b[k + 3] = h * (e1 * e2 + e0 * e3)
    b[k + 4] = 1.0 - h * (e1 * e1 + e3 * e3)
    b[k + 5] = h * (e2 * e3 - e0 * e1)
    b[k + 6] = h * (e1 * e3 - e0 * e2)
    b[k + 7] = h * (e2 * e3 + e0 * e1)
    b[k + 8] = 1.0 - h * (e1 * e1 + e2 * e2)
