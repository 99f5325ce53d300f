"""Stops without a stiffness, and limits of joints, against closed forms.

Tolerances: at rtol 1e-12 a run of a second leaves less than 1e-12 of its coordinates; where bounces
end is known to 1e-9 s, as the last of them, below 1e-13 of the length, are summed.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from verification.test_sticking_friction import hinge

import dap3d_core as dap

TIGHT = {"rtol": 1e-12, "atol": 1e-14}
g, h, e, m = 9.81, 1.0, 0.5, 2.0


def falling(**stop):
    scene = dap.Scene(name="falling")
    scene.add_body("ball", mass=m, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, h))
    scene.add_force("weight", "gravity", gravity=g)
    if stop:
        scene.add_force("plane_stop", "stop", P_i="ball.O", **stop)
    return scene


def rests(result):
    return [event.t for event in result.events if event.kind == "rest"]


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_ball_bounces_to_rest_at_a_rigid_plane(integrator):
    """At sqrt(2 h / g) (1 + e) / (1 - e), and stays there: its weight is carried."""
    result = dap.simulate(falling(e=e), t_end=2.0, dt=0.5, integrator=integrator, **TIGHT)
    expected = np.sqrt(2.0 * h / g) * (1.0 + e) / (1.0 - e)
    assert rests(result) == pytest.approx([expected], rel=0, abs=1e-9)
    assert np.abs(result.r[-1]).max() < 1e-15
    assert result.contact("stop").normal_force[-1] == pytest.approx(m * g, rel=1e-14)


def test_a_slider_bounces_to_rest_at_its_lower_limit():
    """As the ball; the coordinate is counted from the pose of the scene."""
    scene = falling()
    scene.add_joint("tran", "way", P_i="ball.O", P_j="ground.O", a_j="ground.z", lower=-0.7, e=e,
                    upper=0.1)  # fmt: skip
    result = dap.simulate(scene, t_end=2.0, dt=0.5, **TIGHT)
    expected = np.sqrt(2.0 * 0.7 / g) * (1.0 + e) / (1.0 - e)
    assert rests(result) == pytest.approx([expected], rel=0, abs=1e-9)
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, h - 0.7], rel=0, abs=1e-15)
    assert result.contact("way_lower").normal_force[-1] == pytest.approx(m * g, rel=1e-14)
    assert not result.contact("way_upper").mode.any()


def test_a_hinge_turns_to_and_fro_between_its_limits():
    """At 2, 1 and 0.5 rad/s: to 1 in 0.5 s, back to -0.5 in 1.5 s, and up again."""
    scene = hinge(lower=-0.5, upper=1.0, e=0.5)
    result = dap.simulate(scene, t_end=2.5, dt=0.25, **TIGHT)
    assert [event.t for event in result.events] == pytest.approx([0.5, 2.0], rel=0, abs=1e-12)
    assert result.quantity("axle.angle").values[-1] == pytest.approx(-0.25, abs=1e-12)
    lost = 0.5 * 0.3 * (4.0 - 1.0) + 0.5 * 0.3 * (1.0 - 0.25)
    assert result.work[-1] == pytest.approx(-lost, abs=1e-12)


def test_a_moment_holds_a_hinge_at_its_stop():
    """From theta = -1, its end, where bounces of a rate a = n / I end after 2 v e / (a (1 - e))."""
    scene, n = hinge(), 1.5
    scene.add_force("rot_stop", "stop", joint="axle", theta_stop=-1.0, e=0.3)
    scene.add_force("motor", "push", joint="axle", torque=n)
    result = dap.simulate(scene, t_end=2.0, dt=0.5, **TIGHT)
    a = n / 0.3
    reached = (np.sqrt(4.0 + 2.0 * a) - 2.0) / a
    expected = reached + 2.0 * (2.0 + a * reached) * 0.3 / (a * 0.7)
    assert rests(result) == pytest.approx([expected], rel=0, abs=1e-9)
    assert result.quantity("axle.angle").values[-1] == pytest.approx(1.0, abs=1e-15)
    assert result.contact("stop").normal_force[-1] == pytest.approx(n, rel=1e-14)


def test_a_rope_jerks_and_leads_its_end_along_a_circle():
    """What the velocity has along the rope is lost, its other part swings on with its energy."""
    scene = falling()
    scene.bodies["ball"].r = (0.6, 0.0, 0.0)
    scene.add_force("ptp_stop", "rope", P_i="ball.O", P_j="ground.O", l_stop=1.0, side="max")
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    taut = np.sqrt(2.0 * 0.8 / g)
    assert result.events[0].t == pytest.approx(taut, rel=0, abs=1e-12)
    energy = 0.5 * (g * taut * 0.6) ** 2 - g * 0.8
    later = result.t > taut
    v, z = result.rd[later, 0], result.r[later, 0, 2]
    np.testing.assert_allclose(0.5 * np.sum(v * v, axis=1) + g * z, energy, rtol=0, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(result.r[later, 0], axis=1), 1.0, rtol=0, atol=1e-14)


def test_two_stops_share_what_they_carry():
    """A plate on four rigid stops: each carries something, all of them its weight; it stays."""
    scene = falling()
    scene.bodies["ball"].r = (0.0, 0.0, 0.0)
    for k, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        scene.add_point(f"P{k}", "ball", (0.5 * x, 0.5 * y, 0.0))
        scene.add_force("plane_stop", f"foot{k}", P_i=f"P{k}")
    result = dap.simulate(scene, t_end=1.0, dt=0.5, **TIGHT)
    forces = [result.contact(f"foot{k}").normal_force[-1] for k in range(4)]
    assert min(forces) > 0.0
    assert sum(forces) == pytest.approx(m * g, rel=1e-13)
    assert np.abs(result.r).max() < 1e-15


def test_a_hinge_that_stops_at_a_limit_is_led_off_by_a_moment():
    """It stops there, e = 0, and turns back at once: one impact, then n t^2 / (2 I)."""
    scene, n, inertia = hinge(lower=-1.2345, upper=0.777), 0.5, 0.3
    scene.add_force("motor", "push", joint="axle", torque=-n)
    result = dap.simulate(scene, t_end=1.5, dt=0.25, **TIGHT)
    a = n / inertia
    strikes = (2.0 - np.sqrt(4.0 - 2.0 * a * 0.777)) / a
    assert [event.kind for event in result.events] == ["impact"]
    assert result.events[0].t == pytest.approx(strikes, rel=0, abs=1e-12)
    expected = 0.777 - 0.5 * a * (1.5 - strikes) ** 2
    assert result.quantity("axle.angle").values[-1] == pytest.approx(expected, abs=1e-12)


def test_gaps_of_a_hinge_are_those_of_its_turns_between_reports():
    """Of a hinge that turns at 14 rad/s between -4 and 4, some three times from end to end."""
    scene = hinge(lower=-4.0, upper=4.0, e=1.0)
    scene.bodies["wheel"].w = (0.0, 0.0, 14.0)
    result = dap.simulate(scene, t_end=2.0, dt=0.2, **TIGHT)
    angle = result.quantity("axle.angle").values
    for side, sign in (("lower", 1.0), ("upper", -1.0)):
        gap = result.contact(f"axle_{side}").gap
        np.testing.assert_allclose(gap, 4.0 + sign * angle, rtol=0, atol=1e-11)


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams"])
def test_a_slider_that_sticks_at_its_stop_swings_with_its_arm(integrator):
    """Friction and stop hold the same motion; from the touch on it is that of one body.

    scipy has the arm from the state at the touch on. Slip by the error of a stage cut steps to
    some 1e-6 s before: 300 000 of them.
    """
    scene = dap.Scene(name="a slider at its stop")
    scene.add_force("weight", "g")
    scene.add_body("arm", mass=3.0, Jp=[0.5, 0.4, 0.3], w=[0.0, 1.0, 0.0])
    scene.add_body("slider", mass=1.0, Jp=[0.1, 0.15, 0.2], w=[0.0, 1.0, 0.0])
    scene.add_vector("u", "arm", [np.cos(0.5), 0.0, -np.sin(0.5)])
    axle = {"P_i": "arm.O", "P_j": "ground.O", "a_i": "arm.y", "a_j": "ground.y"}
    scene.add_joint("rev", "axle", **axle)
    scene.add_force("rot_sda", "spring", joint="axle", k=30.0)
    scene.add_joint("tran", "guide", P_i="slider.O", P_j="arm.O", a_j="u", upper=0.05)
    scene.add_force("tran_friction", "rub", joint="guide", f_c=1.0, f_s=1.2)
    result = dap.simulate(scene, t_end=1.0, dt=0.05, rtol=1e-8, integrator=integrator)
    touch = next(e for e in result.events if e.kind == "touch")
    assert (result.events[-1].t, result.events[-1].kind) == (touch.t, "stick")
    assert result.stats.steps < 500

    def arm(t, y):  # 0.4 + 0.15 + 1 * 0.05^2 kg m^2
        return [y[1], (-30.0 * y[0] + 9.81 * 0.05 * np.cos(0.5 + y[0])) / 0.5525]

    impact = next(e for e in result.events if e.kind == "impact")
    angle, rate = 2.0 * np.arctan2(impact.u_after[5], impact.u_after[3]), impact.u_after[18]
    exact = solve_ivp(arm, (touch.t, 1.0), [angle, rate], rtol=1e-12, atol=1e-12).y[1, -1]
    assert abs(result.w[-1, 0, 1] - exact) < 1e-7


def double_arm():
    """Two arms that swing from a pin, and a slider on the outer one, without a joint."""
    scene = dap.Scene(name="a double arm")
    scene.add_force("weight", "g")
    scene.add_body("inner", mass=3.0, Jp=[0.5, 0.4, 0.3], r=[0.5, 0.0, 0.0], w=[0.0, 3.0, 0.0])
    scene.add_body("outer", mass=2.0, Jp=[0.2, 0.3, 0.25], r=[1.5, 0.0, 0.0])
    scene.add_body("slider", mass=1.0, Jp=[0.1, 0.15, 0.2], r=[1.5, 0.0, 0.0])
    scene.add_point("pin", "inner", [-0.5, 0.0, 0.0])
    scene.add_point("elbow", "inner", [0.5, 0.0, 0.0])
    scene.add_point("end", "outer", [-0.5, 0.0, 0.0])
    scene.add_joint("rev", "axle", P_i="pin", P_j="ground.O", a_i="inner.y", a_j="ground.y")
    scene.add_joint("rev", "hinge", P_i="end", P_j="elbow", a_i="outer.y", a_j="inner.y")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "radau"])
def test_what_stop_and_friction_hold_takes_usual_steps(integrator):
    """A slider on a double arm; from the touch on it swings as one that is welded there.

    Rates of what ends modes, at states off the constraints, told of slip that is none: 6942 steps
    of dop853, 1339 of radau.
    """
    scene = double_arm()
    scene.add_vector("u", "outer", [np.cos(0.4), 0.0, np.sin(0.4)])
    scene.add_joint("tran", "guide", P_i="slider.O", P_j="outer.O", a_j="u", upper=0.05)
    scene.add_force("tran_friction", "rub", joint="guide", f_c=1.0, f_s=1.2)
    result = dap.simulate(scene, t_end=1.0, dt=0.5, rtol=1e-8, integrator=integrator)
    impact, touch, stick = result.events
    assert (impact.kind, touch.kind, stick.kind) == ("impact", "touch", "stick")
    assert result.stats.steps < 150

    welded, u = double_arm(), np.array(impact.u_after)
    for k, body in enumerate(welded.bodies.values()):
        body.r, body.p = u[7 * k : 7 * k + 3], u[7 * k + 3 : 7 * k + 7]
        body.r_dot, body.w = u[21 + 6 * k : 24 + 6 * k], u[24 + 6 * k : 27 + 6 * k]
    welded.add_joint("weld", "held", body_i="slider", body_j="outer")
    exact = dap.simulate(welded, t_end=1.0 - touch.t, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(result.r[-1], exact.r[-1], rtol=0, atol=1e-6)
