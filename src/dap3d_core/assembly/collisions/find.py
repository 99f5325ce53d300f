"""All points where the shapes of a model may touch at one pose."""

import attrs
import numpy as np

from dap3d_core.assembly.collisions.boxes import CORNERS, boxes
from dap3d_core.assembly.collisions.broad_phase import find_pairs
from dap3d_core.assembly.collisions.convex import touch_convex
from dap3d_core.assembly.collisions.placed_shapes import (
    POSE,
    PlacedShapes,
    place_shapes,
    placed_shapes,
    with_room,
)
from dap3d_core.assembly.collisions.planes import at_plane
from dap3d_core.assembly.collisions.records import GAP, NORMAL, POINT
from dap3d_core.assembly.collisions.rods import balls, capsules, sphere_capsule
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
