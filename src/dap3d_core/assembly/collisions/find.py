"""All points where the shapes of a model may touch at one pose.

Pairs that may touch come from a grid of cells, and of the few larger shapes one by one.

Of two convex solids the direction is found that parts them best. Their gap along a unit vector n
from j to i is s(n) = min n x over i - max n x over j; that of the solids is its largest value, also
where they overlap a little. There n is the normal of a face, or across an edge of each, or across
one edge and best along that circle, or s is smooth. All of these are tried, the last two by
Newton's method from what ``nearest`` finds. Any n has an s that is no more than the gap, so that
one too many does no harm. Where the other solid lies over a face of a box or a cylinder, that is
known at once.
"""

import math

from dap3d_core.assembly.collisions import solids
from dap3d_core.assembly.collisions.distance import APART, FAR_APART, A, B, V, nearest
from dap3d_core.assembly.collisions.manifold import E1, E2, put_points, tangents
from dap3d_core.assembly.collisions.placed_shapes import PlacedShapes, place_shapes
from dap3d_core.assembly.collisions.solids import boxes, dot_axis
from dap3d_core.assembly.collisions.supports import FLAT, curvature, extent_of, radius_of, support
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.vectors import dot
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    HULL,
    PLANE,
    SPHERE,
)

#: Part of the shapes that fit into a cell.
FIT = 0.95
#: The last cell along an axis, which all farther ones share.
LAST = 1e9
#: Rows of scratch behind those of ``nearest``: directions tried and found, start, points, a step,
#: edges of i and j.
N, BEST, START, PI, PJ, STEP, EI, EJ = 16, 17, 18, 19, 20, 21, 22, 29
#: Parts of the sizes by which a direction has to be better.
BETTER = 1e-14
#: Rounds of Newton's method, halvings of a step.
ROUNDS, HALVINGS = 30, 6
#: Parts of solids that ``nearest`` takes, one after the other, while they overlap.
ALL, NEARLY, LESS, HALF = 1.0, 0.999, 0.95, 0.5


@compiled
def gap_along(shapes: PlacedShapes, i: int, j: int, n: Floats) -> float:
    """Gap of the cores of solids along n; puts their points there."""
    work = shapes.work
    support(shapes, i, -1.0, n, work[PI])
    support(shapes, j, 1.0, n, work[PJ])
    p, q = work[PI], work[PJ]
    return n[0] * (p[0] - q[0]) + n[1] * (p[1] - q[1]) + n[2] * (p[2] - q[2])


@compiled
def unit(n: Floats) -> bool:
    """Make a vector a unit one; False where it has no length."""
    length = math.sqrt(dot(n, n))
    if length < 1e-150:
        return False
    for k in range(3):
        n[k] /= length
    return True


@compiled
def cross(a: Floats, b: Floats, out: Floats) -> None:
    """Vector product."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@compiled
def attempt(shapes: PlacedShapes, i: int, j: int, best: float, better: float) -> float:
    """Try the direction N and its opposite; the gap of the better one so far."""
    work = shapes.work
    n = work[N]
    if not unit(n):
        return best
    for _ in range(2):
        for k in range(3):
            n[k] = -n[k]
        s = gap_along(shapes, i, j, n)
        if s > best + better:
            best = s
            for k in range(3):
                work[BEST, k] = n[k]
    return best


@compiled
def edges_of(shapes: PlacedShapes, i: int, points: int, count: int, out: int) -> int:
    """Put unit directions of the edges of a solid near its corners in the simplex; their number."""
    work = shapes.work
    what, found = shapes.kind[i], 0
    if what in (BOX, CYLINDER, CAPSULE):
        for k in range(3 if what == BOX else 1):
            along = k if what == BOX else 2
            for r in range(3):
                work[out + found, r] = shapes.axes[i, 3 * r + along]
            found += 1
    elif what == HULL:
        for a in range(count):
            for b in range(a + 1, count):
                for r in range(3):
                    work[out + found, r] = work[points + a, r] - work[points + b, r]
                if unit(work[out + found]):
                    found += 1
    return found


@compiled
def bend(shapes: PlacedShapes, i: int, j: int, n: Floats, s: Floats, t: Floats) -> float:
    """``curvature`` of both solids."""
    return curvature(shapes, i, n, s, t) + curvature(shapes, j, n, s, t)


@compiled
def climb(shapes: PlacedShapes, i: int, j: int, edge: int, best: float, better: float) -> float:
    """Newton's method for the largest gap from START on, across an edge in row ``edge`` or none."""
    work = shapes.work
    n, p, q, t1, t2 = work[N], work[PI], work[PJ], work[E1], work[E2]
    along = dot(work[START], work[edge]) if edge >= 0 else 0.0
    for k in range(3):
        n[k] = work[START, k] - (along * work[edge, k] if edge >= 0 else 0.0)
    if not unit(n):
        return best
    s = gap_along(shapes, i, j, n)
    least = 1e300
    for _ in range(ROUNDS):
        tangents(n, work)
        if edge >= 0:
            cross(work[edge], n, t1)
            cross(n, t1, t2)
        g1, g2 = 0.0, 0.0
        for k in range(3):
            g1, g2 = g1 + t1[k] * (p[k] - q[k]), g2 + t2[k] * (p[k] - q[k])
            work[V, k] = n[k]
        a, b, d = s + bend(shapes, i, j, n, t1, t1), 0.0, 1.0
        if edge < 0:
            b = bend(shapes, i, j, n, t1, t2)
            d = s + bend(shapes, i, j, n, t2, t2)
        else:
            g2 = 0.0
        slope, det = math.sqrt(g1 * g1 + g2 * g2), a * d - b * b
        if slope >= least:  # rounding is reached
            break
        y, z, most = 0.0, 0.0, 1
        if a > 0.0 and det > 0.0:
            y, z, most = (g1 * d - g2 * b) / det, (g2 * a - g1 * b) / det, HALVINGS
            for k in range(3):
                work[STEP, k] = y * t1[k] + z * t2[k]
        else:  # corners, which overlap along n: along what parts them
            for k in range(3):
                work[STEP, k] = s * n[k] + g1 * t1[k] + g2 * t2[k] - n[k]
        new, part = s - 1.0, 1.0
        for _ in range(most):
            for k in range(3):
                n[k] = work[V, k] + part * work[STEP, k]
            if unit(n):
                new = gap_along(shapes, i, j, n)
            if new >= s - better:
                break
            part *= 0.5
        if new < s - better:
            for k in range(3):
                n[k] = work[V, k]
            break
        s, least = new, slope if new <= s + better else 1e300
    return attempt(shapes, i, j, best, better)


@compiled
def flat_directions(
    shapes: PlacedShapes, i: int, j: int, edges_i: int, edges_j: int, best: float, better: float
) -> float:  # fmt: skip
    """Try normals of faces of hulls, and of pairs of edges."""
    work = shapes.work
    for side in range(2):
        k, first, edges = (i, EI, edges_i) if side == 0 else (j, EJ, edges_j)
        for e in range(edges if shapes.kind[k] == HULL else 0):
            for f in range(e + 1, edges):
                cross(work[first + e], work[first + f], work[N])
                if dot(work[N], work[N]) > FLAT:
                    best = attempt(shapes, i, j, best, better)
    for e in range(edges_i):
        for f in range(edges_j):
            cross(work[EI + e], work[EJ + f], work[N])
            if dot(work[N], work[N]) > FLAT:
                best = attempt(shapes, i, j, best, better)
    return best


@compiled
def own_faces(shapes: PlacedShapes, i: int, j: int, better: float) -> tuple[float, bool]:
    """Try normals of faces of boxes and cylinders; the gap, and whether none can be larger.

    None is where the nearest point of the other solid lies over the face, or in the solid and
    nearest to this face: along any direction the gap is that of the point at most.
    """
    work = shapes.work
    best, side, along = -1e300, 0, 2
    for one in range(2):
        k = i if one == 0 else j
        kind = shapes.kind[k]
        for e in range(0 if kind == BOX else 2, 3 if kind in (BOX, CYLINDER) else 0):
            for r in range(3):
                work[N, r] = shapes.axes[k, 3 * r + e]
            new = attempt(shapes, i, j, best, better)
            if new > best:
                best, side, along = new, one, e
    if best == -1e300:
        return best, False
    k, deep, p, q = j if side else i, max(0.0, -best), work[PI], work[PJ]
    support(shapes, i + j - k, 1.0 - 2.0 * side, work[BEST], p)
    for r in range(3):
        q[r] = p[r] - shapes.centre[k, r]
    x, y, z = q[0], q[1], q[2]
    for r in range(3):
        q[r] = abs(dot_axis(shapes.axes[k], r, x, y, z))
    if shapes.kind[k] == CYLINDER:
        over = math.sqrt(q[0] * q[0] + q[1] * q[1]) <= shapes.size[k, 0] - deep
        return best, over and deep <= shapes.size[k, 1]
    over = deep <= shapes.size[k, along]
    for r in range(3):
        over = over and (r == along or q[r] <= shapes.size[k, r] - deep)
    return best, over


@compiled
def part_best(shapes: PlacedShapes, i: int, j: int, most: float) -> float:
    """Put the direction of the largest gap of cores into BEST; the gap, or one beyond ``most``."""
    work = shapes.work
    count, status = 0, 0
    better = BETTER * (extent_of(shapes, i) + extent_of(shapes, j))
    best, is_largest = own_faces(shapes, i, j, better)
    if is_largest:
        return best
    for turn in range(4):
        part = ALL if turn == 0 else NEARLY if turn == 1 else LESS if turn == 2 else HALF
        far = most if turn == 0 else 1e300
        status, count = nearest(shapes, i, j, part, far)
        if status == FAR_APART:
            return 1e300
        if status == APART:
            break
    for k in range(3):
        way = work[V, k] if status == APART else shapes.centre[i, k] - shapes.centre[j, k]
        work[START, k] = way
    if not unit(work[START]):
        work[START, 2] = 1.0
    edges_i = edges_of(shapes, i, A, count, EI)
    edges_j = edges_of(shapes, j, B, count, EJ)
    best = flat_directions(shapes, i, j, edges_i, edges_j, best, better)
    for side in range(2):
        for e in range(edges_i if side == 0 else edges_j):
            edge = (EI if side == 0 else EJ) + e
            best = climb(shapes, i, j, edge, best, better)
    return climb(shapes, i, j, -1, best, better)


@compiled
def touch_convex(shapes: PlacedShapes, i: int, j: int, count: int) -> int:
    """Append the points of shapes i and j for which there is no formula; the new count.

    i is the one of the higher kind.
    """
    work = shapes.work
    radius, most = radius_of(shapes, i), shapes.near[i] + shapes.near[j]
    if shapes.kind[j] == PLANE:
        for r in range(3):
            work[BEST, r] = shapes.axes[j, 3 * r + 2]
        support(shapes, i, -1.0, work[BEST], work[PI])
        for r in range(3):
            work[PJ, r] = work[PI, r] - shapes.centre[j, r]
        gap = dot(work[PJ], work[BEST]) - radius
    else:
        radius += radius_of(shapes, j)
        gap = part_best(shapes, i, j, most) - radius
    if gap >= most:
        return count
    return put_points(shapes, i, j, gap, work[BEST], count)


@compiled
def find_pairs(s: PlacedShapes, bodies: int) -> None:
    """Put the pairs whose balls overlap, or that may touch a plane; bodies: without ground."""
    s.pair_count = 0
    if s.solids.size > 1:
        grid_pairs(s, bodies)
    for p in range(s.planes.size):
        plane = s.planes[p]
        axes, c = s.axes[plane], s.centre[plane]
        for k in range(s.solids.size):
            i = s.solids[k]
            d, height = s.centre[i], 0.0
            for x in range(3):
                height += (d[x] - c[x]) * axes[3 * x + 2]
            if height <= s.reach[i] + s.near[i] + s.near[plane]:
                add_pair(s, i, plane, bodies)


@compiled
def add_pair(s: PlacedShapes, i: int, j: int, bodies: int) -> None:
    """Append a pair that is to meet; its count may be beyond the room."""
    a, b = s.body[i], s.body[j]
    if a == b or (s.bits[i, 0] & s.bits[j, 1] == 0 and s.bits[j, 0] & s.bits[i, 1] == 0):
        return
    key = min(a, b) * (bodies + 1) + max(a, b)
    low, high = 0, s.apart.size
    while low < high:
        middle = (low + high) // 2
        if s.apart[middle] < key:
            low = middle + 1
        else:
            high = middle
    if low < s.apart.size and s.apart[low] == key:
        return
    count = s.pair_count
    if count < s.pairs.shape[0]:
        s.pairs[count, 0], s.pairs[count, 1] = i, j
    s.pair_count = count + 1


@compiled
def meet(s: PlacedShapes, i: int, j: int, bodies: int) -> None:
    """Append a pair if its balls overlap."""
    most, square = s.reach[i] + s.near[i] + (s.reach[j] + s.near[j]), 0.0
    for k in range(3):
        square += (s.centre[i, k] - s.centre[j, k]) * (s.centre[i, k] - s.centre[j, k])
    if square <= most * most:
        add_pair(s, i, j, bodies)


@compiled
def ranked(x: Floats, rank: int) -> float:
    """The number of a rank among those of x, which are exchanged.

    Source: Hoare, Algorithm 65: Find (Comm. ACM 4, 1961).
    """
    low, high = 0, x.size - 1
    while low < high:
        pivot, i, j = x[rank], low, high
        while i <= j:
            while x[i] < pivot:
                i += 1
            while pivot < x[j]:
                j -= 1
            if i <= j:
                x[i], x[j] = x[j], x[i]
                i, j = i + 1, j - 1
        if j < rank:
            low = i
        if rank < i:
            high = j
    return x[rank]


@compiled
def place_of(x: int, y: int, z: int, size: int) -> int:
    """Place of a cell in a table; cells may share it."""
    return (x * 73856093 + y * 19349663 + z * 83492791) % size


@compiled
def fill_cells(s: PlacedShapes) -> tuple[int, int]:
    """Sort the solids into those that fit into a cell, which are put there, and others; counts."""
    count = s.solids.size
    for k in range(count):
        s.sorted[k] = s.reach[s.solids[k]] + s.near[s.solids[k]]
    fit, small, large = ranked(s.sorted, int(FIT * (count - 1))), 0, 0
    for k in range(count):
        i = s.solids[k]
        if s.reach[i] + s.near[i] <= fit:
            s.small[small] = i
            small += 1
        else:
            s.large[large] = i
            large += 1
    for c in range(3):
        least = s.centre[s.small[0], c]
        for k in range(small):
            least = min(least, s.centre[s.small[k], c])
        for k in range(small):
            cell = (s.centre[s.small[k], c] - least) / (2.0 * fit)
            s.cells[k, c] = 1 + int(min(cell, LAST))
    for k in range(2 * small + 1):
        s.head[k] = -1
    for a in range(small):
        at = place_of(s.cells[a, 0], s.cells[a, 1], s.cells[a, 2], 2 * small + 1)
        s.following[a] = s.head[at]
        s.head[at] = a
    return small, large


@compiled
def grid_pairs(s: PlacedShapes, bodies: int) -> None:
    """Append the pairs of solids whose balls overlap; those of ground ask for none."""
    small, large = fill_cells(s)
    cells = s.cells
    for a in range(small):
        i = s.small[a]
        for near in range(27 if s.body[i] > 0 else 0):
            x, y, z = cells[a, 0] + near // 9 - 1, cells[a, 1] + near // 3 % 3 - 1, near % 3 - 1
            z += cells[a, 2]
            b = s.head[place_of(x, y, z, 2 * small + 1)]
            while b >= 0:
                if cells[b, 0] == x and cells[b, 1] == y and cells[b, 2] == z:
                    j = s.small[b]
                    if s.body[j] == 0 or b > a:
                        meet(s, i, j, bodies)
                b = s.following[b]
    for a in range(large):
        for b in range(small):
            meet(s, s.large[a], s.small[b], bodies)
        for b in range(a + 1, large):
            meet(s, s.large[a], s.large[b], bodies)


@compiled
def has_formula(a: int, b: int) -> bool:
    """True if pairs of two kinds, a >= b, need no ``touch_convex``."""
    if a >= ELLIPSOID or (a == CYLINDER and b == PLANE):
        return False
    return b < CAPSULE or a < CYLINDER or (b == CAPSULE and a == BOX) or b > CYLINDER


@compiled
def touch(s: PlacedShapes, i: int, j: int, count: int) -> int:
    """Append points of shapes i and j nearer than the sum of what is near; the new count."""
    a, b, c, d = s.kind[i], s.kind[j], s.centre[i], s.centre[j]
    if not has_formula(a, b):
        return touch_convex(s, i, j, count)
    if b == PLANE:
        return solids.at_plane(s, count, i, j)
    if a == SPHERE:
        return solids.balls(s, count, i, j, 0, c[0], c[1], c[2], s.size[i, 0], d[0], d[1], d[2],
                     s.size[j, 0])  # fmt: skip
    if a == CAPSULE and b == SPHERE:
        return solids.sphere_capsule(s, count, i, j)
    if a == CAPSULE:
        return solids.capsules(s, count, i, j)
    if a == CYLINDER and b == SPHERE:
        return solids.sphere_cylinder(s, count, i, j)
    if a == BOX and b == SPHERE:
        return solids.ball_box(s, count, i, j, 0, d[0], d[1], d[2], s.size[j, 0])
    if a == BOX and b == CAPSULE:
        return solids.capsule_box(s, count, i, j)
    return boxes(s, count, i, j)


@compiled
def find_touches(s: PlacedShapes, poses: Floats, margin: Floats) -> bool:
    """Find the points where shapes may touch; False if there is no room for all.

    Args:
        s: the shapes; ``which``, ``found`` and ``point_count`` are the result.
        poses: (n + 1, POSE) of ground and the bodies.
        margin: (n + 1,) m; those nearer than the sum of both are found.
    """
    place_shapes(s, poses, margin)
    find_pairs(s, poses.shape[0] - 1)
    count = 0
    if s.pair_count > s.pairs.shape[0]:
        return False
    for turn in range(2):
        for k in range(s.pair_count):
            i, j = s.pairs[k, 0], s.pairs[k, 1]
            if s.kind[i] < s.kind[j] or (s.kind[i] == s.kind[j] and i > j):
                i, j = j, i
            if has_formula(s.kind[i], s.kind[j]) == (turn == 0):
                count = touch(s, i, j, count)
    s.point_count = count
    return count <= s.found.shape[0]
