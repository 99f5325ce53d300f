"""Two boxes: the axis that parts them best, then the points of a face or of two edges.

Sources: Gottschalk, Lin, Manocha, OBBTree (1996), for the fifteen axes; Sutherland, Hodgman,
Reentrant polygon clipping (1974).
"""

import math

from dap3d_core.assembly.collisions.placed_shapes import CORNERS, PlacedShapes, add
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Length^2 of the product of two directions of edges below which they are parallel.
PARALLEL = 1e-8
#: Part of the size by which edges have to part boxes better than faces do.
BETTER = 1e-6
#: Part of the size within which a point lies on the border of a face.
BORDER = 1e-9


@compiled
def dot_axis(u: Floats, k: int, x: float, y: float, z: float) -> float:
    """Component of a vector along axis k of a box."""
    return u[k] * x + u[3 + k] * y + u[6 + k] * z


@compiled
def apart(shapes: PlacedShapes, i: int, j: int, x: float, y: float, z: float) -> float:
    """Distance of two boxes along a unit vector, negative where they overlap there."""
    r = 0.0
    for k in range(3):
        r += shapes.size[i, k] * abs(dot_axis(shapes.axes[i], k, x, y, z))
        r += shapes.size[j, k] * abs(dot_axis(shapes.axes[j], k, x, y, z))
    d, e = shapes.centre[i], shapes.centre[j]
    return abs((d[0] - e[0]) * x + (d[1] - e[1]) * y + (d[2] - e[2]) * z) - r


@compiled
def boxes(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Boxes i and j."""
    best, axis, most = -1e300, 0, shapes.near[i] + shapes.near[j]
    for k in range(6):
        u = shapes.axes[i] if k < 3 else shapes.axes[j]
        gap = apart(shapes, i, j, u[k % 3], u[3 + k % 3], u[6 + k % 3])
        if gap > best + BORDER * shapes.size[i, 0]:
            best, axis = gap, k
        if gap > most:
            return count
    u, w = shapes.axes[i], shapes.axes[j]
    ex, ey, ez, edges = 0.0, 0.0, 0.0, -1
    across = best + BETTER * (shapes.size[i, 0] + shapes.size[j, 0])
    for k in range(9):
        a, b = k // 3, k % 3
        x = u[3 + a] * w[6 + b] - u[6 + a] * w[3 + b]
        y = u[6 + a] * w[b] - u[a] * w[6 + b]
        z = u[a] * w[3 + b] - u[3 + a] * w[b]
        length = x * x + y * y + z * z
        if length > PARALLEL:
            length = math.sqrt(length)
            x, y, z = x / length, y / length, z / length
            gap = apart(shapes, i, j, x, y, z)
            if gap > most:
                return count
            if gap > across:
                across, edges, ex, ey, ez = gap, k, x, y, z
    if edges >= 0:
        return _edges(shapes, count, i, j, edges, ex, ey, ez, across)
    if axis < 3:
        return _face(shapes, count, i, j, i, j, axis)
    return _face(shapes, count, i, j, j, i, axis - 3)


@compiled
def _edges(
    shapes: PlacedShapes, count: int, i: int, j: int, pair: int, x: float, y: float, z: float,
    gap: float,
) -> int:  # fmt: skip
    """Where two edges pass each other, along their common normal (x, y, z)."""
    d, e, u, w = shapes.centre[i], shapes.centre[j], shapes.axes[i], shapes.axes[j]
    a, b = pair // 3, pair % 3
    if (d[0] - e[0]) * x + (d[1] - e[1]) * y + (d[2] - e[2]) * z < 0.0:
        x, y, z = -x, -y, -z
    # middles of the edges: of box i the one towards j, of box j the one towards i
    px, py, pz, qx, qy, qz = d[0], d[1], d[2], e[0], e[1], e[2]
    for k in range(3):
        if k != a:
            s = -shapes.size[i, k] if dot_axis(u, k, x, y, z) > 0.0 else shapes.size[i, k]
            px, py, pz = px + s * u[k], py + s * u[3 + k], pz + s * u[6 + k]
        if k != b:
            s = shapes.size[j, k] if dot_axis(w, k, x, y, z) > 0.0 else -shapes.size[j, k]
            qx, qy, qz = qx + s * w[k], qy + s * w[3 + k], qz + s * w[6 + k]
    rx, ry, rz = px - qx, py - qy, pz - qz
    c = u[a] * w[b] + u[3 + a] * w[3 + b] + u[6 + a] * w[6 + b]
    t = (dot_axis(w, b, rx, ry, rz) - c * dot_axis(u, a, rx, ry, rz)) / (1.0 - c * c)
    return add(shapes, count, i, j, 100 + pair, qx + t * w[b], qy + t * w[3 + b],
               qz + t * w[6 + b], x, y, z, gap)  # fmt: skip


@compiled
def _face(
    shapes: PlacedShapes, count: int, i: int, j: int, owner: int, other: int, axis: int
) -> int:
    """The face of box ``other`` that looks at a face of ``owner``, clipped to that."""
    d, u, e = shapes.centre[owner], shapes.axes[owner], shapes.centre[other]
    side = dot_axis(u, axis, e[0] - d[0], e[1] - d[1], e[2] - d[2])
    side = 1.0 if side >= 0.0 else -1.0
    nx, ny, nz = side * u[axis], side * u[3 + axis], side * u[6 + axis]
    _put_facing(shapes, other, nx, ny, nz)
    corners, polygon = 4, shapes.scratch
    border = BORDER * (shapes.size[owner, 0] + shapes.size[owner, 1] + shapes.size[owner, 2])
    for k in range(4):
        across = (axis + 1 + k // 2) % 3
        sign = 2.0 * (k % 2) - 1.0
        x, y, z = sign * u[across], sign * u[3 + across], sign * u[6 + across]
        limit = shapes.size[owner, across] + d[0] * x + d[1] * y + d[2] * z
        corners = _clip(polygon, corners, x, y, z, limit, border)
    level = shapes.size[owner, axis] + d[0] * nx + d[1] * ny + d[2] * nz
    sign = 1.0 if owner == j else -1.0
    for k in range(corners):
        p = polygon[k]
        gap = p[0] * nx + p[1] * ny + p[2] * nz - level
        back = gap if owner == j else 0.0  # the point on the surface of shape j
        count = add(shapes, count, i, j, 16 * axis + k, p[0] - back * nx, p[1] - back * ny,
                    p[2] - back * nz, sign * nx, sign * ny, sign * nz, gap)  # fmt: skip
    return count


@compiled
def _put_facing(shapes: PlacedShapes, box: int, nx: float, ny: float, nz: float) -> None:
    """Put the four corners of the face that is turned most against a normal."""
    d, u, h, best, face = shapes.centre[box], shapes.axes[box], shapes.size[box], -1.0, 0
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
            x = d[c] + s * u[3 * c + face] + p * u[3 * c + a] + q * u[3 * c + b]
            shapes.scratch[k, c] = x


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
