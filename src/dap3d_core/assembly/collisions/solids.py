"""Points where spheres and capsules touch each other and boxes, spheres cylinders, these a plane.

All of them by formulas: distances of points and line segments, nearest points of solids, and at a
plane gaps of centres, ends and corners.
"""

import math

from dap3d_core.assembly.collisions.placed_shapes import CORNERS, PlacedShapes, add
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import BOX, CAPSULE, SPHERE


@compiled
def above(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int, x: float, y: float, z: float,
    radius: float,
) -> int:  # fmt: skip
    """A ball of shape i above plane j."""
    o, a = shapes.centre[j], shapes.axes[j]
    nx, ny, nz = a[2], a[5], a[8]
    height = (x - o[0]) * nx + (y - o[1]) * ny + (z - o[2]) * nz
    return add(shapes, count, i, j, feature, x - height * nx, y - height * ny,
               z - height * nz, nx, ny, nz, height - radius)  # fmt: skip


@compiled
def at_plane(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Shape i above plane j."""
    d, u, radius, kind = shapes.centre[i], shapes.axes[i], shapes.size[i, 0], shapes.kind[i]
    if kind == SPHERE:
        return above(shapes, count, i, j, 0, d[0], d[1], d[2], radius)
    if kind == CAPSULE:
        for side in range(2):
            s = shapes.size[i, 1] * (2.0 * side - 1.0)
            x, y, z = d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8]
            count = above(shapes, count, i, j, side, x, y, z, radius)
    if kind == BOX:
        for corner in range(8):
            a = shapes.size[i, 0] * (2.0 * (corner & 1) - 1.0)
            b = shapes.size[i, 1] * (1.0 * (corner & 2) - 1.0)
            c = shapes.size[i, 2] * (0.5 * (corner & 4) - 1.0)
            x = d[0] + a * u[0] + b * u[1] + c * u[2]
            y = d[1] + a * u[3] + b * u[4] + c * u[5]
            z = d[2] + a * u[6] + b * u[7] + c * u[8]
            count = above(shapes, count, i, j, corner, x, y, z, 0.0)
    return count


#: Sine^2 of the angle between axes below which they are parallel.
PARALLEL = 1e-12


@compiled
def balls(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int, x: float, y: float, z: float,
    ri: float, a: float, b: float, c: float, rj: float,
) -> int:  # fmt: skip
    """A ball of radius ri about (x, y, z), of shape i, and one of radius rj about (a, b, c)."""
    nx, ny, nz = x - a, y - b, z - c
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        nx, ny, nz = nx / length, ny / length, nz / length
    else:
        nx, ny, nz = 0.0, 0.0, 1.0
    gap = length - ri - rj
    return add(shapes, count, i, j, feature,
               a + rj * nx, b + rj * ny, c + rj * nz, nx, ny, nz, gap)  # fmt: skip


@compiled
def along(x: float, y: float, z: float, d: Floats, u: Floats, half: float) -> float:
    """Where on a segment about d, along u, is nearest to a point: from -half to half."""
    s = (x - d[0]) * u[2] + (y - d[1]) * u[5] + (z - d[2]) * u[8]
    return min(max(s, -half), half)


@compiled
def sphere_capsule(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Capsule i and sphere j."""
    d, u, c = shapes.centre[i], shapes.axes[i], shapes.centre[j]
    s = along(c[0], c[1], c[2], d, u, shapes.size[i, 1])
    x, y, z = d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8]
    return balls(shapes, count, i, j, 0,
                 x, y, z, shapes.size[i, 0], c[0], c[1], c[2], shapes.size[j, 0])  # fmt: skip


@compiled
def capsules(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Two capsules: their nearest points; of parallel ones the ends of what lies side by side."""
    d, u, e, w = shapes.centre[i], shapes.axes[i], shapes.centre[j], shapes.axes[j]
    hi, hj = shapes.size[i, 1], shapes.size[j, 1]
    c = u[2] * w[2] + u[5] * w[5] + u[8] * w[8]
    rx, ry, rz = e[0] - d[0], e[1] - d[1], e[2] - d[2]
    p, q = rx * u[2] + ry * u[5] + rz * u[8], rx * w[2] + ry * w[5] + rz * w[8]
    det = 1.0 - c * c
    if det > PARALLEL:
        s = min(max((p - c * q) / det, -hi), hi)
        t = min(max(c * s - q, -hj), hj)
        s = min(max(p + c * t, -hi), hi)
        return _pair(shapes, count, i, j, 0, s, t)
    low, high = max(-hi, p - hj), min(hi, p + hj)
    if low >= high:  # end to end
        s = hi if p > 0.0 else -hi
        t = min(max(c * s - q, -hj), hj)
        return _pair(shapes, count, i, j, 0, s, t)
    count = _pair(shapes, count, i, j, 1, low, c * low - q)
    return _pair(shapes, count, i, j, 2, high, c * high - q)


@compiled
def _pair(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int, s: float, t: float
) -> int:
    """The balls at s and t of two capsules."""
    d, u, e, w = shapes.centre[i], shapes.axes[i], shapes.centre[j], shapes.axes[j]
    return balls(
        shapes, count, i, j, feature,
        d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8], shapes.size[i, 0],
        e[0] + t * w[2], e[1] + t * w[5], e[2] + t * w[8], shapes.size[j, 0],
    )  # fmt: skip


#: Feature of the point between the ends of a capsule.
BETWEEN = 2


@compiled
def clamp(x: float, half: float) -> float:
    """The nearest number from -half to half."""
    return min(max(x, -half), half)


@compiled
def local(x: float, y: float, z: float, d: Floats, u: Floats, k: int) -> float:
    """Component k of a point in the axes u of a shape about d."""
    return (x - d[0]) * u[k] + (y - d[1]) * u[3 + k] + (z - d[2]) * u[6 + k]


@compiled
def put(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int, gap: float, radius: float
) -> int:
    """Append a point: ball j of a radius at solid i.

    In scratch: nearest point of the solid, outward normal there, in its axes. gap: of the centre.
    """
    d, u = shapes.centre[i], shapes.axes[i]
    q, n = shapes.scratch[CORNERS], shapes.scratch[CORNERS + 1]
    nx = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    ny = u[3] * n[0] + u[4] * n[1] + u[5] * n[2]
    nz = u[6] * n[0] + u[7] * n[1] + u[8] * n[2]
    s = gap - radius  # the surface of the ball is so far along the normal
    x = d[0] + u[0] * q[0] + u[1] * q[1] + u[2] * q[2] + s * nx
    y = d[1] + u[3] * q[0] + u[4] * q[1] + u[5] * q[2] + s * ny
    z = d[2] + u[6] * q[0] + u[7] * q[1] + u[8] * q[2] + s * nz
    return add(shapes, count, i, j, feature, x, y, z, -nx, -ny, -nz, s)


@compiled
def ball_box(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int, x: float, y: float, z: float,
    radius: float,
) -> int:  # fmt: skip
    """Box i and a ball of shape j."""
    q, n = shapes.scratch[CORNERS], shapes.scratch[CORNERS + 1]
    d, u, h = shapes.centre[i], shapes.axes[i], shapes.size[i]
    length, nearest, face = 0.0, -1e300, 0
    for k in range(3):
        p = local(x, y, z, d, u, k)
        q[k] = clamp(p, h[k])
        n[k] = p - q[k]
        length += n[k] * n[k]
        if abs(p) - h[k] > nearest:
            nearest, face = abs(p) - h[k], k
    length = math.sqrt(length)
    if length > 0.0:
        for k in range(3):
            n[k] /= length
    else:  # the centre is inside: out by the nearest face
        side = 1.0 if local(x, y, z, d, u, face) >= 0.0 else -1.0
        n[0], n[1], n[2] = 0.0, 0.0, 0.0
        n[face] = side
        q[face] = side * h[face]
        length = nearest
    return put(shapes, count, i, j, feature, length, radius)


@compiled
def sphere_cylinder(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Cylinder i and sphere j."""
    q, n = shapes.scratch[CORNERS], shapes.scratch[CORNERS + 1]
    c, d, u = shapes.centre[j], shapes.centre[i], shapes.axes[i]
    r, h = shapes.size[i, 0], shapes.size[i, 1]
    x, y = local(c[0], c[1], c[2], d, u, 0), local(c[0], c[1], c[2], d, u, 1)
    z, across = local(c[0], c[1], c[2], d, u, 2), math.sqrt(x * x + y * y)
    a = x / across if across > 0.0 else 1.0
    b = y / across if across > 0.0 else 0.0
    out, up = across - r, abs(z) - h
    side = 1.0 if z >= 0.0 else -1.0
    p, s = min(across, r), clamp(z, h)
    length = out if out > up else up
    if out > 0.0 and up > 0.0:
        length = math.sqrt(out * out + up * up)
        n[0], n[1], n[2] = a * out / length, b * out / length, side * up / length
    elif out > up:
        p = r
        n[0], n[1], n[2] = a, b, 0.0
    else:
        s = side * h
        n[0], n[1], n[2] = 0.0, 0.0, side
    q[0], q[1], q[2] = a * p, b * p, s
    return put(shapes, count, i, j, 0, length, shapes.size[j, 0])


@compiled
def capsule_box(shapes: PlacedShapes, count: int, i: int, j: int) -> int:
    """Box i and capsule j: the balls at its ends, and that at its point nearest to the box."""
    c, w, radius, half = shapes.centre[j], shapes.axes[j], shapes.size[j, 0], shapes.size[j, 1]
    low, high = -half, half
    # the squared distance is convex along the axis: its slope is monotonic
    if slope(shapes, low, i, j) < 0.0 < slope(shapes, high, i, j):
        s = _lowest(shapes, low, high, i, j)
        x, y, z = c[0] + s * w[2], c[1] + s * w[5], c[2] + s * w[8]
        count = ball_box(shapes, count, i, j, BETWEEN, x, y, z, radius)
    for end in range(2):
        s = half * (2.0 * end - 1.0)
        x, y, z = c[0] + s * w[2], c[1] + s * w[5], c[2] + s * w[8]
        count = ball_box(shapes, count, i, j, end, x, y, z, radius)
    return count


@compiled
def slope(shapes: PlacedShapes, s: float, i: int, j: int) -> float:
    """Half the slope of the squared distance of box i at s along the axis of capsule j."""
    c, w, d, u, total = shapes.centre[j], shapes.axes[j], shapes.centre[i], shapes.axes[i], 0.0
    x, y, z = c[0] + s * w[2], c[1] + s * w[5], c[2] + s * w[8]
    for k in range(3):
        p = local(x, y, z, d, u, k)
        total += (p - clamp(p, shapes.size[i, k])) * (
            u[k] * w[2] + u[3 + k] * w[5] + u[6 + k] * w[8]
        )
    return total


@compiled
def _lowest(shapes: PlacedShapes, low: float, high: float, i: int, j: int) -> float:
    """The zero of a slope that is linear between places where a face is passed."""
    c, w, d, u = shapes.centre[j], shapes.axes[j], shapes.centre[i], shapes.axes[i]
    for k in range(6):
        face, side = k // 2, 2.0 * (k % 2) - 1.0
        rate = u[face] * w[2] + u[3 + face] * w[5] + u[6 + face] * w[8]
        if abs(rate) > 1e-12:
            s = (side * shapes.size[i, face] - local(c[0], c[1], c[2], d, u, face)) / rate
            if low < s < high:
                if slope(shapes, s, i, j) < 0.0:
                    low = s
                else:
                    high = s
    first, last = slope(shapes, low, i, j), slope(shapes, high, i, j)
    return low - first * (high - low) / (last - first) if last > first else 0.5 * (low + high)
