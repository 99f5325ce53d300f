"""The shapes of a model that collide, as arrays of compiled code, and where they are."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.metric import rotation_row, square_of
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix, Scalar
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.model.rotations import rotation
from dap3d_core.scene.contacts.collision_shapes import PLANE, CollisionShapes

#: Pairs of shapes, and points of contact, that there is room for at first.
ROOM = 64
#: Columns of a pose: position, m, and Euler parameters.
POSE = 7
#: Columns of a point: that halfway between both surfaces, the unit normal from shape j to shape i,
#: the gap. In ``which``: shapes i and j, and a number that tells points of a pair apart.
POINT, NORMAL, GAP, WIDTH = 0, 3, 6, 7
#: Rows of scratch: of two polygons of boxes, with corners, at most 8 each; of convex solids.
CORNERS, ROWS = 16, 141


@attrs.define(eq=False, kw_only=True, slots=False)
class PlacedShapes(Arrays):
    """m shapes that collide at one pose, and room for the points where they may touch."""

    pair_count = Scalar[int]("integer")
    point_count = Scalar[int]("integer")  # where it is beyond the room, the points are not all

    integer: Integers
    kind: Integers  # those of the model, as in CollisionShapes
    body: Integers
    at: Matrix
    local: Matrix  # (m, 9) rows of the matrices of their axes in the body
    size: Matrix
    corners: IntegerMatrix
    vertices: Matrix
    bits: IntegerMatrix
    material: Integers
    mu: Matrix
    mu_roll: Matrix  # none where nothing resists rolling, or spinning
    mu_spin: Matrix
    e: Matrix
    apart: Integers
    reach: Floats
    solids: Integers  # indices of all but planes
    planes: Integers
    centre: Matrix  # (m, 3) m, global axes
    axes: Matrix  # (m, 9) rows of the matrices of their axes
    near: Floats  # (m,) m, nearer than the sum of those of both is near
    sorted: Floats  # (solids,) scratch of the broad phase, as the next five
    small: Integers
    large: Integers
    cells: IntegerMatrix
    head: Integers
    following: Integers
    pairs: IntegerMatrix  # (room, 2) shapes
    which: IntegerMatrix  # (room, 3), (room, WIDTH) points
    found: Matrix
    scratch: Matrix  # of boxes and balls
    work: Matrix  # of convex solids


def placed_shapes(shapes: CollisionShapes | None) -> PlacedShapes:
    """The arrays of shapes, of none for None, not placed yet."""
    if shapes is None:
        none, zero, of_two = np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 2))
        shapes = CollisionShapes(
            (), none, none, zero, np.zeros((0, 4)), zero, of_two.astype(np.int64), zero, none,
            of_two.astype(np.int64), np.zeros((0, 0)), np.zeros((0, 0)), none,
        )  # fmt: skip
    m = len(shapes.kind)
    solids = np.flatnonzero(shapes.kind != PLANE)
    names = ("kind", "body", "at", "size", "corners", "vertices", "bits", "material", "mu",
             "mu_roll", "mu_spin", "e", "apart")  # fmt: skip
    given: dict[str, Any] = {name: np.ascontiguousarray(getattr(shapes, name)) for name in names}
    whole: dict[str, Any] = {
        name: np.zeros(len(solids), dtype=np.int64) for name in ("small", "large", "following")
    }
    return PlacedShapes(
        **given,
        **whole,
        integer=np.zeros(2, dtype=np.int64),
        local=np.ascontiguousarray(rotation(shapes.p).reshape(-1, 9)),
        reach=np.ascontiguousarray(shapes.reach, dtype=float),
        solids=solids,
        planes=np.flatnonzero(shapes.kind == PLANE),
        centre=np.zeros((m, 3)),
        axes=np.zeros((m, 9)),
        near=np.zeros(m),
        sorted=np.zeros(len(solids)),
        cells=np.zeros((len(solids), 3), dtype=np.int64),
        head=np.zeros(2 * len(solids) + 1, dtype=np.int64),
        pairs=np.zeros((ROOM, 2), dtype=np.int64),
        which=np.zeros((ROOM, 3), dtype=np.int64),
        found=np.zeros((ROOM, WIDTH)),
        scratch=np.zeros((CORNERS + 2, 3)),
        work=np.zeros((ROWS, 3)),
    )


def with_room(s: PlacedShapes) -> PlacedShapes:
    """The same shapes with room for what was found last, and a quarter more."""
    pairs, points = (
        max(len(array), count + count // 4)
        for array, count in ((s.pairs, s.pair_count), (s.found, s.point_count))
    )
    return attrs.evolve(
        s,
        pairs=np.zeros((pairs, 2), dtype=np.int64),
        which=np.zeros((points, 3), dtype=np.int64),
        found=np.zeros((points, WIDTH)),
    )


@compiled
def add(
    shapes: PlacedShapes, count: int, i: int, j: int, feature: int,
    x: float, y: float, z: float, nx: float, ny: float, nz: float, gap: float,
) -> int:  # fmt: skip
    """Append a point whose gap is near; the new count, beyond the room if there is none.

    x, y, z: the point on the surface of shape j.
    """
    if not gap < shapes.near[i] + shapes.near[j]:
        return count
    if count < shapes.found.shape[0]:
        which, row, half = shapes.which[count], shapes.found[count], 0.5 * gap
        which[0], which[1], which[2] = i, j, feature
        row[0], row[1], row[2] = x + half * nx, y + half * ny, z + half * nz
        row[3], row[4], row[5] = nx, ny, nz
        row[6] = gap
    return count + 1


@compiled
def place_shapes(s: PlacedShapes, poses: Floats, margin: Floats) -> None:
    """Place the shapes at the poses of bodies, (n + 1, POSE), ground first; margin: (n + 1,) m."""
    for m in range(s.kind.size):
        b = s.body[m]
        pose, at, local, axes = poses[b], s.at[m], s.local[m], s.axes[m]
        e = pose[3], pose[4], pose[5], pose[6]
        h = 2.0 / square_of(e)
        for k in range(3):
            u, v, w = rotation_row(e, h, k)
            s.centre[m, k] = pose[k] + (u * at[0] + v * at[1] + w * at[2])
            for c in range(3):
                axes[3 * k + c] = u * local[c] + v * local[3 + c] + w * local[6 + c]
        s.near[m] = margin[b]
