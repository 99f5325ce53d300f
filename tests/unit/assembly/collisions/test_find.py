"""Points where shapes may touch, against supports of the shapes along the normals found."""

import numpy as np
import pytest

from dap3d_core.assembly.collisions.find import ShapeFinder
from dap3d_core.model.rotations import rotation
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    PLANE,
    SPHERE,
    CollisionShapes,
)

PAIRS = [(SPHERE, SPHERE), (CAPSULE, SPHERE), (CAPSULE, CAPSULE), (CYLINDER, SPHERE),
         (BOX, SPHERE), (BOX, CAPSULE)]  # fmt: skip
SOLIDS = (SPHERE, CAPSULE, CYLINDER, BOX)


def finder(kinds, sizes):
    """Shapes of bodies 1, 2, ... about their origins."""
    m = len(kinds)
    return ShapeFinder(CollisionShapes(
        tuple(map(str, range(m))), np.array(kinds), np.arange(1, m + 1), np.zeros((m, 3)),
        np.tile([1.0, 0.0, 0.0, 0.0], (m, 1)), np.array(sizes, dtype=float),
        np.zeros(m, dtype=np.int64), *np.zeros((2, 1, 1)), np.zeros(0, dtype=np.int64),
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
    rim = size[0] * local[:2] / np.hypot(*local[:2])
    return centre + A @ np.array([*rim, size[1] * np.sign(local[2])])


def poses(rng, far=1.0):
    p = rng.standard_normal((2, 4))
    return rng.uniform(-far, far, (2, 3)), p / np.linalg.norm(p, axis=1)[:, None]


@pytest.mark.parametrize("kinds", PAIRS)
def test_gaps_are_distances_along_the_normals(kinds):
    """The nearest point of a pair apart has a gap that parts both solids, to rounding of 1 m."""
    rng, seen = np.random.default_rng(1), 0
    for _ in range(150):
        sizes = rng.uniform(0.2, 0.5, (2, 3))
        r, p = poses(rng)
        found = finder(kinds, sizes).find(r, p, np.array([0.0, 0.5, 0.5]))
        if not len(found.gap) or found.gap.min() < 1e-3:
            continue
        k, A = np.argmin(found.gap), rotation(p)
        (i, j), n = found.shapes[k], found.normal[k]
        ends = [support(kinds[b], sizes[b], A[b], r[b], s * n) for b, s in ((i, -1.0), (j, 1.0))]
        assert n @ (ends[0] - ends[1]) == pytest.approx(found.gap[k], abs=1e-12)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
        seen += 1
    assert seen > 50


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


def test_all_pairs_of_near_spheres_are_found():
    """Compared with all distances; bodies that are apart by joints are left out."""
    rng = np.random.default_rng(3)
    r, n = rng.uniform(0.0, 1.0, (60, 3)), 60
    spheres = finder([SPHERE] * n, [[0.06, 0.0, 0.0]] * n)
    found = spheres.find(r, np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), np.full(n + 1, 0.01))
    distance = np.linalg.norm(r[:, None] - r[None], axis=2)
    i, j = np.nonzero(np.triu(distance < 0.14, 1))
    assert {tuple(sorted(pair)) for pair in found.shapes.tolist()} == set(zip(i.tolist(), j.tolist(), strict=True))  # fmt: skip
