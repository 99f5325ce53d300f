"""Drivers at position level, and a point on a plane, against closed forms.
Tolerances: what stands at position level is held to 1e-11 by projection; rtol 1e-11 elsewhere
leaves some 1e-9."""

import numpy as np
import pytest
from verification.test_torsion import wheel

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def heading(result, body=0):
    """The angle of a body about z, in (-pi, pi]."""
    p = result.p[:, body]
    return 2.0 * np.arctan2(p[:, 3], p[:, 0])


def test_a_driven_wheel_has_the_angle_of_its_function():
    """drive-rot: the angle since the start is f - f(0) for body i, ground j, over many turns."""
    scene = wheel(0.3)
    scene.add_function("a", "motor", coeff=(1.7, 9.0, 0.5))
    scene.add_joint("drive-rot", "drive", body_i="wheel", a_j="ground.z", function="motor")
    result = dap.simulate(scene, t_end=5.0, dt=0.1, **TIGHT)
    expected = 0.3 + 9.0 * result.t + 0.5 * result.t**2
    assert expected[-1] > 18.0 * np.pi
    off = np.exp(1j * (heading(result) - expected)) - 1.0
    assert np.max(np.abs(off)) < 1e-11
    assert result.w[:, 0, 2] == pytest.approx(9.0 + result.t, abs=1e-11)
    # the motor gives J f'' = 0.3 N m
    assert result.reaction("drive")["i"].moment[:, 2] == pytest.approx(0.3, abs=1e-10)


def test_a_driven_angle_does_not_drift():
    """drive-rot keeps the angle to rounding at a loose tolerance, where rel-rot lets it drift."""
    found = {}
    for word, sense in (("drive-rot", 1.0), ("rel-rot", -1.0)):  # the manual's sign
        scene = wheel(0.0)
        scene.add_function("harmonic", "motor", amplitude=2.0, frequency=3.0)
        scene.add_joint(word, "drive", body_i="wheel", a_j="ground.z", function="motor")
        result = dap.simulate(scene, t_end=5.0, dt=0.1, rtol=1e-4, atol=1e-6)
        found[word] = np.max(np.abs(heading(result) - sense * 2.0 * np.sin(3.0 * result.t)))
    assert found["drive-rot"] < 1e-10
    assert found["rel-rot"] > 1e-7


def test_a_driven_angle_is_pulled_back_by_the_correction():
    """drive-rot between two bodies: what a loop moves at the start, the driver's row restores."""
    scene = wheel(0.0)
    scene.add_body("crank", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1e-3),
                   p=(np.cos(0.25), 0.0, 0.0, np.sin(0.25)))  # fmt: skip
    scene.add_joint("rev", "pin", P_i="crank.O", P_j="wheel.O", a_i="crank.z", a_j="wheel.z")
    scene.add_joint("drive-rot", "lock", body_i="crank", body_j="wheel", a_j="wheel.z")
    scene.add_function("a", "motor", coeff=(0.0, 2.0, 0.0))
    scene.add_joint("drive-rot", "drive", body_i="wheel", a_j="ground.z", function="motor")
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    assert heading(result, 1) - heading(result, 0) == pytest.approx(0.5, abs=1e-11)
    assert heading(result, 0) == pytest.approx(2.0 * result.t, abs=1e-11)


def test_a_lock_carries_the_moment():
    """drive-rot without a function: the wheel stands still, the reaction meets the moment."""
    scene = wheel(0.3)
    scene.add_joint("drive-rot", "lock", body_i="wheel", a_j="ground.z")
    scene.add_force("n", "twist", body_i="wheel", n=(0.0, 0.0, 0.7))
    result = dap.simulate(scene, t_end=1.0, dt=0.5, **TIGHT)
    assert heading(result) == pytest.approx(0.3, abs=1e-12)
    assert result.reaction("lock")["i"].moment[:, 2] == pytest.approx(-0.7, abs=1e-11)


def slide(length):
    """A bead that a driver pushes along an arm, which a motor turns about z at 2 rad/s."""
    scene = dap.Scene(name="slide")
    scene.add_body("arm", mass=1.0, Jp=(0.3, 0.3, 0.5))
    scene.add_body("bead", mass=0.5, Jp=(0.1, 0.1, 0.1), r=(1.0, 0.0, 0.0))
    scene.add_joint("rev", "axle", P_i="arm.O", P_j="ground.O", a_i="arm.z", a_j="ground.z")
    scene.add_function("a", "turn", coeff=(0.0, 2.0, 0.0))
    scene.add_joint("drive-rot", "motor", body_i="arm", a_j="ground.z", function="turn")
    scene.add_joint("tran", "guide", a_j="arm.x", P_i="bead.O", P_j="arm.O")
    scene.add_function("a", "stroke", coeff=(-0.4, 0.3, 0.2))
    given = {} if length is None else {"length": length}
    scene.add_joint("drive-tran", "push", body_i="bead", a_j="arm.x", function="stroke", **given)
    return scene


@pytest.mark.parametrize(("length", "start"), [(None, 1.0), (1.6, 1.2)])
def test_a_bead_is_pushed_along_a_turning_arm(length, start):
    """drive-tran: arm_x . (r_bead - r_arm) = length + f, also where the arm turns.
    Left out, the length makes C = 0 at the start. With rho the distance from the axle, the guide
    gives the Coriolis force 2 m Omega rho', and the driver m (rho'' - Omega^2 rho)."""
    result = dap.simulate(slide(length), t_end=1.0, dt=0.1, **TIGHT)
    t, turn = result.t, 2.0 * result.t
    rho = start + 0.3 * t + 0.2 * t**2
    along = np.stack([np.cos(turn), np.sin(turn), 0 * t], axis=1)
    across = np.stack([-np.sin(turn), np.cos(turn), 0 * t], axis=1)
    assert result.r[:, 1] == pytest.approx(rho[:, None] * along, abs=1e-10)
    guide = result.reaction("guide")["i"].force
    push = result.reaction("push")["i"].force
    speed = 0.3 + 0.4 * t
    assert guide == pytest.approx((0.5 * 2.0 * 2.0 * speed)[:, None] * across, abs=1e-8)
    assert push == pytest.approx((0.5 * (0.4 - 4.0 * rho))[:, None] * along, abs=1e-8)


def test_a_driver_between_points():
    """drive-tran on points: those are measured, the bodies follow from them."""
    scene = dap.Scene(name="lift")
    scene.add_body("cabin", mass=3.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, -2.0))
    scene.add_point("roof", "cabin", (0.0, 0.0, 1.0))
    scene.add_joint("tran", "shaft", a_j="ground.z", P_i="cabin.O", P_j="ground.O")
    scene.add_function("step", "ride", x_end=2.0, f_end=1.5)
    scene.add_joint("drive-tran", "rope", P_i="roof", P_j="ground.O", a_j="ground.z",
                    function="ride", length=-1.0)  # fmt: skip
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    u = result.t / 2.0
    assert result.r[:, 0, 2] == pytest.approx(-2.0 + 1.5 * (3 * u**2 - 2 * u**3), abs=1e-11)


def test_a_point_on_a_plane_that_moves():
    """rP: the coordinate of the point is length + f; its reaction is m (g + f'')."""
    scene = dap.Scene(name="lift")
    scene.add_body("cabin", mass=3.0, Jp=(1.0, 1.0, 1.0), r_dot=(0.4, 0.0, 0.0))
    scene.add_vector("up", "ground", (0.0, 0.0, 2.0))
    scene.add_function("a", "ride", coeff=(0.0, 0.2, 0.3))
    scene.add_joint("rP", "floor", body_i="cabin", a_j="up", length=-0.5, function="ride")
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    height = -0.5 + 0.2 * result.t + 0.3 * result.t**2
    assert result.r[:, 0, 2] == pytest.approx(height, abs=1e-11)
    assert result.r[:, 0, 0] == pytest.approx(0.4 * result.t, abs=1e-10)
    load = result.reaction("floor")["i"].force[:, 2]
    assert load == pytest.approx(3.0 * (9.81 + 0.6), abs=1e-9)


def test_a_point_off_the_mass_centre_slides_on_a_plane():
    """rP at a point: a rod's foot on the floor; energy is kept, the mass centre falls straight."""
    scene = dap.Scene(name="falling rod")
    lean = 0.4
    scene.add_body("rod", mass=1.0, Jp=(1 / 3, 1 / 3, 0.01), r=(0.0, 0.0, np.cos(lean)),
                   p=(np.cos(lean / 2), 0.0, np.sin(lean / 2), 0.0))  # fmt: skip
    scene.add_point("foot", "rod", (0.0, 0.0, -1.0))
    scene.add_joint("rP", "floor", P_i="foot", a_j="ground.z", length=0.0)
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=0.7, dt=0.1, **TIGHT)
    height = result.r[:, 0, 2]
    assert result.r[:, 0, :2] == pytest.approx(0.0, abs=1e-11)
    # m g (h0 - h) = (m h_dot^2 + J theta_dot^2) / 2 with h = cos(theta): Goldstein, sliding ladder
    sine = np.sqrt(1.0 - height**2)
    square = 2.0 * 9.81 * (np.cos(lean) - height) / (sine**2 + 1 / 3)
    assert result.w[:, 0, 1] == pytest.approx(np.sqrt(np.maximum(square, 0.0)), abs=1e-7)
