"""Points where shapes may touch, against supports of the shapes along the normals found."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.internals import placed_shapes as placed
from support.internals import rotation

from dap3d_core.assembly.collisions.find import find_touches
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    HULL,
    PLANE,
    SPHERE,
    CollisionShapes,
)

SOLIDS = (SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, HULL)
#: Those whose surface is smooth wherever it may touch another one of any kind.
ROUND = (SPHERE, CAPSULE, ELLIPSOID)
#: Directions of the vertices of hulls, which lie on an ellipsoid.
WAYS = np.random.default_rng(0).standard_normal((20, 3))
WAYS /= np.linalg.norm(WAYS, axis=1)[:, None]


class ShapeFinder:
    """Shapes that are placed at poses: ``find`` them nearer than the margins of their bodies."""

    def __init__(self, shapes):
        self.placed = placed.placed_shapes(shapes)

    def find(self, r, p, margin):
        poses = np.zeros((len(r) + 1, placed.POSE))
        poses[0, 3], poses[1:, :3], poses[1:, 3:] = 1.0, r, p
        while not find_touches(self.placed, poses, margin):
            self.placed = placed.with_room(self.placed)
        shapes, found = (
            x[: self.placed.point_count] for x in (self.placed.which, self.placed.found)
        )
        return SimpleNamespace(
            shapes=shapes[:, :2], point=found[:, :3], normal=found[:, 3:6], gap=found[:, 6]
        )


def finder(kinds, sizes, ways=(WAYS, WAYS)):
    """Shapes of bodies 1, 2, ... about their origins; of hulls the vertices are ways by sizes."""
    m, sizes = len(kinds), np.array(sizes, dtype=float)
    hulls = [size * ways[k % 2] for k, size in enumerate(sizes)]
    ends = np.cumsum([0, *map(len, hulls)])
    corners = np.array([ends[:-1], np.diff(ends)]).T
    return ShapeFinder(CollisionShapes(
        tuple(map(str, range(m))), np.array(kinds), np.arange(1, m + 1), np.zeros((m, 3)),
        np.tile([1.0, 0.0, 0.0, 0.0], (m, 1)), sizes, corners, np.concatenate(hulls),
        np.zeros(m, dtype=np.int64), np.ones((m, 2), dtype=np.int64), *np.zeros((2, 1, 1)),
        np.zeros(0, dtype=np.int64),
    ))  # fmt: skip


def support(kind, size, A, centre, d):
    """The point of a solid that lies farthest along d."""
    local = A.T @ d
    if kind == SPHERE:
        return centre + size[0] * d
    if kind == CAPSULE:
        return centre + A[:, 2] * size[1] * np.sign(local[2]) + size[0] * d
    if kind == BOX:
        return centre + A @ (np.sign(local) * size)
    if kind == ELLIPSOID:
        return centre + A @ (size**2 * local / np.linalg.norm(size * local))
    if kind == HULL:
        return centre + A @ max(size * WAYS, key=local.dot)
    rim = size[0] * local[:2] / max(np.hypot(*local[:2]), 1e-300)
    return centre + A @ np.array([*rim, size[1] * np.sign(local[2])])


PAIRS = [
    (i, j) for i in SOLIDS for j in SOLIDS if i >= j
]  # fmt: skip


def poses(rng, far=1.0):
    p = rng.standard_normal((2, 4))
    return rng.uniform(-far, far, (2, 3)), p / np.linalg.norm(p, axis=1)[:, None]


@pytest.mark.parametrize("kinds", [p for p in PAIRS if p != (BOX, BOX)])
def test_gaps_are_distances_along_the_normals(kinds):
    """Any normal parts solids by no more than their distance, so that one that parts them by the
    distance of two points of them is theirs; and the same stands as they come near along it."""
    rng, seen = np.random.default_rng(1), 0
    near = (1e-3, 1e-12, 0.0, -1e-9) if set(kinds) & set(ROUND) else (1e-3, 1e-6)
    for _ in range(25):
        sizes = rng.uniform(0.2, 0.5, (2, 3))
        r, p = poses(rng)
        pair = finder(kinds, sizes)
        found = pair.find(r, p, np.array([0.0, 0.5, 0.5]))
        if not len(found.gap) or found.gap.min() < 1e-3:
            continue
        k, A = np.argmin(found.gap), rotation(p)
        (i, j), n, gap = found.shapes[k], found.normal[k].copy(), found.gap[k]
        ends = [support(kinds[b], sizes[b], A[b], r[b], s * n) for b, s in ((i, -1.0), (j, 1.0))]
        assert n @ (ends[0] - ends[1]) == pytest.approx(gap, abs=1e-12)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
        for side, b in ((-0.5, i), (0.5, j)):  # points of both solids: what lies inside of supports
            point = found.point[k] - side * gap * n
            ways = rng.standard_normal((50, 3))
            for way in ways / np.linalg.norm(ways, axis=1)[:, None]:
                assert way @ (support(kinds[b], sizes[b], A[b], r[b], way) - point) > -1e-12
        for wanted in near:
            r[i] -= (gap - wanted) * n
            again = pair.find(r, p, np.array([0.0, 1e-3, 1e-3]))
            r[i] += (gap - wanted) * n
            best = np.argmin(again.gap)
            assert again.gap[best] == pytest.approx(wanted, abs=1e-14)
            assert again.normal[best] == pytest.approx(n, abs=1e-9 if wanted == 1e-6 else 1e-12)
        seen += 1
    assert seen > 6


@pytest.mark.parametrize(("kinds", "sizes", "points"), [
    ((CYLINDER, BOX), [[0.2, 0.3, 0.0], [0.5, 0.5, 0.5]], 8),
    ((CYLINDER, CYLINDER), [[0.2, 0.3, 0.0], [0.4, 0.5, 0.0]], 8),
    ((CYLINDER, PLANE), [[0.2, 0.3, 0.0], [0.0, 0.0, 0.0]], 8),
    ((BOX, CYLINDER), [[0.2, 0.2, 0.3], [0.5, 0.5, 0.0]], 4),
    ((ELLIPSOID, BOX), [[0.2, 0.1, 0.3], [0.5, 0.5, 0.5]], 1),
])  # fmt: skip
def test_what_stands_on_a_face_has_all_its_corners(kinds, sizes, points):
    """A rim has eight; each with the gap and the normal of the face."""
    pair = finder(kinds, sizes)
    r = np.array([[0.1, 0.0, sizes[1][2] or sizes[1][1]], [0.0, 0.0, 0.0]])
    r[0, 2] += (sizes[0][1] if kinds[0] == CYLINDER else sizes[0][2]) + 1e-9
    found = pair.find(r, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), np.full(3, 1e-3))
    assert found.gap == pytest.approx([1e-9] * points, abs=1e-15)
    assert np.abs(found.normal[:, 2]) == pytest.approx([1.0] * points, abs=1e-14)
    assert found.point[:, :2].mean(axis=0) == pytest.approx([0.1, 0.0], abs=1e-14)


@pytest.mark.parametrize("tilt", [1e-3, 1e-2, 3e-2, 0.1])
def test_of_a_rim_that_tilts_those_points_are_found_that_may_touch(tilt):
    """Eight, five, three, one: at 0.2 (1 - cos) sin tilt above the lowest, within both margins."""
    pair, margin = finder([CYLINDER, PLANE], [[0.2, 0.3, 0.0], [0.0, 0.0, 0.0]]), 1e-3
    r = np.array([[0.0, 0.0, 0.3 * np.cos(tilt) + 0.2 * np.sin(tilt)], [0.0, 0.0, 0.0]])
    turned = [np.cos(tilt / 2.0), 0.0, np.sin(tilt / 2.0), 0.0]
    found = pair.find(r, np.array([turned, [1.0, 0.0, 0.0, 0.0]]), np.full(3, margin))
    gaps = 0.2 * (1.0 - np.cos(np.pi / 4.0 * np.arange(8))) * np.sin(tilt)
    expected = np.sort(gaps[gaps < 2.0 * margin])
    assert np.sort(found.gap) == pytest.approx(expected, abs=1e-15)


def prism(corners):
    """Vertices of a prism along z, in the unit circle."""
    angles = 2.0 * np.pi * np.arange(corners) / corners
    x, y = np.tile(np.cos(angles), 2), np.tile(np.sin(angles), 2)
    return np.array([x, y, np.repeat([-1.0, 1.0], corners)]).T


@pytest.mark.parametrize(("upper", "lower"), [(64, 64), (64, 7), (16, 16), (40, None)])
def test_faces_of_many_corners_touch_all_around(upper, lower):
    """Of a face that has more corners than there is room for, and where clipping makes more: some
    lie near each end of its border. A prism on a plane has 16 at most."""
    kinds, ways = (HULL, HULL if lower else PLANE), (prism(upper), prism(lower or 4))
    pair = finder(kinds, [[0.5, 0.5, 0.3], [0.5, 0.5, 0.3]], ways)
    r, p = np.zeros((2, 3)), np.array([[np.cos(0.1), 0, 0, np.sin(0.1)], [1.0, 0, 0, 0]])
    r[0, 2] = 1e-9 + (0.6 if lower else 0.3)
    found = pair.find(r, p, np.full(3, 1e-3))
    assert found.gap == pytest.approx([1e-9] * len(found.gap), abs=1e-15)
    for angle in np.linspace(0.0, 2.0 * np.pi, 50):
        far = found.point[:, :2] @ [np.cos(angle), np.sin(angle)]
        assert far.max() > 0.5 * (0.97 if lower != 7 else np.cos(np.pi / 7) - 0.03)
    assert lower or 14 < len(found.gap) <= 16


@pytest.mark.parametrize("part", [0.5, 0.95, 0.999])
@pytest.mark.parametrize("kind", [CAPSULE, CYLINDER, BOX, "stands"])
def test_what_touches_a_cap_next_to_its_rim_touches_it(kind, part):
    """Rods across it, the corner of a box and another cap, that reach to a part of its radius where
    its own points are farthest: between two of them the chord is at 0.92."""
    angle, radius = np.pi / 8, 0.5
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    turned = np.array([c, 0.0, 0.0, s])
    if kind in (CAPSULE, CYLINDER):  # z along y, before
        lies = np.array([c, c, s, s]) / np.sqrt(2)
        sizes, p, out, up = [0.1, 2.0, 0.0], lies, 0.0, 0.1
    elif kind == BOX:  # a corner inwards
        half = 0.5 * (angle + 0.25 * np.pi)
        sizes, p = [0.2] * 3, np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        out, up = 0.2 * np.sqrt(2), 0.2
    else:
        sizes, p, out, up = [0.3, 0.2, 0.0], turned, 0.3, 0.2
    pair = finder([CYLINDER, CYLINDER if kind == "stands" else kind], [[radius, 0.3, 0.0], sizes])
    way = np.array([np.cos(angle), np.sin(angle)])
    r = np.array([np.zeros(3), [*((part * radius + out) * way), 0.3 + up + 1e-9]])
    found = pair.find(r, np.array([[1.0, 0, 0, 0], p]), np.full(3, 1e-3))
    assert len(found.gap) >= 2
    assert found.gap == pytest.approx([1e-9] * len(found.gap), abs=1e-15)
    assert np.linalg.norm(found.point[:, :2], axis=1).max() < radius * (1.0 + 1e-8)
    assert (found.point[:, :2] @ way).min() == pytest.approx(part * radius, abs=1e-9) or part == 0.5


@pytest.mark.parametrize("part", [0.6, 0.98, 0.9999])
@pytest.mark.parametrize("turned", [0.0, 0.04, 1.2])
@pytest.mark.parametrize("size", [(0.5, 0.5), (0.1, 1.0)])
def test_rods_next_to_the_border_of_a_face_of_many_corners_lie_on_it(size, turned, part):
    """At both ends of the line that they have on it: chords of 15 corners, and more so of a long
    face, leave parts of the face out."""
    corners = prism(40)[:40, :2] * size
    way = np.array([np.cos(turned), np.sin(turned)])
    along, heights = np.array([-way[1], way[0]]), corners @ way
    level, ends = part * heights.max(), []
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        a, b = p @ way - level, q @ way - level
        if a * b < 0.0:
            ends.append((p + a / (a - b) * (q - p)) @ along)
    half = 0.5 * turned  # z along y, turned before
    lies = np.array([np.cos(half), np.cos(half), np.sin(half), np.sin(half)]) / np.sqrt(2)
    lies = np.array([lies[0], -lies[1], -lies[2], lies[3]])
    pair = finder([HULL, CAPSULE], [[*size, 0.3], [0.1, 4.0, 0.0]], (prism(40), WAYS))
    r = np.array([np.zeros(3), [*(level * way), 0.4 + 1e-9]])
    found = pair.find(r, np.array([[1.0, 0, 0, 0], lies]), np.full(3, 1e-3))
    assert found.gap == pytest.approx([1e-9] * 2, abs=1e-15)
    assert sorted(found.point[:, :2] @ along) == pytest.approx(sorted(ends), abs=1e-9)


def test_boxes_meet_where_their_faces_and_edges_do():
    """Stacked boxes have the corners of the smaller face; crossed edges one point, by geometry."""
    boxes = finder([BOX, BOX], [[0.5, 0.5, 0.5], [0.2, 0.2, 0.2]])
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    found = boxes.find(np.array([[0.0, 0, 0], [0.1, 0, 0.7 + 1e-9]]), upright, np.full(3, 1e-3))
    assert found.gap == pytest.approx([1e-9] * 4, abs=1e-15)
    assert np.abs(found.normal[:, 2]) == pytest.approx([1.0] * 4, abs=1e-15)
    x, y = np.sort(found.point[:, :2], axis=0).T
    assert x == pytest.approx([-0.1, -0.1, 0.3, 0.3], abs=1e-15)
    assert y == pytest.approx([-0.2, -0.2, 0.2, 0.2], abs=1e-15)
    edge = np.sqrt(0.5)
    boxes = finder([BOX, BOX], [[0.5] * 3] * 2)
    c, s = np.cos(np.pi / 8), np.sin(np.pi / 8)
    p = np.array([[c, s, 0.0, 0.0], [c, 0.0, s, 0.0]])  # an edge along x up, one along y down
    found = boxes.find(np.array([[0.0, 0, 0], [0.0, 0, 2 * edge - 1e-6]]), p, np.full(3, 1e-3))
    assert found.gap == pytest.approx([-1e-6], abs=1e-15)
    assert found.point[0] == pytest.approx([0.0, 0.0, edge - 5e-7], abs=1e-14)


@pytest.mark.parametrize("middle", [0.0, 0.1, -0.25])
def test_a_capsule_that_lies_across_a_box_touches_both_edges(middle):
    """Or one edge and its end; tilted by 1e-4, it is farther from one of them by that."""
    pair = finder([BOX, CAPSULE], [[0.2, 0.3, 0.1], [0.05, 0.4, 0.0]])
    places = np.array([[0.0, 0.0, 0.0], [middle, 0.0, 0.15]])
    wanted = np.array([max(-0.2, middle - 0.4), min(0.2, middle + 0.4)])
    for tilt in (0.0, 1e-4):
        angle = np.pi / 4.0 - tilt / 2.0
        p = np.array([[1.0, 0.0, 0.0, 0.0], [np.cos(angle), 0.0, np.sin(angle), 0.0]])
        found = pair.find(places, p, np.full(3, 1e-4))
        for x in wanted:
            k = np.argmin(np.abs(found.point[:, 0] - x))
            assert found.point[k, :2] == pytest.approx([x, 0.0], abs=1e-15 + 0.1 * tilt)
            assert found.gap[k] == pytest.approx((x - middle) * tilt, abs=1e-15 + tilt**2)


@pytest.mark.parametrize("kind", SOLIDS)
def test_solids_at_a_plane_have_the_height_of_their_lowest_point(kind):
    rng, down = np.random.default_rng(2), np.array([0.0, 0.0, -1.0])
    for _ in range(30):
        sizes = rng.uniform(0.2, 0.5, (2, 3))
        (r, _), (p, _) = poses(rng)
        places = np.array([r, [0.0, 0.0, 0.0]])
        turns = np.array([p, [1.0, 0.0, 0.0, 0.0]])
        found = finder([kind, PLANE], sizes).find(places, turns, np.full(3, 5.0))
        lowest = support(kind, sizes[0], rotation(p), r, down)
        assert found.gap.min() == pytest.approx(lowest[2], abs=1e-14)


@pytest.mark.parametrize("largest", [0.06, 0.3])
def test_all_pairs_of_near_spheres_are_found(largest):
    """Compared with all distances; some are larger than a cell of the grid."""
    rng = np.random.default_rng(3)
    r, n = rng.uniform(0.0, 1.0, (60, 3)), 60
    radii = np.where(np.arange(n) % 20 == 7, largest, 0.06)
    spheres = finder([SPHERE] * n, radii[:, None] * [1.0, 0.0, 0.0])
    found = spheres.find(r, np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), np.full(n + 1, 0.01))
    distance = np.linalg.norm(r[:, None] - r[None], axis=2)
    i, j = np.nonzero(np.triu(distance < radii[:, None] + radii + 0.02, 1))
    pairs = [tuple(sorted(pair)) for pair in found.shapes.tolist()]
    assert sorted(pairs) == list(zip(i.tolist(), j.tolist(), strict=True))


@pytest.mark.parametrize(("at", "angle", "count"), [
    ([0.5, 0.6, 0.4], 0.0, 2),  # along half an edge, which was clipped there and back
    ([0.5, 0.6, 0.4], 4e-9, 2),
    ([1.0, 0.5, 0.4], 0.0, 2),
    ([1.0, 0.6, 0.4], 0.0, 1),  # at a corner
    ([1.0 - 1e-9, 0.6 - 2e-9, 0.4], 2e-9, 1),  # a strip as narrow as rounding
    ([0.5, 0.3, 0.4], 0.0, 4),
])  # fmt: skip
def test_points_of_boxes_in_line_are_found_once(at, angle, count):
    """Two boxes of 1 m x 0.6 m x 0.4 m, one on the other: corners of the face they share."""
    sizes = [[0.5, 0.3, 0.2]] * 2
    turned = [np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)]
    for p in ([[1.0, 0.0, 0.0, 0.0], turned], [turned, [1.0, 0.0, 0.0, 0.0]]):
        shapes = finder([BOX, BOX], sizes)
        found = shapes.find([[0.0, 0.0, 0.0], at], p, np.array([0.0, 1e-3, 1e-3]))
        assert len(found.point) == count
