"""Vectors of one body in its own axes and in its scaled coordinates.

s is the body's row of ``System.body``, k its row of ``System.metric``; U = L^-T with J' = L L^T is
upper triangular, A the rotation matrix. All functions are put into their callers.
"""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats
from dap3d_core.kernels.runtime.cache import compiled_into
from dap3d_core.kernels.runtime.loop_support import A, P

#: Columns of the metric, and those that hold constants of a body: 1/sqrt(m), then U by rows.
METRIC_WIDTH, METRIC_CONSTANTS = 19, 7


@compiled_into
def in_body_axes(s: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A^T (x, y, z): a vector along the global axes, along those of the body."""
    return (
        s[3] * x + s[6] * y + s[9] * z,
        s[4] * x + s[7] * y + s[10] * z,
        s[5] * x + s[8] * y + s[11] * z,
    )


@compiled_into
def gyroscopic_moment(J: Any, w: Any) -> tuple[float, float, float]:
    """The moment w' x J' w' of an angular velocity w', all in body axes; J: xx, xy, xz, yy, yz, zz.

    By differences of the moments of inertia: of a sphere it is zero to the last digit.
    """
    x, y, z = w
    j00, j01, j02, j11, j12, j22 = J
    return (
        (j22 - j11) * (y * z) + j12 * (y * y - z * z) + x * (j02 * y - j01 * z),
        (j00 - j22) * (z * x) + j02 * (z * z - x * x) + y * (j01 * z - j12 * x),
        (j11 - j00) * (x * y) + j01 * (x * x - y * y) + z * (j12 * x - j02 * y),
    )


@compiled_into
def unscaled(k: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """U (x, y, z): angular velocity or rotation, body axes, from the scaled one."""
    return k[1] * x + k[2] * y + k[3] * z, k[4] * y + k[5] * z, k[6] * z


@compiled_into
def scaled(k: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """U^-1 (x, y, z): scaled angular velocity or rotation from the one in body axes."""
    z2 = z / k[6]
    z1 = (y - k[5] * z2) / k[4]
    return (x - k[2] * z1 - k[3] * z2) / k[1], z1, z2


@compiled_into
def scaled_moment(k: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """U^T (x, y, z): scaled moment from the one in body axes."""
    return k[1] * x, k[2] * x + k[4] * y, k[3] * x + k[5] * y + k[6] * z


@compiled_into
def put_scaled(k: Floats, x: Floats, o: int, out: Floats) -> None:
    """Put six numbers at o, a force and moment or a row along global axes, in scaled coordinates.

    (f, n) becomes (f / sqrt(m), B^T n).
    """
    for c in range(3):
        out[o + c] = k[0] * x[o + c]
        turning = x[o + 3] * k[7 + c] + x[o + 4] * k[10 + c] + x[o + 5] * k[13 + c]
        out[o + 3 + c] = turning


@compiled_into
def rotation_row(e: Any, h: float, k: int) -> tuple[float, float, float]:
    """Row k of the rotation matrix of Euler parameters of any length; h: 2/(e . e)."""
    a, x, y, z = e
    if k == 0:
        return 1.0 - h * (y * y + z * z), h * (x * y - z * a), h * (x * z + y * a)
    if k == 1:
        return h * (x * y + z * a), 1.0 - h * (x * x + z * z), h * (y * z - x * a)
    return h * (x * z - y * a), h * (y * z + x * a), 1.0 - h * (x * x + y * y)


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
    b[k], b[k + 1], b[k + 2] = rotation_row(e, h, 0)
    b[k + 3], b[k + 4], b[k + 5] = rotation_row(e, h, 1)
    b[k + 6], b[k + 7], b[k + 8] = rotation_row(e, h, 2)
