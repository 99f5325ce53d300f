"""The simplex of two convex solids that is nearest to where they touch.

Source: Gilbert, Johnson, Keerthi, A fast procedure for computing the distance between complex
objects (1988). Nearest points of simplices are found by trying all faces of them.
"""

import math

from dap3d_core.assembly.collisions.placed_shapes import PlacedShapes
from dap3d_core.assembly.collisions.supports import radius_of, support
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.vectors import dot

#: Rows of scratch: points of solids i and j, their differences; from j to i; weights, best and
#: new; a unit vector.
A, B, W, V, WEIGHTS, UNIT = 0, 4, 8, 12, 13, 15
#: Supports at most; parts of the distance, and of the sizes, that it is known to.
ROUNDS, NEAR, DISTANCE_ROUNDING = 60, 1e-13, 1e-15
#: Distances, parts of the sizes, below which solids are taken smaller, and the parts taken.
CLOSE = 1e-12
FAR_APART, APART, INSIDE = 0, 1, 2


@compiled
def _weigh(work: Floats, a: int, b: int, c: int) -> float:
    """Square of the distance of the origin to the inner part of a face, 1e300 beyond it.

    Puts the weights of its corners a, b, c behind those of the best; c = a: of an edge, b = a, too:
    of a corner.
    """
    p, q, r = work[W + a], work[W + b], work[W + c]
    s, t = 0.0, 0.0
    pe, pf, ee, ef, ff = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        e, f = q[k] - p[k], r[k] - p[k]
        pe, pf, ee, ef, ff = pe - p[k] * e, pf - p[k] * f, ee + e * e, ef + e * f, ff + f * f
    if b != a and c == a:
        if ee <= 0.0 or not 0.0 < pe < ee:
            return 1e300
        s = pe / ee
    elif c != a:
        det = ee * ff - ef * ef
        if det <= 1e-14 * ee * ff:
            return 1e300
        s, t = (pe * ff - pf * ef) / det, (pf * ee - pe * ef) / det
        if s <= 0.0 or t <= 0.0 or s + t >= 1.0:
            return 1e300
    square = 0.0
    for k in range(3):
        x = p[k] + s * (q[k] - p[k]) + t * (r[k] - p[k])
        square += x * x
    new = work[WEIGHTS + 1]
    new[0], new[1], new[2] = 1.0 - s - t, s, t
    return square


@compiled
def _volume(p: Floats, q: Floats, r: Floats) -> float:
    return (
        p[0] * (q[1] * r[2] - q[2] * r[1])
        + p[1] * (q[2] * r[0] - q[0] * r[2])
        + p[2] * (q[0] * r[1] - q[1] * r[0])
    )


@compiled
def _holds_origin(work: Floats) -> bool:
    """True if the origin lies in the tetrahedron of four differences."""
    p, q, r, s = work[W], work[W + 1], work[W + 2], work[W + 3]
    a, b, c, d = _volume(q, r, s), -_volume(p, r, s), _volume(p, q, s), -_volume(p, q, r)
    low, high = min(a, b, c, d), max(a, b, c, d)
    return (low >= 0.0 and high > 0.0) or (high <= 0.0 and low < 0.0)


@compiled
def _reduce(work: Floats, count: int) -> int:
    """Keep the corners of the nearest face alone, put its nearest point; corners, 0 inside."""
    if count == 4 and _holds_origin(work):
        return 0
    best, fa, fb, fc = 1e300, 0, 0, 0
    for a in range(count):
        for b in range(a, count):
            for c in range(b, count):
                if b == a and c > b:
                    continue
                square = _weigh(work, a, b, a if c == b else c)
                if square < best * (1.0 - 1e-14):
                    best, fa, fb, fc = square, a, b, c
                    for k in range(3):
                        work[WEIGHTS, k] = work[WEIGHTS + 1, k]
    kept, v = 0, work[V]
    v[0], v[1], v[2] = 0.0, 0.0, 0.0
    for n in range(3):
        corner = fa if n == 0 else fb if n == 1 else fc
        if (n == 1 and fb == fa) or (n == 2 and fc == fb):
            continue
        weight = work[WEIGHTS, n]
        for k in range(3):
            v[k] += weight * work[W + corner, k]
            for rows in (A, B, W):
                work[rows + kept, k] = work[rows + corner, k]
        kept += 1
    return kept


@compiled
def _scaled(work: Floats, row: int, centre: Floats, part: float) -> None:
    for k in range(3):
        work[row, k] = centre[k] + part * (work[row, k] - centre[k])


@compiled
def nearest(shapes: PlacedShapes, i: int, j: int, part: float, most: float) -> tuple[int, int]:
    """How solids i and j lie, and the corners of their nearest simplex, in scratch.

    Args:
        i, j: solids.
        part: that they are taken of, about their centres.
        most: m, distance beyond which they are far apart.
    """
    work, count = shapes.work, 0
    v, n = work[V], work[UNIT]
    for k in range(3):
        v[k] = shapes.centre[i, k] - shapes.centre[j, k]
    if dot(v, v) == 0.0:
        v[2] = 1.0
    radii = radius_of(shapes, i) + radius_of(shapes, j)
    reach = dot(shapes.size[i], shapes.size[i]) + dot(shapes.size[j], shapes.size[j])
    for _ in range(ROUNDS):
        length = math.sqrt(dot(v, v))
        if count and length * length <= CLOSE * CLOSE * reach:
            return INSIDE, count
        for k in range(3):
            n[k] = v[k] / length
        support(shapes, i, -1.0, n, work[A + count])
        support(shapes, j, 1.0, n, work[B + count])
        _scaled(work, A + count, shapes.centre[i], part)
        _scaled(work, B + count, shapes.centre[j], part)
        w = work[W + count]
        for k in range(3):
            w[k] = work[A + count, k] - work[B + count, k]
        along = dot(w, n)
        if along > most + radii:
            return FAR_APART, count
        if count and length - along <= NEAR * length + DISTANCE_ROUNDING * math.sqrt(reach):
            return APART, count
        for c in range(count):
            same = True
            for k in range(3):
                same = same and work[W + c, k] == w[k]
            if same:
                return APART, count
        count = _reduce(work, count + 1)
        if count == 0:
            return INSIDE, 0
    return APART, count
