"""Points where spheres, capsules and boxes touch, spheres cylinders, and these a plane.

All of them by formulas: distances of points and line segments, nearest points of solids, and at a
plane gaps of centres, ends and corners. Of two boxes the axis that parts them best, then the points
of a face or of two edges.

Sources: Gottschalk, Lin, Manocha, OBBTree (1996), for the fifteen axes; Sutherland, Hodgman,
Reentrant polygon clipping (1974).
"""

import math

from dap3d_core.assembly.collisions.placed_shapes import CORNERS, PlacedShapes, add
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import BOX, CAPSULE, SPHERE

#: Sine^2 of the angle between axes of capsules below which they are parallel.
PARALLEL = 1e-12
#: Length^2 of the product of two directions of edges below which they are parallel.
PARALLEL_EDGES = 1e-8
#: Part of the size by which edges have to part boxes better than faces do.
BETTER = 1e-6
#: Part of the size within which a point lies on the border of a face; times it points are one.
BORDER, SAME = 1e-9, 4.0


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


#: Features of points between the ends of a capsule: the nearest, and from here on those at edges.
BETWEEN, EDGE = 2, 3
#: Part of the radius by which these are apart, or else they are one.
TWICE = 1e-3


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
    """Box i and capsule j: the balls at its ends, at its point nearest to the box, and at edges.

    These are where the axis passes faces first and last: one that lies across a box lies on two
    edges, both of them as near.
    """
    c, w, radius, half = shapes.centre[j], shapes.axes[j], shapes.size[j, 0], shapes.size[j, 1]
    low, high = -half, half
    nearest = low if slope(shapes, low, i, j) >= 0.0 else high
    # the squared distance is convex along the axis: its slope is monotonic
    if slope(shapes, low, i, j) < 0.0 < slope(shapes, high, i, j):
        nearest = _lowest(shapes, low, high, i, j)
        x, y, z = c[0] + nearest * w[2], c[1] + nearest * w[5], c[2] + nearest * w[8]
        count = ball_box(shapes, count, i, j, BETWEEN, x, y, z, radius)
    for end in range(2):
        s = half * (2.0 * end - 1.0)
        x, y, z = c[0] + s * w[2], c[1] + s * w[5], c[2] + s * w[8]
        count = ball_box(shapes, count, i, j, end, x, y, z, radius)
    for end in range(2):
        edge, way = nearest, 2.0 * end - 1.0
        for k in range(6):
            s = _passing(shapes, k, i, j)
            if low < s < high and way * (s - edge) > 0.0:
                edge = s
        if abs(edge - nearest) > TWICE * radius:
            x, y, z = c[0] + edge * w[2], c[1] + edge * w[5], c[2] + edge * w[8]
            count = ball_box(shapes, count, i, j, EDGE + end, x, y, z, radius)
    return count


@compiled
def _passing(shapes: PlacedShapes, k: int, i: int, j: int) -> float:
    """Where the axis of capsule j passes the plane of face k of box i; 1e300 along it."""
    c, w, d, u = shapes.centre[j], shapes.axes[j], shapes.centre[i], shapes.axes[i]
    face, side = k // 2, 2.0 * (k % 2) - 1.0
    rate = u[face] * w[2] + u[3 + face] * w[5] + u[6 + face] * w[8]
    if abs(rate) <= 1e-12:
        return 1e300
    return (side * shapes.size[i, face] - local(c[0], c[1], c[2], d, u, face)) / rate


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
    for k in range(6):
        s = _passing(shapes, k, i, j)
        if low < s < high:
            if slope(shapes, s, i, j) < 0.0:
                low = s
            else:
                high = s
    first, last = slope(shapes, low, i, j), slope(shapes, high, i, j)
    return low - first * (high - low) / (last - first) if last > first else 0.5 * (low + high)


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
        if length > PARALLEL_EDGES:
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
    corners, polygon, half = 4, shapes.scratch, CORNERS // 2
    border = BORDER * (shapes.size[owner, 0] + shapes.size[owner, 1] + shapes.size[owner, 2])
    for k in range(4):
        across = (axis + 1 + k // 2) % 3
        sign = 2.0 * (k % 2) - 1.0
        x, y, z = sign * u[across], sign * u[3 + across], sign * u[6 + across]
        limit = shapes.size[owner, across] + d[0] * x + d[1] * y + d[2] * z
        corners = clip(polygon, 0, corners, half, half, x, y, z, limit, border)
    level = shapes.size[owner, axis] + d[0] * nx + d[1] * ny + d[2] * nz
    sign = 1.0 if owner == j else -1.0
    last, near = 0, (SAME * border) ** 2
    for k in range(corners):
        p = polygon[k]
        if k > 0 and min(square_between(p, polygon[0]), square_between(p, polygon[last])) <= near:
            continue  # of a strip as narrow as the border
        last = k
        gap = p[0] * nx + p[1] * ny + p[2] * nz - level
        back = gap if owner == j else 0.0  # the point on the surface of shape j
        count = add(shapes, count, i, j, 16 * axis + k, p[0] - back * nx, p[1] - back * ny,
                    p[2] - back * nz, sign * nx, sign * ny, sign * nz, gap)  # fmt: skip
    return count


@compiled
def square_between(p: Floats, q: Floats) -> float:
    """Square of the distance of two points, m^2."""
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return x * x + y * y + z * z


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
def clip(
    work: Floats, start: int, count: int, aside: int, most: int, x: float, y: float, z: float,
    limit: float, border: float,
) -> int:  # fmt: skip
    """Clip a polygon, or a line of two points, to a half space, in place; the corners left.

    Args:
        work: rows of points; the polygon, and scratch of as many rows as it may have.
        start, count: first corner, and their number.
        aside, most: first row of scratch, and corners at most.
        x, y, z: normal of the half space, out of it.
        limit: of products with that, m.
        border: a corner so near to the limit is on it, m.
    """
    left = 0
    for k in range(count):
        for c in range(3):
            work[aside + k, c] = work[start + k, c]
    for k in range(count):
        p, q = work[aside + k], work[aside + (k + 1) % count]
        a = p[0] * x + p[1] * y + p[2] * z - limit
        b = q[0] * x + q[1] * y + q[2] * z - limit
        if a <= border and left < most:
            for c in range(3):
                work[start + left, c] = p[c]
            left += 1
        crosses = (a < -border and b > border) or (a > border and b < -border)
        if crosses and left < most and (count > 2 or k == 0):  # a line has one edge
            s = a / (a - b)
            for c in range(3):
                work[start + left, c] = p[c] + s * (q[c] - p[c])
            left += 1
    return left
