"""Controllers on an arm of six hinges against joint-space equations by SciPy, hold by hold."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.arm import GAINS, GOAL, JOINTS, NAMES, accelerations, arm_scene, torque

import dap3d_core as dap

ANGLES = [f"{joint}.angle" for joint in JOINTS]
RATES = [f"{joint}.angle_rate" for joint in JOINTS]
EVERY = 0.002
TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def goal(t):
    """The arm is to swing about its goal all the time."""
    return GOAL * (1.0 + 0.5 * np.sin(3.0 * t + np.arange(6)))


def follow(t, state):
    """PD control of each hinge."""
    q = np.array([state[name] for name in ANGLES])
    q_dot = np.array([state[name] for name in RATES])
    return dict(zip(NAMES, torque(q, q_dot) + GAINS[0] * (goal(t) - GOAL), strict=True))


@cache
def held_by_scipy(t_end, keep):
    """(k, 12) angles and rates at every ``keep``-th sample, each hold integrated by itself."""
    y, rows = np.zeros(12), [np.zeros(12)]
    for k in range(round(t_end / EVERY)):
        tau = torque(y[:6], y[6:]) + GAINS[0] * (goal(k * EVERY) - GOAL)

        def rates(t, y, tau=tau):
            return np.concatenate([y[6:], accelerations(y[:6], y[6:], tau)])

        solution = solve_ivp(rates, (0.0, EVERY), y, method="DOP853", first_step=EVERY, **TIGHT)
        y = solution.y[:, -1]
        if (k + 1) % keep == 0:
            rows.append(y)
    return np.array(rows)


def found(result):
    return np.stack([result.quantity(name).values for name in (*ANGLES, *RATES)], axis=1)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_an_arm_at_500_hz_for_5_s(method):
    """Angles to 1e-9 rad of some 1; an error of 1e-11 a step does not grow under PD control."""
    controllers = [dap.Controller(every=EVERY, update=follow)]
    result = dap.simulate(arm_scene(method), t_end=5.0, dt=0.1, controllers=controllers, **TIGHT)
    wanted = held_by_scipy(5.0, keep=50)
    scale = np.max(np.abs(wanted), axis=0)
    assert np.min(scale[:6]) > 0.4
    assert np.max(np.abs(found(result) - wanted) / np.maximum(1.0, scale)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_an_arm_for_a_moment(method):
    """The same over 20 ms, from rest, where accelerations are the largest."""
    controllers = [dap.Controller(every=EVERY, update=follow)]
    result = dap.simulate(arm_scene(method), t_end=0.02, dt=0.004, controllers=controllers, **TIGHT)
    wanted = held_by_scipy(0.02, keep=2)
    assert np.max(np.abs(found(result) - wanted) / np.maximum(1.0, np.abs(wanted))) < 1e-11


def test_linearised_inputs_are_those_of_the_joint_equations():
    """D of the accelerations: columns of the inverse mass matrix, seen at the last link."""
    scene = arm_scene()
    outputs = [f"link6.wd.{axis}" for axis in "xyz"]
    lin = dap.linearize(scene, inputs=NAMES, outputs=outputs)
    at_rest = accelerations(np.zeros(6), np.zeros(6), np.zeros(6))
    columns = [accelerations(np.zeros(6), np.zeros(6), unit) - at_rest for unit in np.eye(6)]
    axes = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
    assert lin.B.shape == (12, 6)
    assert pytest.approx((np.array(columns) @ axes).T, rel=1e-10, abs=1e-9) == lin.D


@pytest.mark.slow
def test_a_state_of_a_controlled_run_is_linearised_with_its_inputs():
    """The rates of the lower half of A x + B u: eigenvalues are those with the inputs held."""
    scene = arm_scene()
    controllers = [dap.Controller(every=0.01, update=follow)]
    result = dap.simulate(scene, t_end=0.2, dt=0.1, controllers=controllers, **TIGHT)
    held = arm_scene()
    for name in NAMES:
        held.inputs[name].value = float(result.quantity(name).values[-1])
    one = dap.linearize(scene, result, t=0.2, inputs=NAMES)
    two = dap.linearize(held, result.u[-1], t=0.2, inputs=NAMES)
    assert np.max(np.abs(two.B)) > 1.0
    assert pytest.approx(two.A, abs=1e-9 * np.max(np.abs(two.A))) == one.A
    assert pytest.approx(two.B, abs=1e-9 * np.max(np.abs(two.B))) == one.B
    with pytest.raises(Exception, match="no input, force or driver 'motor9'"):
        dap.linearize(scene, inputs=["motor9"])


def test_equilibrium_is_found_with_inputs_held():
    """A pendulum whose motor holds it where m g l sin(angle) is its moment."""
    scene = dap.Scene(name="held")
    scene.add_body("bob", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, -0.5))
    scene.add_point("pin", "bob", (0.0, 0.0, 0.5))
    scene.add_joint("rev", "hinge", P_i="pin", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    scene.add_input("motor", 3.0)
    scene.add_force("n", body_i="bob", n=(0.0, 1.0, 0.0), input="motor")
    equilibrium = dap.equilibrium(scene)
    angle = np.arcsin(3.0 / (2.0 * 9.81 * 0.5))
    assert abs(equilibrium.r[0, 0]) == pytest.approx(0.5 * np.sin(angle), abs=1e-9)
    assert equilibrium.stable


@pytest.mark.slow
def test_inputs_vary_in_sweeps():
    """As all that a scene holds: each point has its own, in batches as well."""
    scene = dap.Scene(name="pushed")
    scene.add_body("block", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_input("push", 0.5)
    scene.add_force("f", "force", body_i="block", f=(1.0, 0.0, 0.0), input="push")
    values, masses = np.linspace(0.0, 1.0, 30), np.linspace(1.0, 2.0, 30)
    outputs = ["block.r.x", "push"]
    data = dap.sweep(scene, {"inputs.push.value": values}, outputs=outputs, t_end=1.0)
    assert data["block.r.x"].values == pytest.approx(0.25 * values, abs=1e-14)
    assert data["push"].values.tolist() == values.tolist()
    data = dap.sweep(scene, {"bodies.block.mass": masses}, outputs=outputs, t_end=1.0)
    assert data["block.r.x"].values == pytest.approx(0.25 / masses, abs=1e-14)
    assert data["push"].values.tolist() == [0.5] * 30


def set_at(scene, t, t_end, values, by_steps):
    """Times and velocities of the last body of a run whose inputs are set once, and its events."""
    if by_steps:
        run = dap.start(scene)
        run.step(t)
        run.step(t_end - t, inputs=values)
        result = run.result()
    else:
        update = dap.Controller(every=t, update=lambda now, _: values if now > 0.5 * t else {})
        result = dap.simulate(scene, t_end=t_end, dt=t_end, controllers=[update])
    return result.rd[-1, -1], [event.kind for event in result.events]


@pytest.mark.parametrize("by_steps", [False, True])
def test_contacts_go_on_by_what_inputs_make_of_them(by_steps):
    """A pull above the weight lifts a ball, and a lift that goes down faster leaves it behind."""
    g, m = 9.81, 2.0
    pulled = dap.Scene(name="pulled")
    pulled.add_body("ball", mass=m, Jp=[0.02] * 3, r=[0.0, 0.0, 0.1])
    pulled.add_force("weight", "gravity", gravity=g)
    pulled.add_input("pull")
    pulled.add_force("f", "rope", body_i="ball", f=[0.5, 0.0, 1.0], input="pull")
    pulled.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3, e=0.2)
    v, kinds = set_at(pulled, 0.2, 0.5, {"pull": 30.0}, by_steps)
    assert v == pytest.approx([15.0 / m * 0.3, 0.0, (30.0 / m - g) * 0.3], abs=1e-7)
    assert kinds == ["touch", "lift"]

    scene, before = dap.Scene(name="lift"), 0.5
    for name, z in (("lift", 0.0), ("ball", 0.1)):
        start = {"r": [0.0, 0.0, z], "r_dot": [0.0, 0.0, before]}
        scene.add_body(name, mass=m, Jp=[0.02] * 3, **start)
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_input("speed", value=before)
    along = {"P_i": "lift.O", "P_j": "ground.O", "a_j": "ground.z"}
    scene.add_joint("tran", "rail", **along)
    scene.add_joint("drive-tran", "winch", **along, input="speed")
    floor = {"P_j": "lift.O", "a_j": "lift.z"}
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, **floor, e=0.5)
    v, kinds = set_at(scene, 0.5, 0.6, {"speed": -2.0}, by_steps)
    assert v[2] == pytest.approx(before - g * 0.1, abs=1e-9)
    assert kinds[-1] == "lift"
