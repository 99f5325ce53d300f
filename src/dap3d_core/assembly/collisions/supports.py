"""Convex solids by their farthest points: supports, their curvature, points near a support plane.

A capsule is its axis here, a sphere its centre; their radii are added to distances.
"""

import math

from dap3d_core.assembly.collisions.placed_shapes import PlacedShapes
from dap3d_core.assembly.collisions.solids import dot_axis
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
    is_steep = what == CYLINDER and across > FLAT  # the rim's next point is 0.29 radii below then
    is_alone = is_steep and 0.25 * h[0] * across > band
    total = 2 if what == CAPSULE or is_alone else 2 * RIM if what == CYLINDER else 8
    if what == HULL:
        total = shapes.corners[k, 1]
    best, e, f = -1e300, 1.0, 0.0
    for turn in range(2):  # the farthest first, then what is nearly as far
        for c in range(2 if turn == 0 and is_steep else total):
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
        return _farthest_around(shapes, k, x, y, z, best - band, start, 0)
    return count


@compiled
def _farthest_around(
    shapes: PlacedShapes, k: int, x: float, y: float, z: float, least: float, start: int, count: int
) -> int:
    """Put the vertex of a hull farthest along (x, y, z), in its axes, and those farthest around it.

    They are the farthest in directions across that, of those beyond ``least`` along it, as many as
    ``count``, what is there already, leaves of CORNERS. Returns the number of all.
    """
    vertices, first, total = shapes.vertices, shapes.corners[k, 0], CORNERS - count
    e0, e1, e2 = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    f0, f1, f2 = y * e2 - z * e1, z * e0 - x * e2, x * e1 - y * e0
    for side in range(total):
        angle = 2.0 * math.pi / (total - 1) * side
        a, b, best, at = math.cos(angle), math.sin(angle), -1e300, first
        p, q, s = a * e0 + b * f0, a * e1 + b * f1, a * e2 + b * f2
        if side == 0:
            p, q, s = x, y, z
        for c in range(first, first + shapes.corners[k, 1]):
            v = vertices[c]
            far = v[0] * p + v[1] * q + v[2] * s
            if far > best and v[0] * x + v[1] * y + v[2] * z >= least:
                best, at = far, c
        count = _put_vertex(shapes, k, at, start, count)
    return count


@compiled
def _put_vertex(shapes: PlacedShapes, k: int, at: int, start: int, count: int) -> int:
    """Append a vertex of a hull to ``count`` rows of scratch, if it is none of them; the number."""
    v, last = shapes.vertices[at], shapes.work[start + count]
    put_global(shapes, k, v[0], v[1], v[2], last)
    for c in range(start, start + count):
        p = shapes.work[c]
        if p[0] == last[0] and p[1] == last[1] and p[2] == last[2]:
            return count
    return count + 1


@compiled
def put_crossed(
    shapes: PlacedShapes, k: int, sign: float, d: Floats, band: float, start: int, count: int,
    way: Floats, at: Floats,
) -> int:  # fmt: skip
    """Put the ``count`` points of a face of a hull anew, the edges first that a line crosses.

    The line is across d and the unit ``way``, through ``at``; the farthest vertex along the way is
    put as well. Of a face of few corners, or that the line misses, the points stay.

    Returns:
        Their number, CORNERS at most.
    """
    u, vertices = shapes.axes[k], shapes.vertices
    first, last = shapes.corners[k, 0], shapes.corners[k, 0] + shapes.corners[k, 1]
    x = sign * dot_axis(u, 0, d[0], d[1], d[2])
    y = sign * dot_axis(u, 1, d[0], d[1], d[2])
    z = sign * dot_axis(u, 2, d[0], d[1], d[2])
    a, b = dot_axis(u, 0, way[0], way[1], way[2]), dot_axis(u, 1, way[0], way[1], way[2])
    c = dot_axis(u, 2, way[0], way[1], way[2])
    e, f, g = y * c - z * b, z * a - x * c, x * b - y * a
    level, high, near, top, low = 0.0, -1e300, 0, first, first
    for r in range(3):
        level += way[r] * (at[r] - shapes.centre[k, r])
    for m in range(first, last):
        high = max(high, vertices[m, 0] * x + vertices[m, 1] * y + vertices[m, 2] * z)
    far, deep = -1e300, 1e300
    for m in range(first, last):
        v = vertices[m]
        if v[0] * x + v[1] * y + v[2] * z >= high - band:
            near, along = near + 1, v[0] * a + v[1] * b + v[2] * c - level
            top, far = (m, along) if along > far else (top, far)
            low, deep = (m, along) if along < deep else (low, deep)
    if near <= CORNERS or far <= 0.0 or deep >= 0.0:
        return count
    count = _put_vertex(shapes, k, top, start, 0)
    for side in range(2):
        over, under, kept = top, low, 0
        for turn in range(2 * near):  # one end of the edge, then the other, until both stay
            best, new, o = -1e300, -1, vertices[under if turn % 2 == 0 else over]
            beyond = o[0] * a + o[1] * b + o[2] * c - level
            to = o[0] * e + o[1] * f + o[2] * g
            old = over if turn % 2 == 0 else under
            for m in range(first, last):
                v = vertices[m]
                along = v[0] * a + v[1] * b + v[2] * c - level
                if (along >= 0.0) == (turn % 2 == 0) and (
                    v[0] * x + v[1] * y + v[2] * z >= high - band
                ):
                    s = v[0] * e + v[1] * f + v[2] * g
                    s = (1.0 - 2.0 * side) * (s * beyond - to * along) / (beyond - along)
                    if s > best or (s == best and m == old):
                        best, new = s, m
            kept = kept + 1 if new == old else 0
            over, under = (new, under) if turn % 2 == 0 else (over, new)
            if kept == 2:
                break
        count = _put_vertex(shapes, k, over, start, count)
        count = _put_vertex(shapes, k, under, start, count)
    return _farthest_around(shapes, k, x, y, z, high - band, start, count)
