"""All points where the shapes of a model may touch at one pose."""

import math

import attrs
import numpy as np

from dap3d_core.assembly.collisions.boxes import CORNERS, boxes
from dap3d_core.assembly.collisions.convex import touch_convex
from dap3d_core.assembly.collisions.placed_shapes import (
    POSE,
    PlacedShapes,
    place_shapes,
    placed_shapes,
    with_room,
)
from dap3d_core.assembly.collisions.records import GAP, NORMAL, POINT, add
from dap3d_core.assembly.collisions.solids import ball_box, capsule_box, sphere_cylinder
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    SPHERE,
    CollisionShapes,
)

#: Length of the part of a plane's normal across an axis below which a rim lies flat.
FLAT = 1e-9

#: Sine^2 of the angle between axes below which they are parallel.
PARALLEL = 1e-12

#: Part of the shapes that fit into a cell.
FIT = 0.95
#: The last cell along an axis, which all farther ones share.
LAST = 1e9


@compiled
def has_formula(a: int, b: int) -> bool:
    """True if pairs of two kinds, a >= b, are those of ``touch``, not of ``touch_convex``."""
    if a >= ELLIPSOID:
        return False
    return b < CAPSULE or a < CYLINDER or (b == CAPSULE and a == BOX) or b > CYLINDER


@attrs.frozen(eq=False)
class Touches:
    """Points where shapes may touch, k of them.

    Attributes:
        shapes: (k, 2) i and j.
        key: (k,) a number of each pair and point, the same at the next step.
        point: (k, 3) halfway between both surfaces, m, global axes.
        normal: (k, 3) unit vectors from j to i.
        gap: (k,) m, negative where they overlap.
    """

    shapes: Integers
    key: Integers
    point: Floats
    normal: Floats
    gap: Floats


@compiled
def touch(s: PlacedShapes, i: int, j: int, count: int) -> int:
    """Append points of shapes i and j nearer than the sum of what is near; the new count."""
    which, found, centre, axes, size = s.which, s.found, s.centre, s.axes, s.size
    q, n, a, b, most = s.scratch[CORNERS], s.scratch[CORNERS + 1], s.kind[i], s.kind[j], 0.0
    most, c, d = s.near[i] + s.near[j], centre[i], centre[j]
    if b == PLANE:
        return at_plane(which, found, count, i, j, a, centre, axes, size, most)
    if a == SPHERE:
        return balls(which, found, count, i, j, 0, c[0], c[1], c[2], size[i, 0],
                     d[0], d[1], d[2], size[j, 0], most)  # fmt: skip
    if a == CAPSULE and b == SPHERE:
        return sphere_capsule(which, found, count, i, j, centre, axes, size, most)
    if a == CAPSULE:
        return capsules(which, found, count, i, j, centre, axes, size, most)
    if a == CYLINDER and b == SPHERE:
        return sphere_cylinder(which, found, count, i, j, centre, axes, size, q, n, most)
    if a == BOX and b == SPHERE:
        return ball_box(which, found, count, i, j, 0, d[0], d[1], d[2], size[j, 0],
                        centre, axes, size, q, n, most)  # fmt: skip
    if a == BOX and b == CAPSULE:
        return capsule_box(which, found, count, i, j, centre, axes, size, q, n, most)
    return boxes(which, found, count, i, j, centre, axes, size, s.scratch, most)


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
            by_formula = has_formula(s.kind[i], s.kind[j])
            if by_formula != (turn == 0):
                continue
            if by_formula:
                count = touch(s, i, j, count)
            else:
                count = touch_convex(i, j, s.kind, s.centre, s.axes, s.size, s.corners, s.vertices,
                                     s.near, s.work, s.which, s.found, count)  # fmt: skip
    s.point_count = count
    return count <= s.found.shape[0]


class ShapeFinder:
    """The shapes of a model that collide, placed at poses."""

    def __init__(self, shapes: CollisionShapes) -> None:
        """Args: the shapes."""
        self._placed = placed_shapes(shapes)

    def find(self, r: Floats, p: Floats, margin: Floats) -> Touches:
        """Points nearer than the margins of the bodies, (n + 1,) m, allow.

        Args:
            r, p: (n, 3), (n, 4) poses of the bodies without ground, m.
            margin: of ground and all bodies; the sum of both counts.
        """
        poses = np.zeros((len(r) + 1, POSE))
        poses[0, 3], poses[1:, :3], poses[1:, 3:] = 1.0, r, p
        while not find_touches(self._placed, poses, margin):
            self._placed = with_room(self._placed)
        s, k = self._placed, self._placed.point_count
        i, j, feature = s.which[:k].T
        return Touches(
            s.which[:k, :2], (i * len(s.kind) + j) * 256 + feature, s.found[:k, POINT:NORMAL],
            s.found[:k, NORMAL:GAP], s.found[:k, GAP],
        )  # fmt: skip


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


@compiled
def balls(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int,
    x: float, y: float, z: float, ri: float, a: float, b: float, c: float, rj: float, most: float,
) -> int:  # fmt: skip
    """A ball of radius ri about (x, y, z), of shape i, and one of radius rj about (a, b, c)."""
    nx, ny, nz = x - a, y - b, z - c
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        nx, ny, nz = nx / length, ny / length, nz / length
    else:
        nx, ny, nz = 0.0, 0.0, 1.0
    gap = length - ri - rj
    return add(which, found, count, i, j, feature,
               a + rj * nx, b + rj * ny, c + rj * nz, nx, ny, nz, gap, most)  # fmt: skip


@compiled
def along(x: float, y: float, z: float, d: Floats, u: Floats, half: float) -> float:
    """Where on a segment about d, along u, is nearest to a point: from -half to half."""
    s = (x - d[0]) * u[2] + (y - d[1]) * u[5] + (z - d[2]) * u[8]
    return min(max(s, -half), half)


@compiled
def sphere_capsule(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Capsule i and sphere j."""
    d, u, c = centre[i], axes[i], centre[j]
    s = along(c[0], c[1], c[2], d, u, size[i, 1])
    x, y, z = d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8]
    return balls(which, found, count, i, j, 0,
                 x, y, z, size[i, 0], c[0], c[1], c[2], size[j, 0], most)  # fmt: skip


@compiled
def capsules(
    which: Integers, found: Floats, count: int, i: int, j: int,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """Two capsules: their nearest points; of parallel ones the ends of what lies side by side."""
    d, u, e, w = centre[i], axes[i], centre[j], axes[j]
    hi, hj = size[i, 1], size[j, 1]
    c = u[2] * w[2] + u[5] * w[5] + u[8] * w[8]
    rx, ry, rz = e[0] - d[0], e[1] - d[1], e[2] - d[2]
    p, q = rx * u[2] + ry * u[5] + rz * u[8], rx * w[2] + ry * w[5] + rz * w[8]
    det = 1.0 - c * c
    if det > PARALLEL:
        s = min(max((p - c * q) / det, -hi), hi)
        t = min(max(c * s - q, -hj), hj)
        s = min(max(p + c * t, -hi), hi)
        return _pair(which, found, count, i, j, 0, s, t, centre, axes, size, most)
    low, high = max(-hi, p - hj), min(hi, p + hj)
    if low >= high:  # end to end
        s = hi if p > 0.0 else -hi
        t = min(max(c * s - q, -hj), hj)
        return _pair(which, found, count, i, j, 0, s, t, centre, axes, size, most)
    count = _pair(which, found, count, i, j, 1, low, c * low - q, centre, axes, size, most)
    return _pair(which, found, count, i, j, 2, high, c * high - q, centre, axes, size, most)


@compiled
def _pair(
    which: Integers, found: Floats, count: int, i: int, j: int, feature: int, s: float, t: float,
    centre: Floats, axes: Floats, size: Floats, most: float,
) -> int:  # fmt: skip
    """The balls at s and t of two capsules."""
    d, u, e, w = centre[i], axes[i], centre[j], axes[j]
    return balls(
        which, found, count, i, j, feature,
        d[0] + s * u[2], d[1] + s * u[5], d[2] + s * u[8], size[i, 0],
        e[0] + t * w[2], e[1] + t * w[5], e[2] + t * w[8], size[j, 0], most,
    )  # fmt: skip


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
