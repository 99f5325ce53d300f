"""Views are orthonormal projections along the axis or the angles that they name."""

import numpy as np
import pytest

from dap3d_core.plot.film.projection import camera_of

SPACE = np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]])


@pytest.mark.parametrize(("view", "seen"), [("x", [2, 3]), ("y", [1, 3]), ("z", [1, 2])])
def test_views_along_axes(view, seen):
    camera = camera_of(view, SPACE)
    np.testing.assert_array_equal(camera.project(np.array([1.0, 2.0, 3.0])), seen)


@pytest.mark.parametrize("view", ["30,40", "-60, 22", "0,90", "123.5,-90"])
def test_any_view_is_a_projection_along_the_line_of_sight(view):
    camera = camera_of(view, SPACE)
    axes = np.stack([camera.right, camera.up, camera.towards])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    a, e = np.radians([float(part) for part in view.split(",")])
    sight = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
    np.testing.assert_allclose(camera.towards, sight, atol=1e-15)


@pytest.mark.parametrize("axis", "xyz")
def test_a_plane_motion_is_looked_at_across_its_plane(axis):
    extent = SPACE.copy()
    extent["xyz".index(axis)] = 0.3
    assert camera_of(None, extent).plane == axis
    assert camera_of(None, SPACE).plane == ""


@pytest.mark.parametrize("view", ["w", "1,2,3", "10,91", "nan,0", "x,y"])
def test_other_views_are_refused(view):
    with pytest.raises(ValueError, match="a view is x, y or z"):
        camera_of(view, SPACE)
