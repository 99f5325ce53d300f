"""Contacts are drawn by the surfaces that touch."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.view.scene3d.contact_shapes import contact_shapes
from dap3d_core.view.scene3d.shapes import scene_shapes


@pytest.fixture(scope="module")
def scene():
    """One body of each kind of surface, the ball also with a point at a cam and in a bowl."""
    scene = dap.Scene()
    for k, name in enumerate(("ball", "box", "rod", "cam", "bowl")):
        scene.add_body(name, mass=1.0, Jp=[0.1] * 3, r=[0.0, 5.0 * k, 3.0])
    scene.add_point("low", body="rod", sPp=[0.0, 0.1, -0.2])
    scene.add_point("high", body="rod", sPp=[0.0, 0.1, 0.4])
    scene.add_function("harmonic", "x", amplitude=0.5, frequency=1.0, phase=0.5 * np.pi)
    scene.add_function("harmonic", "y", amplitude=0.4, frequency=1.0)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.3)
    scene.add_contact("ball_ball", "in", P_i="ball.O", radius_i=0.3, P_j="bowl.O", radius_j=30.0,
                      inside=True)  # fmt: skip
    scene.add_contact("box_plane", "stands", body_i="box", size=[0.1, 0.2, 0.3])
    scene.add_contact("capsule_plane", "lies", P_i="low", Q_i="high", radius=0.05)
    scene.add_contact("point_curve", "follows", P_i="ball.O", P_j="cam.O", x="x", y="y",
                      s_max=2.0 * np.pi, closed=True)  # fmt: skip
    return scene


def test_each_surface_is_drawn_once_where_it_touches(scene):
    model = dap.compile(scene).model
    shapes = contact_shapes(model)
    kinds = [(model.body_names[shape.body - 1], shape.type) for shape in shapes]
    assert sorted(kinds) == [
        ("ball", "sphere"), *[("bowl", "line")] * 3, ("box", "box"), ("cam", "line"),
        ("rod", "capsule"),
    ]  # fmt: skip
    values = {shape.name: shape.values for shape in shapes}
    assert values["floor"] == {"radius": 0.3, "at": (0.0, 0.0, 0.0)}
    assert values["stands"] == {"size": (0.1, 0.2, 0.3), "at": (0.0, 0.0, 0.0)}
    assert values["lies"]["at"] == pytest.approx((0.0, 0.1, 0.1))
    assert values["lies"]["length"] == pytest.approx(0.6)
    assert np.linalg.norm(values["in"]["points"], axis=1) == pytest.approx(30.0)
    cam = np.array(values["follows"]["points"])
    assert np.hypot(cam[:, 0] / 0.5, cam[:, 1] / 0.4) == pytest.approx(1.0)
    assert tuple(cam[0]) == tuple(cam[-1]), "it is closed"


def test_bodies_with_shapes_of_their_own_keep_them(scene):
    scene = scene.copy()
    scene.add_shape("cylinder", "drum", body="ball", radius=0.3, length=0.1)
    model = dap.compile(scene).model
    shapes = scene_shapes(scene, model.body_names, ["#000000"] * 5, contact_shapes(model))
    assert [mark.kind for mark in shapes.marks if mark.body == 1] == ["cylinder"]
    assert shapes.bodies == {1}
    assert shapes.touching == {2, 3, 4, 5}
