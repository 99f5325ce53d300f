"""Masses and inertias of solids, against closed forms and against each other."""

import numpy as np
import pytest
from support.internals import Frame, Inertial, inertia_of_mesh, inertia_of_solid, total_inertia

from dap3d_core.interface.formats.solids import inertia_moved, nearest_inertia

CORNERS = np.array([(x, y, z) for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 5.0)])
FACES = np.array([(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
                  (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)])  # fmt: skip


@pytest.mark.parametrize("all_positive", [False, True])
def test_a_mesh_of_a_box_is_the_box(all_positive):
    """With its corner in the origin; with triangles turned about, where all count as positive."""
    faces = FACES.copy()
    if all_positive:
        faces[::2] = faces[::2, ::-1]
    volume, com, J = inertia_of_mesh(CORNERS, faces, all_positive=all_positive)
    expected_volume, expected = inertia_of_solid("box", (2.0, 3.0, 5.0))
    assert abs(volume) == pytest.approx(expected_volume, rel=1e-14)
    np.testing.assert_allclose(com, (1.0, 1.5, 2.5), rtol=1e-14)
    np.testing.assert_allclose(J, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("kind", "size", "inside"),
    [
        ("box", (0.96, 2.0, 3.04), lambda p: (np.abs(p) <= (0.48, 1.0, 1.52)).all(axis=1)),
        ("sphere", (0.7,), lambda p: np.linalg.norm(p, axis=1) <= 0.7),
        ("ellipsoid", (0.5, 0.9, 1.3), lambda p: ((p / (0.5, 0.9, 1.3)) ** 2).sum(axis=1) <= 1.0),
        ("cylinder", (0.6, 1.76), lambda p: (np.hypot(*p.T[:2]) <= 0.6) & (abs(p.T[2]) <= 0.88)),
        ("capsule", (0.6, 1.2), lambda p: np.linalg.norm(
            p - np.clip(p, (0, 0, -0.6), (0, 0, 0.6)), axis=1) <= 0.6),
        ("cone", (0.9, 2.08), lambda p: (np.hypot(*p.T[:2]) <= 0.9 * (1.56 - p.T[2]) / 2.08)
         & (p.T[2] >= -0.52)),
    ],
)  # fmt: skip
def test_solids_against_sums_over_points(kind, size, inside):
    """A grid of 80 points an edge: sums are off by a part of a cell at the surface, some 1e-2."""
    edge = np.linspace(-1.6, 1.6, 81)[:-1] + 0.02
    points = np.stack(np.meshgrid(edge, edge, edge), axis=-1).reshape(-1, 3)
    points = points[inside(points)]
    volume, J = inertia_of_solid(kind, size)
    second = points.T @ points / len(points)
    assert len(points) * 0.04**3 == pytest.approx(volume, rel=0.02)
    np.testing.assert_allclose(np.trace(second) * np.eye(3) - second, J, rtol=0.02, atol=1e-3)


def test_a_capsule_whose_volume_is_below_all_numbers():
    volume, J = inertia_of_solid("capsule", (1e-320, 2.0))
    assert volume == 0.0
    np.testing.assert_allclose(np.diag(J), (4.0 / 12.0, 4.0 / 12.0, 0.0))


def test_parts_together():
    """Two halves of a box are the box."""
    volume, J = inertia_of_solid("box", (1.0, 3.0, 5.0))
    half = Inertial(volume, inertia=volume * J)
    whole = total_inertia(inertia_moved(half, Frame((x, 0.0, 0.0))) for x in (0.5, 1.5))
    volume, J = inertia_of_solid("box", (2.0, 3.0, 5.0))
    assert whole.mass == volume
    np.testing.assert_allclose(whole.com, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(whole.inertia, volume * J, rtol=1e-14, atol=1e-13)


def test_nearest_inertia_of_a_body():
    """Closed form in turned axes; none of 1000 inertias of bodies beside it is nearer."""
    rng = np.random.default_rng(3)
    A = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    J = A @ np.diag((0.2, 0.3, 0.7)) @ A.T
    found = nearest_inertia(J)
    np.testing.assert_allclose(found, A @ np.diag((0.3, 0.4, 0.7)) @ A.T, atol=1e-15)
    np.testing.assert_allclose(nearest_inertia(found), found, atol=1e-15)

    def second(J):
        return np.trace(J) / 2.0 * np.eye(3) - J

    apart = np.linalg.norm(second(J) - second(found))
    roots = np.linalg.cholesky(second(found) + 1e-12 * np.eye(3))
    for _ in range(1000):
        root = roots + 0.1 * rng.normal(size=(3, 3))
        assert np.linalg.norm(second(J) - root @ root.T) > apart
