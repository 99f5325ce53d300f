"""Two boxes: the axis that parts them best, then the points of a face or of two edges.

Sources: Gottschalk, Lin, Manocha, OBBTree (1996), for the fifteen axes; Sutherland, Hodgman,
Reentrant polygon clipping (1974).
"""

import math

from dap3d_core.assembly.collisions.records import add
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Length^2 of the product of two directions of edges below which they are parallel.
PARALLEL = 1e-8
#: Part of the size by which edges have to part boxes better than faces do.
BETTER = 1e-6
#: Part of the size within which a point lies on the border of a face.
BORDER = 1e-9
#: Rows of scratch of two polygons: corners, at most 8 each.
CORNERS = 16


@compiled
def dot_axis(u: Floats, k: int, x: float, y: float, z: float) -> float:
    """Component of a vector along axis k of a box."""
    return u[k] * x + u[3 + k] * y + u[6 + k] * z


@compiled
def apart(
    i: int, j: int, x: float, y: float, z: float, centre: Floats, axes: Floats, size: Floats
) -> float:
    """Distance of two boxes along a unit vector, negative where they overlap there."""
    r = 0.0
    for k in range(3):
        r += size[i, k] * abs(dot_axis(axes[i], k, x, y, z))
        r += size[j, k] * abs(dot_axis(axes[j], k, x, y, z))
    d, e = centre[i], centre[j]
    return abs((d[0] - e[0]) * x + (d[1] - e[1]) * y + (d[2] - e[2]) * z) - r


@compiled
def boxes(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, polygon: Floats, most: float,
) -> int:  # fmt: skip
    """Boxes i and j; polygon: (CORNERS, 3) scratch."""
    best, axis = -1e300, 0
    for k in range(6):
        u = axes[i] if k < 3 else axes[j]
        gap = apart(i, j, u[k % 3], u[3 + k % 3], u[6 + k % 3], centre, axes, size)
        if gap > best + BORDER * size[i, 0]:
            best, axis = gap, k
        if gap > most:
            return count
    u, w = axes[i], axes[j]
    ex, ey, ez, edges = 0.0, 0.0, 0.0, -1
    across = best + BETTER * (size[i, 0] + size[j, 0])
    for k in range(9):
        a, b = k // 3, k % 3
        x = u[3 + a] * w[6 + b] - u[6 + a] * w[3 + b]
        y = u[6 + a] * w[b] - u[a] * w[6 + b]
        z = u[a] * w[3 + b] - u[3 + a] * w[b]
        length = x * x + y * y + z * z
        if length > PARALLEL:
            length = math.sqrt(length)
            x, y, z = x / length, y / length, z / length
            gap = apart(i, j, x, y, z, centre, axes, size)
            if gap > most:
                return count
            if gap > across:
                across, edges, ex, ey, ez = gap, k, x, y, z
    if edges >= 0:
        return _edges(which, found, count, i, j, edges, ex, ey, ez, across,
                      centre, axes, size, most)  # fmt: skip
    if axis < 3:
        return _face(which, found, count, i, j, i, j, axis, centre, axes, size, polygon, most)
    return _face(which, found, count, i, j, j, i, axis - 3, centre, axes, size, polygon, most)


@compiled
def _edges(
    which: Integers, found: Floats, count: int, i: int, j: int, pair: int,
    x: float, y: float, z: float, gap: float,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Where two edges pass each other, along their common normal (x, y, z)."""
    d, e, u, w, a, b = centre[i], centre[j], axes[i], axes[j], pair // 3, pair % 3
    if (d[0] - e[0]) * x + (d[1] - e[1]) * y + (d[2] - e[2]) * z < 0.0:
        x, y, z = -x, -y, -z
    # middles of the edges: of box i the one towards j, of box j the one towards i
    px, py, pz, qx, qy, qz = d[0], d[1], d[2], e[0], e[1], e[2]
    for k in range(3):
        if k != a:
            s = -size[i, k] if dot_axis(u, k, x, y, z) > 0.0 else size[i, k]
            px, py, pz = px + s * u[k], py + s * u[3 + k], pz + s * u[6 + k]
        if k != b:
            s = size[j, k] if dot_axis(w, k, x, y, z) > 0.0 else -size[j, k]
            qx, qy, qz = qx + s * w[k], qy + s * w[3 + k], qz + s * w[6 + k]
    rx, ry, rz = px - qx, py - qy, pz - qz
    c = u[a] * w[b] + u[3 + a] * w[3 + b] + u[6 + a] * w[6 + b]
    t = (dot_axis(w, b, rx, ry, rz) - c * dot_axis(u, a, rx, ry, rz)) / (1.0 - c * c)
    return add(which, found, count, i, j, 100 + pair, qx + t * w[b], qy + t * w[3 + b],
               qz + t * w[6 + b], x, y, z, gap, most)  # fmt: skip


@compiled
def _face(
    which: Integers, found: Floats, count: int, i: int, j: int, owner: int, other: int, axis: int,
    centre: Floats, axes: Floats, size: Floats, polygon: Floats, most: float,
) -> int:  # fmt: skip
    """The face of box ``other`` that looks at a face of ``owner``, clipped to that."""
    d, u, e = centre[owner], axes[owner], centre[other]
    side = dot_axis(u, axis, e[0] - d[0], e[1] - d[1], e[2] - d[2])
    side = 1.0 if side >= 0.0 else -1.0
    nx, ny, nz = side * u[axis], side * u[3 + axis], side * u[6 + axis]
    corners = _facing(other, nx, ny, nz, centre, axes, size, polygon)
    border = BORDER * (size[owner, 0] + size[owner, 1] + size[owner, 2])
    for k in range(4):
        across = (axis + 1 + k // 2) % 3
        sign = 2.0 * (k % 2) - 1.0
        x, y, z = sign * u[across], sign * u[3 + across], sign * u[6 + across]
        limit = size[owner, across] + d[0] * x + d[1] * y + d[2] * z
        corners = _clip(polygon, corners, x, y, z, limit, border)
    level = size[owner, axis] + d[0] * nx + d[1] * ny + d[2] * nz
    sign = 1.0 if owner == j else -1.0
    for k in range(corners):
        p = polygon[k]
        gap = p[0] * nx + p[1] * ny + p[2] * nz - level
        back = gap if owner == j else 0.0  # the point on the surface of shape j
        count = add(which, found, count, i, j, 16 * axis + k, p[0] - back * nx, p[1] - back * ny,
                    p[2] - back * nz, sign * nx, sign * ny, sign * nz, gap, most)  # fmt: skip
    return count


@compiled
def _facing(
    box: int, nx: float, ny: float, nz: float,
    centre: Floats, axes: Floats, size: Floats, polygon: Floats,
) -> int:  # fmt: skip
    """Put the corners of the face that is turned most against a normal; their number."""
    d, u, h, best, face = centre[box], axes[box], size[box], -1.0, 0
    for k in range(3):
        turned = abs(dot_axis(u, k, nx, ny, nz))
        if turned > best + BORDER:
            best, face = turned, k
    s = -h[face] if dot_axis(u, face, nx, ny, nz) > 0.0 else h[face]
    a, b = (face + 1) % 3, (face + 2) % 3
    for k in range(4):
        p = h[a] if k == 0 or k == 3 else -h[a]
        q = h[b] if k < 2 else -h[b]
        for c in range(3):
            polygon[k, c] = d[c] + s * u[3 * c + face] + p * u[3 * c + a] + q * u[3 * c + b]
    return 4


@compiled
def _clip(
    polygon: Floats, corners: int, x: float, y: float, z: float, limit: float, border: float
) -> int:
    """Clip a polygon to a half space, in place; the number of corners that are left."""
    half, left = CORNERS // 2, 0
    for k in range(corners):
        for c in range(3):
            polygon[half + k, c] = polygon[k, c]
    for k in range(corners):
        p, q = polygon[half + k], polygon[half + (k + 1) % corners]
        a = p[0] * x + p[1] * y + p[2] * z - limit
        b = q[0] * x + q[1] * y + q[2] * z - limit
        if a <= border and left < half:
            for c in range(3):
                polygon[left, c] = p[c]
            left += 1
        if ((a < -border and b > border) or (a > border and b < -border)) and left < half:
            s = a / (a - b)
            for c in range(3):
                polygon[left, c] = p[c] + s * (q[c] - p[c])
            left += 1
    return left
