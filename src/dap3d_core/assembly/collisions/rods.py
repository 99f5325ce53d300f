"""Spheres and capsules among each other: distances of points and line segments."""

import math

from dap3d_core.assembly.collisions.records import add
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Sine^2 of the angle between axes below which they are parallel.
PARALLEL = 1e-12


@compiled
def balls(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int,
    x: float, y: float, z: float, ri: float, a: float, b: float, c: float, rj: float, most: float,
) -> int:  # fmt: skip
    """A ball of radius ri about (x, y, z), of shape i, and one of radius rj about (a, b, c)."""
    nx, ny, nz = x - a, y - b, z - c
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        nx, ny, nz = nx / length, ny / length, nz / length
    else:
        nx, ny, nz = 0.0, 0.0, 1.0
    gap = length - ri - rj
    return add(which, found, count, i, j, feature,
               a + rj * nx, b + rj * ny, c + rj * nz, nx, ny, nz, gap, most)  # fmt: skip


@compiled
def along(x: float, y: float, z: float, d: Floats, u: Floats, half: float) -> float:
    """Where on a segment about d, along u, is nearest to a point: from -half to half."""
    s = (x - d[0]) * u[2] + (y - d[1]) * u[5] + (z - d[2]) * u[8]
    return min(max(s, -half), half)


@compiled
def sphere_capsule(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Capsule i and sphere j."""
    d, u, c = centre[i], axes[i], centre[j]
    s = along(c[0], c[1], c[2], d, u, size[i, 1])
    x, y, z = d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8]
    return balls(which, found, count, i, j, 0,
                 x, y, z, size[i, 0], c[0], c[1], c[2], size[j, 0], most)  # fmt: skip


@compiled
def capsules(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Two capsules: their nearest points; of parallel ones the ends of what lies side by side."""
    d, u, e, w = centre[i], axes[i], centre[j], axes[j]
    hi, hj = size[i, 1], size[j, 1]
    c = u[2] * w[2] + u[5] * w[5] + u[8] * w[8]
    rx, ry, rz = e[0] - d[0], e[1] - d[1], e[2] - d[2]
    p, q = rx * u[2] + ry * u[5] + rz * u[8], rx * w[2] + ry * w[5] + rz * w[8]
    det = 1.0 - c * c
    if det > PARALLEL:
        s = min(max((p - c * q) / det, -hi), hi)
        t = min(max(c * s - q, -hj), hj)
        s = min(max(p + c * t, -hi), hi)
        return _pair(which, found, count, i, j, 0, s, t, centre, axes, size, most)
    low, high = max(-hi, p - hj), min(hi, p + hj)
    if low >= high:  # end to end
        s = hi if p > 0.0 else -hi
        t = min(max(c * s - q, -hj), hj)
        return _pair(which, found, count, i, j, 0, s, t, centre, axes, size, most)
    count = _pair(which, found, count, i, j, 1, low, c * low - q, centre, axes, size, most)
    return _pair(which, found, count, i, j, 2, high, c * high - q, centre, axes, size, most)


@compiled
def _pair(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int, s: float, t: float,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """The balls at s and t of two capsules."""
    d, u, e, w = centre[i], axes[i], centre[j], axes[j]
    return balls(
        which, found, count, i, j, feature,
        d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8], size[i, 0],
        e[0] + t * w[2], e[1] + t * w[5], e[2] + t * w[8], size[j, 0], most,
    )  # fmt: skip
