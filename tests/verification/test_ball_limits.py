"""Stops of the turn of a ball joint, sph_stop, and the limits of balls that MJCF has."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
g, m, l, J = 9.81, 2.0, 0.4, (0.1, 0.2, 0.25)
#: Greatest turn, rad.
PHI = 0.5
#: A turn by PHI, about no axis of the body.
TURN = PHI * np.array([0.48, 0.64, 0.6])


def pendulum(turn=(0.0, 0.0, 0.0), **stop):
    """A body whose mass centre lies at l along x from the ball that it hangs in."""
    there = Rotation.from_rotvec(turn)
    p = np.roll(there.as_quat(), 1)
    scene = dap.Scene(name="pendulum")
    scene.add_body("arm", mass=m, Jp=J, r=tuple(there.apply([l, 0.0, 0.0])), p=tuple(p))
    scene.add_point("pivot", "arm", (-l, 0.0, 0.0))
    scene.add_joint("sph", "ball", P_i="pivot", P_j="ground.O")
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_force("sph_stop", "stop", body_i="ground", body_j="arm", phi_stop=PHI, **stop)
    return scene


def angles(result):
    return Rotation.from_quat(np.roll(result.p[:, 0], -1, axis=1)).magnitude()


@pytest.mark.parametrize("contact", [{}, {"contact": "stepping", "contact_step": 1e-3}])
def test_a_rigid_stop_carries_a_pendulum(contact):
    """It falls by PHI about y, and stays there: the stop has the moment of its weight."""
    result = dap.simulate(pendulum(), t_end=1.0, dt=0.25, **contact, **({} if contact else TIGHT))
    # a step ends at most its length after the stop, and returns what that was beyond
    np.testing.assert_allclose(angles(result)[2:], PHI, rtol=0, atol=1e-6 if contact else 1e-13)
    moment = m * g * l * np.cos(PHI)
    assert result.contact("stop").normal_force[-1] == pytest.approx(moment, rel=1e-6)


def test_a_soft_stop_gives_way_by_its_moment():
    """k (phi - PHI) = m g l cos(phi) at rest."""
    result = dap.simulate(pendulum(k=1e3, J_c=J[1] + m * l * l), t_end=2.0, dt=1.0, **TIGHT)
    rest = brentq(lambda phi: 1e3 * (phi - PHI) - m * g * l * np.cos(phi), PHI, 1.0, xtol=1e-15)
    assert angles(result)[-1] == pytest.approx(rest, rel=0, abs=1e-9)


def test_a_stop_takes_no_more_than_the_turn_about_its_axis():
    """M = J_O^-1 (weight - moment u), u . M = 0, of a body that starts at its stop.

    The axis moves in the body: at rest its rate has no share.
    """
    result = dap.simulate(pendulum(TURN), t_end=0.0)
    A = Rotation.from_rotvec(TURN).as_matrix()
    arm, u = A @ [l, 0.0, 0.0], TURN / PHI
    J_O = A @ np.diag(J) @ A.T + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    free = np.linalg.solve(J_O, np.cross(arm, [0.0, 0.0, -m * g]))
    along = np.linalg.solve(J_O, u)
    expected = free - along * max(0.0, u @ free / (u @ along))
    np.testing.assert_allclose(result.wd[0, 0], expected, rtol=0, atol=1e-12)
    assert u @ free > 1.0


FILE = """<mujoco><compiler angle="radian"/><worldbody><body name="arm" euler="0 0 0.3">
  <joint name="ball" type="ball" range="0 0.5"/><inertial pos="0.4 0 0" mass="2"
  diaginertia="0.1 0.2 0.25"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("limits", ["hard", "soft"])
def test_limits_of_a_ball_of_a_file(tmp_path, limits):
    """Its turn is counted from the pose that the file draws; it starts beyond, and is put back."""
    (tmp_path / "a.xml").write_text(FILE)
    start = (np.cos(0.6), 0.0, np.sin(0.6), 0.0)
    path = tmp_path / "a.xml"
    scene, report = dap.import_model(path, limits=limits, positions={"ball": start})
    assert "starts at 1.2, beyond its limits 0 and 0.5: it is put at 0.5" in str(
        [one.text for one in report.translated]
    )
    drawn = Rotation.from_euler("z", 0.3)
    body = scene.bodies["arm"]
    here = Rotation.from_quat(np.roll(body.p, -1))
    np.testing.assert_allclose((drawn.inv() * here).as_rotvec(), [0.0, PHI, 0.0], atol=1e-15)
    stop = scene.forces["ball_stop"]
    assert stop.type == "sph_stop"
    assert ("k" in stop.fields) == (limits == "soft")
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    turned = (drawn.inv() * Rotation.from_quat(np.roll(result.p[-1, 0], -1))).magnitude()
    # a soft one gives way by m g l cos(phi) T^2 / J, with T = 2 ms and J at least that of the arm
    assert turned == pytest.approx(PHI, rel=0, abs=1e-12 if limits == "hard" else 2.5e-4)
    scene, report = dap.import_model(path, limits="off")
    assert "ball_stop" not in scene.forces
    assert "left out: limits = off" in str(report.translated)
