"""All points where the shapes of a model may touch at one pose."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.collisions.boxes import CORNERS, boxes
from dap3d_core.assembly.collisions.broad_phase import near_pairs
from dap3d_core.assembly.collisions.convex import ROWS, touch_convex
from dap3d_core.assembly.collisions.planes import at_plane
from dap3d_core.assembly.collisions.records import GAP, NORMAL, POINT, WIDTH
from dap3d_core.assembly.collisions.rods import balls, capsules, sphere_capsule
from dap3d_core.assembly.collisions.solids import ball_box, capsule_box, sphere_cylinder
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.model.rotations import rotation
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    SPHERE,
    CollisionShapes,
)

#: Points of a pair that there is room for at first.
USUAL_POINTS = 4


def without_formula(kinds: Integers) -> Any:
    """(k,) whether pairs of kinds (k, 2) are those of ``touch_convex``."""
    low, high = np.sort(kinds, axis=1).T
    return (high >= ELLIPSOID) | (
        (low >= CAPSULE)
        & (low <= CYLINDER)
        & (high >= CYLINDER)
        & ~((low == CAPSULE) & (high == BOX))
    )


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
def touch(
    pairs: Integers, kind: Integers, centre: Floats, axes: Floats, size: Floats, margin: Floats,
    scratch: Floats, which: Integers, found: Floats,
) -> int:  # fmt: skip
    """Points of pairs of shapes nearer than the sum of their margins; their number.

    Args:
        pairs: (k, 2) of shapes.
        kind, size: (m,), (m, 3) of all shapes.
        centre, axes: (m, 3), (m, 9) m, rows of the matrices of their axes.
        margin: (m,) m.
        scratch: (CORNERS + 2, 3).
        which, found: outputs, as in records.py.
    """
    count, q, n = 0, scratch[CORNERS], scratch[CORNERS + 1]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if kind[i] < kind[j] or (kind[i] == kind[j] and i > j):
            i, j = j, i
        a, b, most, c, d = kind[i], kind[j], margin[i] + margin[j], centre[i], centre[j]
        if b == PLANE:
            count = at_plane(which, found, count, i, j, a, centre, axes, size, most)
        elif a == SPHERE:
            count = balls(which, found, count, i, j, 0, c[0], c[1], c[2], size[i, 0],
                          d[0], d[1], d[2], size[j, 0], most)  # fmt: skip
        elif a == CAPSULE and b == SPHERE:
            count = sphere_capsule(which, found, count, i, j, centre, axes, size, most)
        elif a == CAPSULE:
            count = capsules(which, found, count, i, j, centre, axes, size, most)
        elif a == CYLINDER and b == SPHERE:
            count = sphere_cylinder(which, found, count, i, j, centre, axes, size, q, n, most)
        elif a == BOX and b == SPHERE:
            count = ball_box(which, found, count, i, j, 0, d[0], d[1], d[2], size[j, 0],
                             centre, axes, size, q, n, most)  # fmt: skip
        elif a == BOX and b == CAPSULE:
            count = capsule_box(which, found, count, i, j, centre, axes, size, q, n, most)
        elif a == BOX and b == BOX:
            count = boxes(which, found, count, i, j, centre, axes, size, scratch, most)
    return count


class ShapeFinder:
    """The shapes of a model that collide, placed at poses.

    Attributes:
        shapes: as in the model.
    """

    def __init__(self, shapes: CollisionShapes) -> None:
        """Args: the shapes."""
        self.shapes, self._reach, self._room = shapes, shapes.reach, 64
        self._local = rotation(shapes.p)
        self._is_plane = shapes.kind == PLANE
        self._solids = np.flatnonzero(~self._is_plane)
        self._planes = np.flatnonzero(self._is_plane)
        self._scratch, self._work = np.zeros((CORNERS + 2, 3)), np.zeros((ROWS, 3))

    def find(self, r: Floats, p: Floats, margin: Floats) -> Touches:
        """Points nearer than the margins of the bodies, (n + 1,) m, allow.

        Args:
            r, p: (n, 3), (n, 4) poses of the bodies without ground, m.
            margin: of ground and all bodies; the sum of both counts.
        """
        s = self.shapes
        A = np.concatenate([np.eye(3)[None], rotation(p)])[s.body]
        centre = np.concatenate([np.zeros((1, 3)), r])[s.body] + np.einsum("mij,mj->mi", A, s.at)
        axes = np.ascontiguousarray((A @ self._local).reshape(-1, 9))
        near = margin[s.body]
        pairs = near_pairs(self._solids, centre, self._reach + near, s.body, self._room)
        self._room = max(self._room, len(pairs) + len(pairs) // 4)
        pairs = np.concatenate([pairs, self._at_planes(centre, axes, near)])
        if len(s.apart):
            i, j = np.sort(s.body[pairs], axis=1).T
            pairs = pairs[~np.isin(i * (len(r) + 1) + j, s.apart)]
        group, meets = s.bits[pairs].transpose(2, 0, 1)
        pairs = pairs[((group & meets[:, ::-1]) != 0).any(axis=1)]
        convex = without_formula(s.kind[pairs])
        pairs, others = np.ascontiguousarray(pairs), pairs[convex]
        room = USUAL_POINTS * len(pairs) + 1
        while True:
            which, found = np.zeros((room, 3), dtype=np.int64), np.zeros((room, WIDTH))
            count = touch(
                pairs[~convex], s.kind, centre, axes, s.size, near, self._scratch, which, found
            )
            if len(others):
                count = touch_convex(
                    others, s.kind, centre, axes, s.size, s.corners, s.vertices, near, self._work,
                    which, found, count,
                )  # fmt: skip
            if count <= room:
                break
            room = count
        which, found = which[:count], found[:count]
        i, j, feature = which.T
        return Touches(
            which[:, :2], (i * len(s.kind) + j) * 256 + feature, found[:, POINT:NORMAL],
            found[:, NORMAL:GAP], found[:, GAP],
        )  # fmt: skip

    def _at_planes(self, centre: Floats, axes: Floats, near: Floats) -> Integers:
        """Pairs of solids and planes that may touch."""
        body, every = self.shapes.body, []
        for plane in self._planes:
            height = (centre[self._solids] - centre[plane]) @ axes[plane, 2::3]
            close = height <= self._reach[self._solids] + near[self._solids] + near[plane]
            solids = self._solids[close & (body[self._solids] != body[plane])]
            every.append(np.column_stack([solids, np.full(len(solids), plane)]))
        return np.concatenate(every) if every else np.zeros((0, 2), dtype=np.int64)
