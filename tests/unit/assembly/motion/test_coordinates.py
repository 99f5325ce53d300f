"""Joint coordinates: recovered from poses, their rates, signs and turns.

The motions of a scene's joints are found once for each scene that has them.
"""

import numpy as np
import pytest
from support.internals import Pose, classify, compose, inverse, relative, rotation_vector, split
from support.joint_pairs import BETWEEN, STANDARD, compiled_pair, pair
from support.rotations import to_body

import dap3d_core as dap
from dap3d_core.assembly.motion import coordinates as motion_coordinates
from dap3d_core.simulation import CompiledModel

#: Joints with one factor and with two, axes parallel and not.
JOINTS = STANDARD | dict.fromkeys(("planar", "pin-in-slot", "two-hinges"), BETWEEN)
JOINTS["screw"] = BETWEEN | {"pitch": -0.4}
JOINTS["sleeve"] = BETWEEN


def motion_of(keyword):
    return classify(compiled_pair(keyword, JOINTS[keyword], 2).model).of(0)


@pytest.mark.every(4)
@pytest.mark.parametrize("reverse", [False, True], ids=["of body i", "of body j"])
@pytest.mark.parametrize("keyword", JOINTS)
def test_coordinates_are_recovered(keyword, reverse):
    """Coordinates of the pose at random coordinates are these; turned round, the same ones."""
    motion = motion_of(keyword)
    rng = np.random.default_rng(7)
    q = rng.uniform(-1.7, 1.7, size=(20, 1, motion.size))  # a ball's vector below half a turn
    poses = [motion.pose(values) for values in q]
    pose = Pose(*(np.stack(x) for x in zip(*poses, strict=True)))
    if reverse:
        order = np.concatenate([np.arange(motion.size)[c] for c in motion.columns[::-1]])
        motion, q = motion.reversed(), q[..., order]
        pose = inverse(pose)
    np.testing.assert_allclose(motion_coordinates.coordinates(motion, pose), q, atol=2e-14)


@pytest.mark.parametrize("keyword", JOINTS)
def test_rates_are_those_of_the_coordinates(keyword):
    """Rates from relative twists, by differences of poses, are those of the coordinates."""
    motion = motion_of(keyword)
    rng = np.random.default_rng(8)
    q, q_dot = rng.uniform(-1.5, 1.5, size=(2, 6, 1, motion.size))
    h = 1e-5
    for here, rate in zip(q, q_dot, strict=True):
        ahead, back = motion.pose(here + h * rate), motion.pose(here - h * rate)
        step = relative(back, ahead)  # in axes of body i, seen h earlier: even to second order
        w = rotation_vector(step.p) / (2.0 * h)
        twist = np.concatenate([_velocity(back, ahead, motion.pose(here), h), w], axis=-1)
        # differences of second order: h^2 with third derivatives of order 1, and 1e-16 / h
        np.testing.assert_allclose(
            motion_coordinates.coordinate_rates(motion, here, twist), rate, atol=3e-9
        )


def _velocity(back, ahead, pose, h):
    return to_body(pose.p, (ahead.r - back.r) / (2.0 * h))


def test_a_positive_angle_is_a_right_hand_rotation_of_body_i_about_a_j():
    """Body i turned by 0.3 rad about a_j through P_j, and along it by 0.2 m: q is (0.2, 0.3)."""
    motion = motion_of("cyl")
    start = motion.start
    scene = pair(2)
    a_j = np.array(scene.vectors["a_j"].sp)
    P_j = np.array(scene.points["P_j"].sPp)
    p = np.concatenate([[np.cos(0.15)], np.sin(0.15) * a_j])
    turn = Pose(P_j + 0.2 * a_j, p)
    centred = Pose(start.r - P_j, start.p)
    q = motion_coordinates.coordinates(motion, compose(Pose(turn.r[None], turn.p[None]), centred))
    np.testing.assert_allclose(q[0], [0.2, 0.3], atol=1e-14)
    assert motion_coordinates.aliases(motion) == {"length": 0, "angle": 1}
    assert motion_coordinates.coordinate_units(motion) == ("m", "rad")
    assert (
        motion_coordinates.aliases(motion_of("sph"))
        == {}
        == motion_coordinates.aliases(motion_of("univ"))
    )


def test_turns_are_counted_between_instants_far_apart():
    """Twenty turns at a growing rate, eight instants a run: the angle and its rate go on."""
    scene = pair(4, on_ground=True)
    scene.add_joint("rev", "J", **STANDARD["rev"])
    motion = classify(CompiledModel(scene).model).of(0)
    t = np.linspace(0.0, 10.0, 41)
    angle, rate = 0.5 * t**2 - 2.0 * t, t - 2.0  # up to 8 rad/s: 2 rad a step, 30 rad in all
    poses = [motion.pose(np.array([[a]])) for a in angle]
    r, p = (np.stack(x) for x in zip(*poses, strict=True))
    a_j = np.array(scene.vectors["a_j"].sp)
    w = rate[:, None, None] * a_j
    v = np.cross(w, r - np.array(scene.points["P_j"].sPp))
    q, q_dot = motion_coordinates.joint_coordinates(motion, 1.7 * t, r, p, v / 1.7, w / 1.7)
    np.testing.assert_allclose(q[:, 0, 0], angle, atol=1e-13)
    np.testing.assert_allclose(q_dot[:, 0, 0], rate / 1.7, atol=1e-13)


def test_a_fixed_joint_has_no_coordinates():
    compiled = compiled_pair("fix", {"body_i": "body"})
    motion = classify(compiled.model).of(0)
    r, p, v, w = (x[None] for x in split(compiled.model.u0))
    q, q_dot = motion_coordinates.joint_coordinates(motion, [0.0], r, p, v, w)
    assert (motion.size, q.shape, q_dot.shape) == (0, (1, 1, 0), (1, 1, 0))
    np.testing.assert_allclose(motion.pose(np.zeros((1, 0))).r[0], r[0, 0], atol=1e-15)


def test_coordinates_are_zero_in_the_reference_poses():
    """Those of the scene, or of a state that is given: there they are those from the scene."""
    compiled = compiled_pair("rev", STANDARD["rev"], on_ground=True)
    scene = classify(compiled.model).of(0)
    turned = scene.pose(np.array([[0.8]]))
    u = np.concatenate([turned.r[0], turned.p[0], np.zeros(6)])
    given = classify(compiled.model, u).of(0)
    np.testing.assert_allclose(
        motion_coordinates.coordinates(scene, scene.start), [[0.0]], atol=1e-15
    )
    np.testing.assert_allclose(
        motion_coordinates.coordinates(scene, given.start), [[0.8]], atol=1e-14
    )
    np.testing.assert_allclose(
        motion_coordinates.coordinates(given, scene.start), [[-0.8]], atol=1e-14
    )


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
    monkeypatch.setattr(motion_coordinates, "KEPT", 3)
    last = [motions((0.0, 0.0, 1.0), mass=10.0 + k) for k in range(5)][-1]
    assert len(motion_coordinates._found) == 3
    assert motions((0.0, 0.0, 1.0), mass=14.0) is last
