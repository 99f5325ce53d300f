"""Points where two convex solids may touch, given the direction that parts them best."""

import math

from dap3d_core.assembly.collisions.placed_shapes import GAP, PlacedShapes, add
from dap3d_core.assembly.collisions.solids import clip
from dap3d_core.assembly.collisions.supports import (
    CLIPPED_CORNERS,
    CORNERS,
    RIM,
    extent_of,
    near_support,
    put_crossed,
    radius_of,
)
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.vectors import dot
from dap3d_core.scene.contacts.collision_shapes import CYLINDER, HULL, PLANE

#: Rows of scratch: polygons of i and j, their points while one is clipped; tangents; middle of a
#: cap, and the way from there to what touches it.
POLYGON, OTHER, CLIPPED, E1, E2, MIDDLE, WAY = 40, 72, 104, 136, 137, 139, 140
#: Parts of lengths within which corners lie on a line, edges are parallel, or points on a border.
ON_LINE, PARALLEL, BORDER = 1e-12, 1e-6, 1e-9
#: Part of the radius of a cap that lies within its points, whichever way they are turned.
WITHIN = 0.92
#: Points of solids this part of their size below a support plane are left out, however fast.
DEEPEST = 0.1


@compiled
def turn(p: Floats, q: Floats, r: Floats, work: Floats) -> float:
    """Twice the area of a triangle in the plane of the tangents, positive if it turns left."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        e, f, x, y = work[E1, k], work[E2, k], q[k] - p[k], r[k] - p[k]
        a, b, c, d = a + e * x, b + f * x, c + e * y, d + f * y
    far = math.sqrt((a * a + b * b) * (c * c + d * d))
    area = a * d - b * c
    return area if abs(area) > ON_LINE * far else 0.0


@compiled
def outline(work: Floats, start: int, count: int) -> int:
    """Leave of points those that bound them, as seen along the normal, in order; their number."""
    first, e = start, work[E1]
    for c in range(start + 1, start + count):
        if dot(work[c], e) < dot(work[first], e):
            first = c
    kept = 0
    while kept < count:
        for k in range(3):
            work[start + kept, k], work[first, k] = work[first, k], work[start + kept, k]
        kept += 1
        here, first = work[start + kept - 1], start
        for c in range(start + kept, start + count):
            side = turn(here, work[first], work[c], work)
            if first == start + kept - 1:
                side = -1.0  # the point itself
            beyond = 0.0
            if side == 0.0:
                for k in range(3):
                    beyond += (work[c, k] - here[k]) ** 2 - (work[first, k] - here[k]) ** 2
            if side < 0.0 or beyond > 0.0:
                first = c
        if first == start:
            break
    return kept


@compiled
def tangents(n: Floats, work: Floats) -> None:
    """Put two unit vectors across n."""
    e, f = work[E1], work[E2]
    x, y, z = (0.0, n[2], -n[1]) if abs(n[0]) < 0.6 else (-n[2], 0.0, n[0])
    length = math.sqrt(x * x + y * y + z * z)
    e[0], e[1], e[2] = x / length, y / length, z / length
    f[0], f[1] = n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2]
    f[2] = n[0] * e[1] - n[1] * e[0]


@compiled
def spread(work: Floats, start: int, count: int, n: Floats) -> float:
    """Difference of heights of a polygon."""
    low, high = 1e300, -1e300
    for c in range(start, start + count):
        low, high = min(low, dot(work[c], n)), max(high, dot(work[c], n))
    return high - low


@compiled
def inside(work: Floats, start: int, count: int, other: int, corners: int, size: float) -> int:
    """Clip a polygon to another one, of two corners to between their ends; its corners."""
    x = work[E2 + 1]
    for k in range(corners):
        p, q = work[other + k], work[other + (k + 1) % corners]
        a, b = 0.0, 0.0
        for c in range(3):
            a, b = a + work[E1, c] * (q[c] - p[c]), b + work[E2, c] * (q[c] - p[c])
        length = math.sqrt(a * a + b * b)
        if length > 0.0 and count:
            a, b = a / length, b / length
            for c in range(3):
                if corners > 2:
                    x[c] = b * work[E1, c] - a * work[E2, c]
                else:
                    x[c] = a * work[E1, c] + b * work[E2, c]
            at = dot(x, p) if corners > 2 else dot(x, q)
            count = clip(work, start, count, CLIPPED, CLIPPED_CORNERS, x[0], x[1], x[2], at,
                         BORDER * size)  # fmt: skip
    return count


@compiled
def put_middle(work: Floats, start: int, count: int, out: int) -> None:
    """The middle of the points of a face."""
    for k in range(3):
        work[out, k] = 0.0
        for c in range(count):
            work[out, k] += work[start + c, k] / count


@compiled
def put_way(shapes: PlacedShapes, j: int, other: int, corners: int, n: Floats) -> float:
    """Put the way across n from the middle of a face to the nearest point of j; its length."""
    work, least, over = shapes.work, 1e300, corners > 2
    middle, way, x = work[MIDDLE], work[WAY], work[E2 + 1]
    is_cap = shapes.kind[j] == CYLINDER and corners == RIM  # to its middle, and its radius less
    for c in range(1 if is_cap or corners == 2 else corners):
        p, q, along, square = work[other + c], work[other + (c + 1) % corners], 0.0, 0.0
        for k in range(3):
            along, square = along + (q[k] - p[k]) * (middle[k] - p[k]), square + (q[k] - p[k]) ** 2
        along = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        over = over and turn(p, q, middle, work) >= 0.0
        if is_cap:
            put_middle(work, other, RIM, E2 + 1)
        for k in range(3):
            x[k] = (x[k] if is_cap else p[k] + along * (q[k] - p[k])) - middle[k]
        high = dot(x, n)
        for k in range(3):
            x[k] -= high * n[k]
        if dot(x, x) < least:
            least = dot(x, x)
            for k in range(3):
                way[k] = x[k]
    if is_cap:
        return math.sqrt(least) - WITHIN * shapes.size[j, 0]
    return 0.0 if over else math.sqrt(least)


@compiled
def face(
    shapes: PlacedShapes, i: int, start: int, count: int, j: int, other: int, corners: int,
    sign: float, n: Floats, band: float,
) -> int:  # fmt: skip
    """Turn the points of a face towards solid j where that touches it next to its border.

    Of a cap, or a face of many corners, they are some of the border, which lies beyond the chords
    between them: what touches there alone had no point. Returns their number.
    """
    work, way = shapes.work, shapes.work[WAY]
    is_hull = shapes.kind[i] == HULL and shapes.corners[i, 1] > CORNERS and count > 2
    if not is_hull and (shapes.kind[i] != CYLINDER or count != RIM):
        return count
    radius = 0.0 if is_hull else shapes.size[i, 0]
    put_middle(work, start, count, MIDDLE)
    far = put_way(shapes, j, other, corners, n)
    length = math.sqrt(dot(way, way))
    if far <= WITHIN * radius or length == 0.0:
        return count
    for k in range(3):
        way[k] /= length
    x, y, z = way[0], way[1], way[2]
    if is_hull:
        for k in range(3):
            work[MIDDLE, k] += far * way[k]
        count = put_crossed(shapes, i, sign, n, band, start, count, way, work[MIDDLE])
        return outline(work, start, count)
    for c in range(RIM):  # turning left, as ``outline`` leaves them
        angle = 2.0 * math.pi / RIM * c
        e, f = radius * math.cos(angle), radius * math.sin(angle)
        p = work[start + c]
        p[0] = work[MIDDLE, 0] + e * x + f * (n[1] * z - n[2] * y)
        p[1] = work[MIDDLE, 1] + e * y + f * (n[2] * x - n[0] * z)
        p[2] = work[MIDDLE, 2] + e * z + f * (n[0] * y - n[1] * x)
    return count


@compiled
def crossing(work: Floats) -> bool:
    """Put where lines of two corners each pass into their first; False if they are parallel."""
    p, q, r, s = work[POLYGON], work[POLYGON + 1], work[OTHER], work[OTHER + 1]
    a, b, c, d, e, f = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        x, y = work[E1, k], work[E2, k]
        a, b = a + x * (q[k] - p[k]), b + y * (q[k] - p[k])
        c, d = c + x * (s[k] - r[k]), d + y * (s[k] - r[k])
        e, f = e + x * (r[k] - p[k]), f + y * (r[k] - p[k])
    det = a * d - b * c
    if det * det <= PARALLEL * PARALLEL * (a * a + b * b) * (c * c + d * d):
        return False
    part = min(max((e * d - f * c) / det, 0.0), 1.0)
    other = min(max((e * b - f * a) / det, 0.0), 1.0)
    for k in range(3):
        p[k] += part * (q[k] - p[k])
        r[k] += other * (s[k] - r[k])
    return True


@compiled
def at_plane_along(shapes: PlacedShapes, i: int, j: int, band: float, n: Floats, count: int) -> int:
    """Append the points of solid i within a band above plane j; the new count."""
    ri, level = radius_of(shapes, i), dot(shapes.centre[j], n)
    ni = near_support(shapes, i, -1.0, n, band, POLYGON)
    for c in range(ni):
        p = shapes.work[POLYGON + c]
        high = dot(p, n) - level
        count = add(shapes, count, i, j, c, p[0] - high * n[0], p[1] - high * n[1],
                    p[2] - high * n[2], n[0], n[1], n[2], high - ri)  # fmt: skip
    return count


@compiled
def put_points(shapes: PlacedShapes, i: int, j: int, gap: float, n: Floats, count: int) -> int:
    """Append the points of solids i and j, or of i at plane j, along n; the new count.

    Points that may come to touch are among them, if the nearest one is.

    gap: of the solids, m.
    """
    extent, work, most = extent_of(shapes, i), shapes.work, shapes.near[i] + shapes.near[j]
    band = min(most - gap, DEEPEST * extent)
    if shapes.kind[j] == PLANE:
        return at_plane_along(shapes, i, j, band, n, count)
    tangents(n, work)
    before = count
    for _ in range(2):
        count = points_within(shapes, i, j, band, gap, n, before)
        least = 1e300
        for c in range(before, min(count, shapes.found.shape[0])):
            least = min(least, shapes.found[c, GAP])
        if count > shapes.found.shape[0] or least <= gap + BORDER * band:
            break
        band = ON_LINE * extent
    return count


@compiled
def points_within(
    shapes: PlacedShapes, i: int, j: int, band: float, gap: float, n: Floats, count: int
) -> int:
    """Append the points of solids i and j within a band of their support planes along n."""
    ri, rj, extent = radius_of(shapes, i), radius_of(shapes, j), extent_of(shapes, i)
    work = shapes.work
    ni = near_support(shapes, i, -1.0, n, band, POLYGON)
    nj = near_support(shapes, j, 1.0, n, band, OTHER)
    single, from_i, left, passing = ni == 1 or nj == 1, ni == 1, 1, gap
    if not single:
        ni, nj = outline(work, POLYGON, ni), outline(work, OTHER, nj)
        ni = face(shapes, i, POLYGON, ni, j, OTHER, nj, -1.0, n, band)
        nj = face(shapes, j, OTHER, nj, i, POLYGON, ni, 1.0, n, band)
        from_i = spread(work, OTHER, nj, n) <= spread(work, POLYGON, ni, n)
        if ni == 2 and nj == 2:
            single = crossing(work)
            high = dot(work[POLYGON], n) - dot(work[OTHER], n) - ri - rj
            passing = max(gap, high) if single else gap
        elif ni == 2 or nj == 2:
            from_i = ni == 2
        other, corners_there = (OTHER, nj) if from_i else (POLYGON, ni)
        if not single and spread(work, other, corners_there, n) > BORDER * extent:
            return count  # no face, and no edge, that is touched as a whole
    level = dot(work[OTHER if from_i else POLYGON], n)
    for c in range(nj if from_i else ni):  # the support plane of the other one
        high = dot(work[(OTHER if from_i else POLYGON) + c], n)
        level = max(level, high) if from_i else min(level, high)
    first = POLYGON if from_i else OTHER
    if not single:
        if from_i:
            left = inside(work, POLYGON, ni, OTHER, nj, extent)
        else:
            left = inside(work, OTHER, nj, POLYGON, ni, extent)
    for c in range(left):
        p = work[first + c]
        high = dot(p, n) - level
        own = passing if single else (high if from_i else -high) - ri - rj
        back = ri + own if from_i else -rj  # to the surface of j
        count = add(shapes, count, i, j, 1 + c, p[0] - back * n[0], p[1] - back * n[1],
                    p[2] - back * n[2], n[0], n[1], n[2], own)  # fmt: skip
    return count
