"""Contacts on tables and belts that drivers move, and a top, against closed forms at rtol 1e-11."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support.plain import long_in_plain_python

import dap3d_core as dap

G = 9.81
TIGHT = {"rtol": 1e-11, "atol": 1e-13, "dt": 0.05}
#: m, s: as of the other closed forms of contacts.
TOLERANCE = 1e-9
METHODS = ("lsq", "joint")


def table(driver, along, function, start):
    """A table that a driver moves along, or turns about, an axis of ground."""
    scene = dap.Scene(name="table")
    scene.add_body("table", mass=5.0, Jp=[1.0] * 3, r=[0.0] * 3, **start)
    joint, on_table = {"drive-tran": ("tran", {}), "drive-rot": ("rev", {"a_i": "table.z"})}[driver]
    scene.add_joint(joint, "guide", P_i="table.O", P_j="ground.O", a_j=along, **on_table)
    scene.add_function(**function, name="path")
    scene.add_joint(driver, "drive", joint="guide", function="path")
    scene.add_force("weight", "g")
    return scene


def turntable():
    """A solid ball that rolls on a turntable, and its path: v_dot = (2/7) W k x v."""
    rate, radius, x, v = 2.0, 0.1, 0.5, np.array([0.1, 0.3])
    turn = {"type": "a", "coeff": [0.0, rate, 0.0]}
    scene = table("drive-rot", "ground.z", turn, {"w": [0.0, 0.0, rate]})
    slip = v - [0.0, rate * x]
    scene.add_body("ball", mass=0.4, Jp=[0.4 * 0.4 * radius**2] * 3, r=[x, 0.0, radius],
                   r_dot=[*v, 0.0], w=[-slip[1] / radius, slip[0] / radius, 5.0])  # fmt: skip
    scene.add_contact("ball_plane", "c", P_i="ball.O", radius=radius, P_j="table.O",
                      a_j="table.z", mu=0.8)  # fmt: skip

    def path(t):
        k = 2.0 / 7.0 * rate
        s, c = np.sin(k * t), 1.0 - np.cos(k * t)
        return np.stack([x + (v[0] * s - v[1] * c) / k, (v[0] * c + v[1] * s) / k], axis=1)

    return scene, path


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_rolls_round_a_turntable_at_two_sevenths_of_its_rate(method):
    """v_dot = (2/7) W k x v of a solid ball, whatever its spin (Weltner, 1979).

    A normal that is vertical but for rounding gives radau no axes that change with it: of 1600
    steps, as many as it refused, 89 were enough at 1e-8.
    """
    scene, path = turntable()
    result = dap.simulate(scene, t_end=3.0, method=method, **TIGHT)
    np.testing.assert_allclose(result.r[:, 1, :2], path(result.t), rtol=0.0, atol=TOLERANCE)
    implicit = dap.simulate(scene, t_end=3.0, method=method, integrator="radau", **TIGHT)
    np.testing.assert_allclose(implicit.r[:, 1, :2], path(result.t), rtol=0.0, atol=TOLERANCE)
    assert implicit.stats.rejected <= 0.1 * implicit.stats.steps


@pytest.mark.slow
def test_steps_on_a_turntable_are_of_second_order():
    """Half of the step leaves a quarter of the error, which is less than 1e-4 m at 2 ms."""
    scene, path = turntable()
    errors = []
    for h in (2e-3, 1e-3):
        stepped = {"contact": "stepping", "contact_step": h}
        result = dap.simulate(scene, t_end=3.0, dt=0.5, **stepped)
        errors.append(np.max(np.abs(result.r[:, 1, :2] - path(result.t))))
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


@long_in_plain_python
def test_slip_that_begins_with_a_run_is_not_a_step_late():
    """A point laid down on a turntable too fast for its friction, against scipy in the plane.

    By rows of the beginning the first step held it: mu g h too fast from then on, 7.6e-4 m at 4 ms.
    """
    rate, mu, x = 2.0, 0.1, 0.3

    def rates(t, y):
        slip = y[2:] - rate * np.array([-y[1], y[0]])
        size = np.linalg.norm(slip)  # none at first, when it begins outwards
        return [*y[2:], *(-mu * G * (slip / size if size > 0.0 else np.array([1.0, 0.0])))]

    path = solve_ivp(rates, (0.0, 0.2), [x, 0.0, 0.0, rate * x], rtol=1e-10, atol=1e-12).y[:2, -1]
    turn = {"type": "a", "coeff": [0.0, rate, 0.0]}
    scene = table("drive-rot", "ground.z", turn, {"w": [0.0, 0.0, rate]})
    scene.add_body("point", mass=1.0, Jp=[0.1] * 3, r=[x, 0.0, 0.0], r_dot=[0.0, rate * x, 0.0])
    scene.add_contact("ball_plane", "c", P_i="point.O", radius=0.0, P_j="table.O",
                      a_j="table.z", mu=mu)  # fmt: skip
    errors = []
    for h in (4e-3, 2e-3):
        result = dap.simulate(scene, t_end=0.2, dt=0.2, contact="stepping", contact_step=h)
        errors.append(np.max(np.abs(result.r[-1, 1, :2] - path)))
    assert errors[0] < 1e-5
    assert errors[1] < 0.4 * errors[0]  # nearly of second order, of first it is a half
    exact = dap.simulate(scene, t_end=0.2, **{**TIGHT, "dt": 0.2})
    np.testing.assert_allclose(exact.r[-1, 1, :2], path, rtol=0.0, atol=TOLERANCE)


@pytest.mark.parametrize("method", METHODS)
def test_a_box_laid_on_a_belt_slides_until_it_is_as_fast(method):
    mu, speed = 0.4, 1.0
    run = {"type": "a", "coeff": [0.0, speed, 0.0]}
    scene = table("drive-tran", "ground.x", run, {"r_dot": [speed, 0.0, 0.0]})
    scene.add_body("box", mass=2.0, Jp=[0.05] * 3, r=[0.0, 0.0, 0.1])
    scene.add_contact("box_plane", "c", body_i="box", size=[0.2] * 3, P_j="table.O",
                      a_j="table.z", mu=mu)  # fmt: skip
    result = dap.simulate(scene, t_end=1.0, method=method, **TIGHT)
    stick = speed / (mu * G)
    instants = [event.t for event in result.events if event.kind == "stick"]
    np.testing.assert_allclose(instants, [stick] * 4, rtol=0.0, atol=TOLERANCE)
    slid = np.minimum(result.t, stick)
    x = 0.5 * mu * G * slid**2 + speed * (result.t - slid)
    np.testing.assert_allclose(result.r[:, 1, 0], x, rtol=0.0, atol=TOLERANCE)


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_leaves_a_shaker_where_that_falls_faster_than_g(method):
    a, rate = 0.02, 30.0
    up = {"r_dot": [0.0, 0.0, a * rate]}
    shake = {"type": "harmonic", "amplitude": a, "frequency": rate}
    scene = table("drive-tran", "ground.z", shake, up)
    scene.add_body("ball", mass=2.0, Jp=[0.05] * 3, r=[0.0, 0.0, 0.1], **up)
    scene.add_contact("ball_plane", "c", P_i="ball.O", radius=0.1, P_j="table.O", a_j="table.z",
                      e=0.5)  # fmt: skip
    result = dap.simulate(scene, t_end=0.2, method=method, **TIGHT)
    lift = np.arcsin(G / (a * rate**2)) / rate
    z, v = a * np.sin(rate * lift), a * rate * np.cos(rate * lift)

    def gap(t):
        return z + v * (t - lift) - 0.5 * G * (t - lift) ** 2 - a * np.sin(rate * t)

    fall = brentq(gap, lift + 0.02, lift + 0.25, xtol=1e-15)
    instants = [event.t for event in result.events if event.kind in ("lift", "impact")]
    np.testing.assert_allclose(instants[:2], [lift, fall], rtol=0.0, atol=TOLERANCE)


@pytest.mark.parametrize("method", METHODS)
def test_jellett_s_constant_of_a_top_that_slides_and_rolls(method):
    """-L . q, q from the mass centre to the contact, whatever force acts there (Jellett, 1872)."""
    J, J_axis, radius, a, tilt = 8e-7, 7e-7, 0.02, 0.003, 0.1
    scene = dap.Scene(name="top")
    scene.add_body("top", mass=0.006, Jp=[J, J, J_axis], r=[0.0, 0.0, radius - a * np.cos(tilt)],
                   p=[np.cos(tilt / 2.0), np.sin(tilt / 2.0), 0.0, 0.0],
                   w=[0.0, -155.0 * np.sin(tilt), 155.0 * np.cos(tilt)])  # fmt: skip
    scene.add_point("centre", "top", [0.0, 0.0, a])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "c", P_i="centre", radius=radius, mu=0.3)
    result = dap.simulate(scene, t_end=0.5, method=method, **TIGHT)
    assert [event.kind for event in result.events] == ["touch", "stick"]
    axis = Rotation.from_quat(result.p[:, 0], scalar_first=True).apply([0.0, 0.0, 1.0])
    w = result.w[:, 0]
    L = J * w + (J_axis - J) * np.sum(w * axis, axis=1)[:, None] * axis
    constant = -np.sum(L * (a * axis - [0.0, 0.0, radius]), axis=1)
    np.testing.assert_allclose(constant, constant[0], rtol=TOLERANCE)


def test_joints_and_overlaps_are_corrected_together():
    """An arm slides on a plate that shakes: each apart undid the other, and left 1e-8 m and more.

    What is left is at most that which joints may move a contact by (MOVED_BY_JOINTS).
    """
    scene = dap.Scene(name="arm on a plate")
    scene.add_body("arm", mass=1.0, Jp=[0.02] * 3, r=[0.3, 0.0, 0.1])
    scene.add_point("hip", "ground", [0.0, 0.0, 0.1])
    scene.add_point("heel", "arm", [-0.3, 0.0, 0.0])
    scene.add_joint("rev", "pin", P_i="heel", P_j="hip", a_i="arm.y", a_j="ground.y")
    scene.add_body("plate", mass=1.0, Jp=[0.02] * 3, r=[0.5, 0.0, 0.0])
    scene.add_function("harmonic", "shake", amplitude=0.02, frequency=30.0)
    rail = {"P_i": "plate.O", "P_j": "ground.O", "a_j": "ground.z"}
    scene.add_joint("tran", "rail", **rail)
    scene.add_joint("drive-tran", "drive", **rail, function="shake")
    scene.add_shape("sphere", body="arm", radius=0.1, at=[0.2, 0.0, 0.0], collides=True)
    scene.add_shape("box", body="plate", size=[1.0, 1.0, 0.02], at=[0, 0, -0.01], collides=True)
    scene.add_material("surface", mu=0.5)
    scene.add_collisions(material="surface")
    scene.add_force("weight", "gravity", gravity=30.0)
    result = dap.simulate(scene, t_end=0.5, dt=0.1, contact_step=1e-3)
    assert len(result.contacts) > 0
    assert result.record.stepping["deepest"] < 1e-9


@pytest.mark.parametrize("start", [0.5, 0.7])
@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_no_report_on_a_break_point_pulls(integrator, start):
    """A table that falls faster than g from then on leaves its load; 7 * 0.1 is a bit above 0.7."""
    down = {"type": "step", "x_start": start, "x_end": start + 0.4, "f_end": -1.0}
    scene = table("drive-tran", "ground.z", down, {})
    scene.add_body("load", mass=2.0, Jp=[0.1] * 3, r=[0.0, 0.0, 0.1])
    scene.add_contact("ball_plane", "c", P_i="load.O", radius=0.1, P_j="table.O", a_j="table.z")
    result = dap.simulate(scene, t_end=start + 0.2, dt=0.1, integrator=integrator)
    before = result.t < start + 1e-12
    assert result.events[-1].kind == "lift"
    assert result.contact("c").normal_force == pytest.approx(np.where(before, 2.0 * G, 0.0))
    assert result.rdd[:, 1, 2] == pytest.approx(np.where(before, 0.0, -G), abs=1e-12)
