"""All points where the shapes of a model may touch at one pose.

Pairs that may touch come from a grid of cells, and of the few larger shapes one by one.
"""

from dap3d_core.assembly.collisions import solids
from dap3d_core.assembly.collisions.convex import touch_convex
from dap3d_core.assembly.collisions.placed_shapes import PlacedShapes, place_shapes
from dap3d_core.assembly.collisions.solids import boxes
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    SPHERE,
)

#: Part of the shapes that fit into a cell.
FIT = 0.95
#: The last cell along an axis, which all farther ones share.
LAST = 1e9


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
