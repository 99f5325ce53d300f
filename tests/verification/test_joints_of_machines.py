"""Joints screw, planar, parallel, inline, inplane and cv, and the bushing, against closed forms.
Runs at rtol 1e-11: errors of some 1e-10 of what moves are to be expected, tolerances are ten times
that."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dap3d_core as dap

G = 9.81
PRECISE = {"rtol": 1e-11, "atol": 1e-13, "dt": 0.05}


def drive(scene, rate):
    """Turn body ``rod`` about z of ground at a constant rate, in a hinge at the origin."""
    scene.add_joint("rev", "axle", P_i="rod.O", P_j="ground.O", a_i="rod.z", a_j="ground.z")
    scene.bodies["rod"].w = (0.0, 0.0, rate)
    scene.add_function("a", "turn", coeff=(0.0, -rate, 0.0))  # of ground against the rod
    scene.add_joint("rel-rot", "motor", body_i="rod", a_j="ground.z", function="turn")


@pytest.mark.parametrize("pitch", [0.01, -0.25])
def test_a_nut_sinks_on_its_thread(pitch):
    """m a + J (2 pi / pitch)^2 a = m g; it turns by 2 pi x / pitch, also over many turns."""
    scene = dap.Scene(name="nut")
    scene.add_body("nut", mass=0.5, Jp=(2e-4, 2e-4, 2e-4))
    joint = {"P_i": "nut.O", "P_j": "ground.O", "a_i": "nut.z", "a_j": "ground.z"}
    scene.add_joint("screw", "thread", pitch=pitch, **joint)
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=6.0, **PRECISE)
    lead = pitch / (2.0 * np.pi)
    a = G / (1.0 + 2e-4 / lead**2 / 0.5)
    x = -0.5 * a * result.t**2
    np.testing.assert_allclose(result.r[:, 0, 2], x, atol=1e-9 * abs(x[-1]))
    np.testing.assert_allclose(result.w[:, 0, 2], -a * result.t / lead, atol=1e-8)
    if pitch == 0.01:
        assert abs(x[-1] / pitch) > 100.0, "many turns"


def test_a_bead_on_a_turning_rod():
    """r'' = w^2 r: r = r_0 cosh(w t); the rod pushes with 2 m w r'."""
    scene = dap.Scene(name="bead")
    scene.add_body("rod", mass=1.0, Jp=(0.1, 0.1, 0.1))
    scene.add_body("bead", mass=0.3, Jp=(1e-3, 1e-3, 1e-3), r=(0.2, 0.0, 0.0), r_dot=(0, 0.6, 0))
    drive(scene, 3.0)
    scene.add_joint("inline", "guide", P_i="bead.O", P_j="rod.O", a_j="rod.x")
    result = dap.simulate(scene, t_end=1.0, **PRECISE)
    distance = np.linalg.norm(result.r[:, 1], axis=1)
    np.testing.assert_allclose(distance, 0.2 * np.cosh(3.0 * result.t), rtol=1e-9)
    push = np.linalg.norm(result.reaction("guide")["i"].force, axis=1)
    np.testing.assert_allclose(push, 2 * 0.3 * 3.0 * 0.6 * np.sinh(3.0 * result.t), atol=1e-8)


def test_a_block_on_a_wedge():
    """Newton's law for both, along and across the slope: all accelerations are constant."""
    angle = 0.6
    sine, cosine, m, M = np.sin(angle), np.cos(angle), 1.0, 3.0
    scene = dap.Scene(name="wedge")
    scene.add_body("wedge", mass=M, Jp=(1, 1, 1))
    scene.add_body("block", mass=m, Jp=(1e-3, 1e-3, 1e-3), r=(0.1 * cosine, 0.0, -0.1 * sine))
    scene.add_vector("slope", "wedge", (sine, 0.0, cosine))
    scene.add_vector2("d", "wedge.O", "ground.O")
    scene.add_joint("tran", "floor", a_j="ground.x", d="d")
    scene.add_joint("inplane", "contact", P_i="block.O", P_j="wedge.O", a_j="slope", distance=0.0)
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=1.0, **PRECISE)
    of_wedge = -m * G * sine * cosine / (M + m * sine**2)
    along = (M + m) * G * sine / (M + m * sine**2)
    half = 0.5 * result.t**2
    np.testing.assert_allclose(result.r[:, 0, 0], of_wedge * half, atol=1e-9)
    np.testing.assert_allclose(result.r[:, 1, 0] - result.r[0, 1, 0],
                               (of_wedge + along * cosine) * half, atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(result.r[:, 1, 2] - result.r[0, 1, 2], -along * sine * half,
                               atol=1e-9)  # fmt: skip
    wrong = scene.copy()
    wrong.joints["contact"].fields["distance"] = 0.05
    lifted = dap.simulate(wrong, t_end=0.0)
    gap = (lifted.r[0, 1] - lifted.r[0, 0]) @ (sine, 0.0, cosine)
    assert abs(gap - 0.05) < 1e-12


def test_a_puck_on_a_turning_table():
    """In the axes of ground it moves straight, whatever the table turns, and keeps its own spin."""
    scene = dap.Scene(name="puck")
    scene.add_body("rod", mass=5.0, Jp=(1, 1, 1))
    scene.add_body("puck", mass=0.2, Jp=(1e-3, 2e-3, 3e-3), r=(0.5, 0.0, 0.1),
                   r_dot=(0.1, 0.7, 0.0), w=(0.0, 0.0, -4.0))  # fmt: skip
    drive(scene, 2.0)
    scene.add_point("top", "rod", (0.0, 0.0, 0.1))
    scene.add_joint("planar", "slide", P_i="puck.O", P_j="top", a_i="puck.z", a_j="rod.z")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=2.0, **PRECISE)
    wanted = np.array([0.5, 0.0, 0.1]) + result.t[:, None] * np.array([0.1, 0.7, 0.0])
    np.testing.assert_allclose(result.r[:, 1], wanted, atol=1e-9)
    np.testing.assert_allclose(result.w[:, 1], np.tile([0, 0, -4.0], (len(result.t), 1)), atol=1e-9)
    force = result.reaction("slide")["i"].force
    np.testing.assert_allclose(force, np.tile([0, 0, 0.2 * G], (len(result.t), 1)), atol=1e-8)


def test_parallel_axes_leave_a_body_to_fly():
    """A parabola, and one rotation: the spin about the axis, with moments that keep it there."""
    scene = dap.Scene(name="arrow")
    scene.add_body("arrow", mass=0.1, Jp=(1e-3, 2e-3, 1.5e-3), r_dot=(3.0, 0.0, 4.0), w=(0, 0, 5.0))
    scene.add_vector("skewed", "arrow", (0.36, 0.48, 0.8))
    scene.add_vector("same", "ground", (0.36, 0.48, 0.8))
    scene.bodies["arrow"].w = tuple(5.0 * np.array([0.36, 0.48, 0.8]))
    scene.add_joint("parallel", "vane", a_i="skewed", a_j="same")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.8, **PRECISE)
    t = result.t
    flight = np.stack([3.0 * t, 0.0 * t, 4.0 * t - 0.5 * G * t**2], axis=1)
    np.testing.assert_allclose(result.r[:, 0], flight, atol=1e-10)
    spin = result.w[:, 0] @ (0.36, 0.48, 0.8)
    np.testing.assert_allclose(spin, 5.0, rtol=1e-9)
    np.testing.assert_allclose(result.w[:, 0], np.outer(spin, (0.36, 0.48, 0.8)), atol=1e-9)


@pytest.mark.parametrize("angle", [0.3, 1.2])
@pytest.mark.parametrize("start", [0.0, 0.9])
def test_shafts_at_an_angle_turn_equally(angle, start):
    """A constant velocity joint keeps w_i = w_j; a universal joint's ratio swings by 1 / cos."""
    ratio = {}
    for keyword in ("cv", "univ"):
        scene = dap.Scene(name="shafts")
        axis = np.array([0.0, np.sin(angle), np.cos(angle)])
        spun = Rotation.from_rotvec(start * axis) * Rotation.from_rotvec([-angle, 0.0, 0.0])
        x, y, z, w = spun.as_quat()
        scene.add_body("rod", mass=1.0, Jp=(0.1, 0.1, 0.1))
        scene.add_body("shaft", mass=1.0, Jp=(0.1, 0.1, 0.1), p=(w, x, y, z), w=tuple(2.0 * axis))
        drive(scene, 2.0)
        scene.add_vector("tilted", "ground", tuple(axis))
        bearing = {"P_i": "shaft.O", "P_j": "ground.O", "a_i": "shaft.z", "a_j": "tilted"}
        scene.add_joint("rev", "bearing", **bearing)
        both = {"P_i": "shaft.O", "P_j": "rod.O", "a_i": "shaft.z"}
        if keyword == "cv":
            scene.add_joint("cv", "coupling", a_j="rod.z", **both)
        elif start == 0.0:
            scene.add_joint("univ", "coupling", **(both | {"a_i": "shaft.x"}), n_j="rod.y")
        else:
            continue
        result = dap.simulate(scene, t_end=3.0, method="auto", **PRECISE)
        ratio[keyword] = result.w[:, 1] @ axis / 2.0
    np.testing.assert_allclose(ratio["cv"], 1.0, atol=1e-9)
    if "univ" in ratio:
        assert abs(np.max(ratio["univ"]) - 1.0 / np.cos(angle)) < 0.02 / np.cos(angle) ** 2


def test_shafts_that_point_apart_are_refused():
    """A cv joint bent by a straight angle has no sense of turning."""
    scene = dap.Scene(name="apart")
    scene.add_body("shaft", p=(0.0, 1.0, 0.0, 0.0))
    joint = {"P_i": "shaft.O", "P_j": "ground.O", "a_i": "shaft.z", "a_j": "ground.z"}
    scene.add_joint("cv", "c", **joint)
    with pytest.raises(dap.SceneError, match="turn one of them round"):
        dap.simulate(scene, t_end=0.1)


def damped(t, mass, c, k, speed):
    """The motion of a damped oscillator from rest at its centre, with a speed."""
    decay = c / (2.0 * mass)
    omega = np.sqrt(k / mass - decay**2)
    return speed / omega * np.exp(-decay * t) * np.sin(omega * t)


STIFF, DAMP = (2e5, 2e5, 6e5, 1500.0, 1500.0, 900.0), (400.0, 400.0, 900.0, 8.0, 8.0, 6.0)
MASS, INERTIA = 120.0, (4.0, 8.0, 9.0)


def mount(k, c, **body):
    """A body on a bushing at its mass centre."""
    scene = dap.Scene(name="mount")
    scene.add_body("engine", mass=MASS, Jp=INERTIA, **body)
    scene.add_force("bushing", "mount", P_i="engine.O", P_j="ground.O", k=k, c=c)
    return scene


@pytest.mark.parametrize("axis", range(3))
def test_a_bushing_swings_in_each_of_six_directions(axis):
    """A shift along an axis and a turn about it are two damped oscillators, for any angle."""
    along = np.eye(3)[axis]
    scene = mount(STIFF, DAMP, r_dot=tuple(0.5 * along), w=tuple(12.0 * along))
    result = dap.simulate(scene, t_end=1.0, **PRECISE)
    x = damped(result.t, MASS, DAMP[axis], STIFF[axis], 0.5)
    turn = damped(result.t, INERTIA[axis], DAMP[3 + axis], STIFF[3 + axis], 12.0)
    assert np.max(np.abs(turn)) > 0.5, "not a small one"
    np.testing.assert_allclose(result.r[:, 0, axis], x, atol=1e-9)
    np.testing.assert_allclose(result.p[:, 0, 1 + axis], np.sin(turn / 2), atol=1e-8)


def test_a_bushing_by_its_whole_matrix():
    """Small motions obey M x'' + C x' + K x = 0 with 6 x 6 matrices, whose frequencies modes have.
    Eigenvalues of the symmetric problem by numpy; they agree to rounding."""
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 6)) * np.array([500.0] * 3 + [30.0] * 3)
    k = half @ half.T + np.diag(STIFF)
    k = 0.5 * (k + k.T)
    scene = mount(k.tolist(), (0.0,) * 6)
    found = np.sort(dap.linearize(scene).frequencies)
    mass = np.diag([MASS**-0.5] * 3 + [i**-0.5 for i in INERTIA])
    # seen from the engine, body i, ground moves by the negative of the engine's small motion
    wanted = np.sqrt(np.linalg.eigvalsh(mass @ k @ mass)) / (2.0 * np.pi)
    np.testing.assert_allclose(found[-6:], wanted, rtol=1e-9)


def test_matrices_that_are_not_symmetric_are_refused():
    """And so are lists of other lengths; both with what is allowed."""
    k = np.diag(STIFF).tolist()
    k[0][3] = 7.0
    with pytest.raises(dap.SceneError, match="should be symmetric; row 4, column 1 is 0"):
        dap.simulate(mount(k, DAMP), t_end=0.1)
    with pytest.raises(dap.SceneError, match="list of 6 numbers"):
        dap.simulate(mount((1.0, 2.0), DAMP), t_end=0.1)


def test_the_stiffness_of_a_bushing_can_be_varied():
    """A sweep over one of its numbers gives the frequencies sqrt(k / m)."""
    scene = mount(STIFF, (0.0,) * 6, r_dot=(0.0, 0.0, 0.1))
    stiffness = {"forces.mount.k.3": [1e5, 4e5]}
    sweep = dap.sweep(scene, stiffness, outputs=["engine.r.z:max"], t_end=0.2, dt=1e-3)
    highest = sweep["engine.r.z:max"].values
    # between reports 1 ms apart a maximum is missed by (omega dt / 2)^2 / 2 < 5e-4 of it
    np.testing.assert_allclose(highest, 0.1 / np.sqrt(np.array([1e5, 4e5]) / MASS), rtol=1e-3)
