"""Vectors of one body in its own axes and in its scaled coordinates.

s is the body's row of ``System.body``, k its row of ``System.metric``; U = L^-T with J' = L L^T is
upper triangular, A the rotation matrix. All functions are put into their callers.
"""

from dap3d_core.assembly.arrays import Floats
from dap3d_core.kernels.runtime.cache import compiled_into

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
def gyroscopic_moment(s: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The moment w' x J' w' of an angular velocity w' = (x, y, z), all in body axes.

    By differences of the moments of inertia: of a sphere it is zero to the last digit.
    """
    j01, j02, j12 = s[24], s[25], s[28]
    return (
        (s[31] - s[27]) * (y * z) + j12 * (y * y - z * z) + x * (j02 * y - j01 * z),
        (s[23] - s[31]) * (z * x) + j02 * (z * z - x * x) + y * (j01 * z - j12 * x),
        (s[27] - s[23]) * (x * y) + j01 * (x * x - y * y) + z * (j12 * x - j02 * y),
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
