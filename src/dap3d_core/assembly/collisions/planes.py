"""Shapes at a plane: gaps of centres, ends, corners and rims."""

import math

from dap3d_core.assembly.collisions.records import add
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import BOX, CAPSULE, CYLINDER, SPHERE

#: Length of the part of a plane's normal across an axis below which a rim lies flat.
FLAT = 1e-9


@compiled
def above(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int,
    x: float, y: float, z: float, radius: float, centre: Floats, axes: Floats, most: float,
) -> int:  # fmt: skip
    """A ball of shape i above plane j."""
    o, a = centre[j], axes[j]
    nx, ny, nz = a[2], a[5], a[8]
    height = (x - o[0]) * nx + (y - o[1]) * ny + (z - o[2]) * nz
    return add(which, found, count, i, j, feature, x - height * nx, y - height * ny,
               z - height * nz, nx, ny, nz, height - radius, most)  # fmt: skip


@compiled
def at_plane(
    which: Integers, found: Floats, count: int, i: int, j: int, kind: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Shape i of a kind above plane j."""
    d, u, radius = centre[i], axes[i], size[i, 0]
    if kind == SPHERE:
        return above(which, found, count, i, j, 0, d[0], d[1], d[2], radius, centre, axes, most)
    if kind == CAPSULE:
        for side in range(2):
            s = size[i, 1] * (2.0 * side - 1.0)
            x, y, z = d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8]
            count = above(which, found, count, i, j, side, x, y, z, radius, centre, axes, most)
    if kind == BOX:
        for corner in range(8):
            a = size[i, 0] * (2.0 * (corner & 1) - 1.0)
            b = size[i, 1] * (1.0 * (corner & 2) - 1.0)
            c = size[i, 2] * (0.5 * (corner & 4) - 1.0)
            x = d[0] + a * u[0] + b * u[1] + c * u[2]
            y = d[1] + a * u[3] + b * u[4] + c * u[5]
            z = d[2] + a * u[6] + b * u[7] + c * u[8]
            count = above(which, found, count, i, j, corner, x, y, z, 0.0, centre, axes, most)
    if kind == CYLINDER:
        count = _rims(which, found, count, i, j, centre, axes, size, most)
    return count


@compiled
def _rims(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Both rims of a cylinder: the lowest point of each, and three more a quarter turn apart."""
    d, u, w = centre[i], axes[i], axes[j]
    # the way down within the plane of a rim, in the axes of the cylinder
    a = -(w[2] * u[0] + w[5] * u[3] + w[8] * u[6])
    b = -(w[2] * u[1] + w[5] * u[4] + w[8] * u[7])
    length = math.sqrt(a * a + b * b)
    if length > FLAT:
        a, b = a / length, b / length
    else:
        a, b = 1.0, 0.0
    for side in range(2):
        c = size[i, 1] * (2.0 * side - 1.0)
        p, q = size[i, 0] * a, size[i, 0] * b
        for k in range(4):
            x = d[0] + p * u[0] + q * u[1] + c * u[2]
            y = d[1] + p * u[3] + q * u[4] + c * u[5]
            z = d[2] + p * u[6] + q * u[7] + c * u[8]
            feature = 4 * side + k
            count = above(which, found, count, i, j, feature, x, y, z, 0.0, centre, axes, most)
            p, q = -q, p
    return count
