"""The motions of a scene's joints are found once for each scene that has them."""

import numpy as np

import dap3d_core as dap
from dap3d_core.assembly.motion import joint_angles


def motions(axis, mass=1.0):
    """Those of a rod on a hinge about an axis."""
    scene = dap.Scene()
    scene.add_body("rod", mass=mass, Jp=(1.0, 1.0, 1.0))
    scene.add_vector("axle", "rod", axis)
    scene.add_vector("ground_axle", "ground", axis)
    scene.add_joint("rev", "pin", P_i="rod.O", P_j="ground.O", a_i="axle", a_j="ground_axle")
    return dap.compile(scene).evaluator.model.motions


def test_the_same_scene_has_the_same_and_another_its_own():
    """Another axis is another motion: the twist of a hinge turns about its axis."""
    one = motions((0.0, 0.0, 1.0))
    assert motions((0.0, 0.0, 1.0)) is one
    assert motions((0.0, 0.0, 1.0), mass=2.0) is not one
    other = motions((0.0, 1.0, 0.0))
    for found, axis in ((one, 2), (other, 1)):
        ((screws,),) = found.motions[0].screws[..., 3:]
        np.testing.assert_allclose(np.abs(screws), np.eye(3)[axis], atol=1e-12)


def test_few_are_kept(monkeypatch):
    """Those found last: a process that compiles many scenes does not grow by each."""
    monkeypatch.setattr(joint_angles, "KEPT", 3)
    last = [motions((0.0, 0.0, 1.0), mass=10.0 + k) for k in range(5)][-1]
    assert len(joint_angles._found) == 3
    assert motions((0.0, 0.0, 1.0), mass=14.0) is last
