"""Convex solids by their farthest points: supports, their curvature, points near a support plane.

A capsule is its axis here, a sphere its centre; their radii are added to distances.
"""

import math

from dap3d_core.assembly.collisions.boxes import dot_axis
from dap3d_core.assembly.collisions.placed_shapes import PlacedShapes
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    HULL,
    SPHERE,
)

#: Sine of the angle between an axis and a direction below which a rim lies flat.
FLAT = 1e-9
#: Points of a rim that stand for it, and of a face; with those that clipping adds.
RIM, CORNERS, CLIPPED_CORNERS = 8, 16, 32


@compiled
def radius_of(shapes: PlacedShapes, k: int) -> float:
    """What is added to the core of a solid, m."""
    return shapes.size[k, 0] if shapes.kind[k] == SPHERE or shapes.kind[k] == CAPSULE else 0.0


@compiled
def extent_of(shapes: PlacedShapes, k: int) -> float:
    """Length of the sizes of a solid, m."""
    size = shapes.size[k]
    return math.sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2])


@compiled
def put_global(shapes: PlacedShapes, k: int, x: float, y: float, z: float, out: Floats) -> None:
    """A point of solid k, given in its axes."""
    c, u = shapes.centre[k], shapes.axes[k]
    for r in range(3):
        out[r] = c[r] + u[3 * r] * x + u[3 * r + 1] * y + u[3 * r + 2] * z


@compiled
def support(shapes: PlacedShapes, k: int, sign: float, d: Floats, out: Floats) -> None:
    """The point of solid k that lies farthest along sign d."""
    u, h, what, vertices = shapes.axes[k], shapes.size[k], shapes.kind[k], shapes.vertices
    x = sign * dot_axis(u, 0, d[0], d[1], d[2])
    y = sign * dot_axis(u, 1, d[0], d[1], d[2])
    z = sign * dot_axis(u, 2, d[0], d[1], d[2])
    p, q, s = 0.0, 0.0, 0.0
    if what in (CAPSULE, CYLINDER):
        s = h[1] if z >= 0.0 else -h[1]
        across = math.sqrt(x * x + y * y)
        if what == CYLINDER and across > 0.0:
            p, q = h[0] * x / across, h[0] * y / across
    elif what == BOX:
        p = h[0] if x >= 0.0 else -h[0]
        q = h[1] if y >= 0.0 else -h[1]
        s = h[2] if z >= 0.0 else -h[2]
    elif what == ELLIPSOID:
        p, q, s = h[0] * h[0] * x, h[1] * h[1] * y, h[2] * h[2] * z
        length = math.sqrt(p * x + q * y + s * z)
        p, q, s = p / length, q / length, s / length
    elif what == HULL:
        best, at = -1e300, 0
        first = shapes.corners[k, 0]
        for c in range(first, first + shapes.corners[k, 1]):
            far = vertices[c, 0] * x + vertices[c, 1] * y + vertices[c, 2] * z
            if far > best:
                best, at = far, c
        p, q, s = vertices[at, 0], vertices[at, 1], vertices[at, 2]
    put_global(shapes, k, p, q, s, out)


@compiled
def curvature(shapes: PlacedShapes, k: int, d: Floats, s: Floats, t: Floats) -> float:
    """Product s H t, H the derivative of the support of solid k at unit d, even in d; m."""
    u, h = shapes.axes[k], shapes.size[k]
    x, y = dot_axis(u, 0, d[0], d[1], d[2]), dot_axis(u, 1, d[0], d[1], d[2])
    a, b = dot_axis(u, 0, s[0], s[1], s[2]), dot_axis(u, 1, s[0], s[1], s[2])
    p, q = dot_axis(u, 0, t[0], t[1], t[2]), dot_axis(u, 1, t[0], t[1], t[2])
    if shapes.kind[k] == CYLINDER:
        across = x * x + y * y
        if across < FLAT * FLAT:
            return 0.0
        return h[0] * (x * b - y * a) * (x * q - y * p) / (across * math.sqrt(across))
    if shapes.kind[k] == ELLIPSOID:
        z = dot_axis(u, 2, d[0], d[1], d[2])
        c, r = dot_axis(u, 2, s[0], s[1], s[2]), dot_axis(u, 2, t[0], t[1], t[2])
        e, f, g = h[0] * h[0], h[1] * h[1], h[2] * h[2]
        far = e * x * x + f * y * y + g * z * z
        one, two = e * a * x + f * b * y + g * c * z, e * p * x + f * q * y + g * r * z
        return (e * a * p + f * b * q + g * c * r - one * two / far) / math.sqrt(far)
    return 0.0


@compiled
def near_support(
    shapes: PlacedShapes, k: int, sign: float, d: Floats, band: float, start: int
) -> int:
    """Put the points of solid k within a band below its support plane along sign d; their number.

    They are rows of scratch from ``start`` on, CORNERS at most: of more, those farthest around.
    """
    u, h, what, count = shapes.axes[k], shapes.size[k], shapes.kind[k], 0
    if what in (SPHERE, ELLIPSOID):
        support(shapes, k, sign, d, shapes.work[start])
        return 1
    x = sign * dot_axis(u, 0, d[0], d[1], d[2])
    y = sign * dot_axis(u, 1, d[0], d[1], d[2])
    z = sign * dot_axis(u, 2, d[0], d[1], d[2])
    across = math.sqrt(x * x + y * y)
    a, b = (x / across, y / across) if across > FLAT else (1.0, 0.0)
    total = 2 if what == CAPSULE else 2 * RIM if what == CYLINDER else 8
    if what == HULL:
        total = shapes.corners[k, 1]
    best, e, f = -1e300, 1.0, 0.0
    for turn in range(2):  # the farthest first, then what is nearly as far
        for c in range(2 if turn == 0 and what == CYLINDER and across > FLAT else total):
            p, q, s = 0.0, 0.0, 0.0
            if what == HULL:
                v = shapes.vertices[shapes.corners[k, 0] + c]
                p, q, s = v[0], v[1], v[2]
            elif what == BOX:
                p = h[0] * (2.0 * (c & 1) - 1.0)
                q = h[1] * (1.0 * (c & 2) - 1.0)
                s = h[2] * (0.5 * (c & 4) - 1.0)
            else:
                s = h[1] * (2.0 * (c & 1) - 1.0)
                if what == CYLINDER:
                    if c % 2 == 0:  # of both ends
                        angle = 2.0 * math.pi / RIM * (c // 2)
                        e, f = math.cos(angle), math.sin(angle)
                    p, q = h[0] * (a * e - b * f), h[0] * (b * e + a * f)
            far = p * x + q * y + s * z
            if turn == 0:
                best = max(best, far)
            elif far >= best - band:
                if count < CORNERS:
                    put_global(shapes, k, p, q, s, shapes.work[start + count])
                count += 1
    if count > CORNERS:
        return _farthest_around(shapes, k, x, y, z, best - band, start)
    return count


@compiled
def _farthest_around(
    shapes: PlacedShapes, k: int, x: float, y: float, z: float, least: float, start: int
) -> int:
    """Put the vertex of a hull farthest along (x, y, z), in its axes, and those farthest around it.

    They are the farthest in CORNERS - 1 directions across that, of those beyond ``least`` along it.
    Returns their number.
    """
    vertices, first, count = shapes.vertices, shapes.corners[k, 0], 0
    one, ring, last = -1, -1, -1
    e0, e1, e2 = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    f0, f1, f2 = y * e2 - z * e1, z * e0 - x * e2, x * e1 - y * e0
    for side in range(CORNERS):
        angle = 2.0 * math.pi / (CORNERS - 1) * side
        a, b, best, at = math.cos(angle), math.sin(angle), -1e300, first
        p, q, s = a * e0 + b * f0, a * e1 + b * f1, a * e2 + b * f2
        if side == 0:
            p, q, s = x, y, z
        for c in range(first, first + shapes.corners[k, 1]):
            v = vertices[c]
            far = v[0] * p + v[1] * q + v[2] * s
            if far > best and v[0] * x + v[1] * y + v[2] * z >= least:
                best, at = far, c
        if side == 0 or (at != one and at != ring and at != last):
            put_global(shapes, k, vertices[at, 0], vertices[at, 1], vertices[at, 2],
                       shapes.work[start + count])  # fmt: skip
            count += 1
        one, ring, last = (at if side == 0 else one), (at if side == 1 else ring), at
    return count
