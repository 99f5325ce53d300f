"""Cables and belts against closed forms, drivers with inputs."""

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81
JP = [0.1, 0.1, 0.1]


def blocks(m_1, m_2, kind, **fields):
    """A block on one end of a cable, and one under a movable pulley, between vertical spans."""
    scene = dap.Scene(name="blocks")
    scene.add_body("one", mass=m_1, Jp=JP, r=[0.0, 0.0, -1.0])
    scene.add_body("two", mass=m_2, Jp=JP, r=[2.0, 0.0, -1.5])
    for name, x in (("A", 0.0), ("B", 2.0)):
        scene.add_point(name, body="ground", sPp=[x, 0.0, 0.0])
    add = scene.add_joint if kind == "joint" else scene.add_force
    add("cable", "rope", points=["one.O", "A", "B", "two.O", "B"], **fields)
    scene.add_force("weight", "g", gravity=G)
    return scene


def test_two_blocks_over_a_movable_pulley():
    """Closed form: T = 3 m1 m2 g / (4 m1 + m2), up a1 = T/m1 - g, a2 = 2 T/m2 - g; rounding."""
    m_1, m_2 = 3.0, 2.0
    result = dap.simulate(blocks(m_1, m_2, "joint"), t_end=0.2, dt=0.1)
    T = 3.0 * m_1 * m_2 * G / (4.0 * m_1 + m_2)
    np.testing.assert_allclose(result.quantity("rope.lambda").values.ravel(), T, rtol=1e-10)
    np.testing.assert_allclose(result.rdd[:, 0, 2], T / m_1 - G, rtol=1e-9)
    np.testing.assert_allclose(result.rdd[:, 1, 2], 2.0 * T / m_2 - G, rtol=1e-9)
    length = -result.r[:, 0, 2] + 2.0 - 2.0 * result.r[:, 1, 2]
    np.testing.assert_allclose(length, length[0], rtol=1e-12)
    energy = result.quantity("energy.total").values
    np.testing.assert_allclose(energy, energy[0], atol=1e-8)


def test_an_elastic_cable_swings_about_its_stretch():
    """One block on a vertical cable: z = z0 - (m g / k)(1 - cos(w t)); steps leave 1e-8."""
    scene = dap.Scene(name="swing")
    scene.add_body("one", mass=2.0, Jp=JP, r=[0.0, 0.0, -1.0])
    scene.add_point("A", body="ground", sPp=[0.0, 0.0, 0.0])
    scene.add_point("B", body="ground", sPp=[1.0, 0.0, 0.0])
    scene.add_force("cable", "rope", points=["one.O", "A", "B"], k=800.0)
    scene.add_force("weight", "g", gravity=G)
    result = dap.simulate(scene, t_end=1.0, dt=0.05, rtol=1e-9, atol=1e-11)
    sink = 2.0 * G / 800.0 * (1.0 - np.cos(20.0 * result.t))
    np.testing.assert_allclose(result.r[:, 0, 2], -1.0 - sink, atol=1e-7)
    np.testing.assert_allclose(result.quantity("rope.tension").values, 800.0 * sink, atol=1e-4)


def test_a_damped_cable_that_jerks_taut_is_the_same_by_each_integrator():
    """A hoist with a movable pulley: at each jerk the damping jumps, which is no slope of a law."""
    scene = dap.Scene(name="hoist")
    for name, mass, x in (("pulley", 3.0, 0.0), ("load", 1.0, 2.0)):
        scene.add_body(name, mass=mass, Jp=(0.1, 0.1, 0.1), r=(x, 0.0, 0.0))
        scene.add_point(f"at_{name}", "ground", (x, 0.0, 0.0))
        scene.add_point(f"over_{name}", "ground", (x, 0.0, 2.0))
        scene.add_joint("tran", name, P_i=f"{name}.O", P_j=f"at_{name}", a_j="ground.z")
    scene.add_point("beside", "ground", (0.0, 0.0, 2.0001))
    path = ["over_pulley", "pulley.O", "beside", "over_load", "load.O"]
    scene.add_force("cable", "rope", points=path, length=8.3, k=1e5, c=50.0)
    scene.add_force("weight")
    settings = {"t_end": 0.7, "dt": 0.1}
    exact = dap.simulate(scene, rtol=1e-11, atol=1e-13, **settings)
    result = dap.simulate(scene, method="joint", integrator="radau", **settings)
    assert len(exact.events) == 10
    np.testing.assert_allclose(result.r, exact.r, rtol=0.0, atol=1e-5)
    assert result.ledger["energy"].ok


def test_a_slack_cable_does_not_push():
    """Thrown up on a slack cable a block moves freely until it is taut."""
    scene = dap.Scene(name="thrown")
    scene.add_body("one", mass=2.0, Jp=JP, r=[0.0, 0.0, -1.0], r_dot=[0.0, 0.0, 2.0])
    scene.add_force("cable", "rope", points=["one.O", "ground.O"], k=800.0, c=5.0)
    scene.add_force("weight", "g", gravity=G)
    result = dap.simulate(scene, t_end=0.3, dt=0.1)
    z = -1.0 + 2.0 * result.t - 0.5 * G * result.t**2
    np.testing.assert_allclose(result.r[:, 0, 2], z, atol=1e-9)


def test_a_winch_with_a_function_and_an_input():
    """Both lower the block at 0.1 m/s, with the tension of its weight."""
    for fields in ({"function": "f"}, {"input": "winch"}):
        scene = dap.Scene(name="winch")
        scene.add_body("one", mass=2.0, Jp=JP, r=[0.0, 0.0, -1.0], r_dot=[0.0, 0.0, -0.1])
        if "input" in fields:
            scene.add_input("winch", value=0.1)
        else:
            scene.add_function("a", "f", coeff=[0.0, 0.1, 0.0])
        scene.add_joint("cable", "rope", points=["one.O", "ground.O"], **fields)
        scene.add_force("weight", "g", gravity=G)
        result = dap.simulate(scene, t_end=0.5, dt=0.25)
        np.testing.assert_allclose(result.r[:, 0, 2], -1.0 - 0.1 * result.t, atol=1e-9)
        np.testing.assert_allclose(
            result.quantity("rope.lambda").values.ravel(), 2.0 * G, rtol=1e-9
        )


def pulleys_at(places, inertias):
    """Pulleys a, b, ... on hinges of ground, by their moments about z."""
    scene = dap.Scene(name="belt")
    for name, (x, y), J in zip("abcd", places, inertias, strict=False):
        scene.add_body(name, mass=1.0, Jp=[0.1, 0.1, J], r=[x, y, 0.0])
        scene.add_point(f"{name}_pin", body="ground", sPp=[x, y, 0.0])
        pins = {"P_i": f"{name}.O", "P_j": f"{name}_pin"}
        scene.add_joint("rev", f"{name}_axis", **pins, a_i=f"{name}.z", a_j="ground.z")
    return scene


def belt(crossed, by_joints=False):
    scene = pulleys_at([(0.0, 0.0), (1.0, 0.0)], [0.02, 0.05])
    pulleys = {"points": ["a.O", "b.O"], "radii": [0.1, 0.25], "axis_i": "ground.z"}
    if by_joints:
        pulleys = {"joints": ["a_axis", "b_axis"], "radii": [0.1, 0.25]}
    springs = {"k": 1e5, "c": 800.0, "pretension": 300.0}
    scene.add_force("belt", "belt", **pulleys, **springs, crossed=crossed)
    scene.add_force("np", "motor", body_i="a", np=[0.0, 0.0, 2.0])
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(("crossed", "by_joints"), [(False, False), (True, False), (False, True)])
def test_a_belt_carries_a_moment(crossed, by_joints):
    """Steady acceleration: the rigid ratio, T_tight - T_slack = moment / r, and bearing loads.
    The vibration of the belt decays with c/m of some 1e5 1/s; 1e-6 is far above what is left."""
    r_a, r_b, J_a, J_b, M, T_0 = 0.1, 0.25, 0.02, 0.05, 2.0, 300.0
    result = dap.simulate(belt(crossed, by_joints), t_end=0.5, dt=0.25, integrator="radau")
    ratio = (-1.0 if crossed else 1.0) * r_a / r_b
    alpha = M / (J_a + J_b * ratio**2)
    np.testing.assert_allclose(result.wd[-1, 0, 2], alpha, rtol=1e-6)
    np.testing.assert_allclose(result.wd[-1, 1, 2], ratio * alpha, rtol=1e-6)
    difference = (M - J_a * alpha) / r_a
    T = result.quantity("belt.tension").values[-1]
    np.testing.assert_allclose(T[1] - T[0], difference, rtol=1e-5)
    np.testing.assert_allclose(np.sum(T), 2.0 * T_0, rtol=1e-5)
    np.testing.assert_allclose(result.quantity("belt.tension.2").values[-1], T[1])
    sine = (r_a - (-r_b if crossed else r_b)) / 1.0
    along = 2.0 * T_0 * np.sqrt(1.0 - sine**2)  # the mean of both spans is the pretension
    load = result.reaction("a_axis")["i"].force[-1]
    np.testing.assert_allclose(-load[0], along, rtol=1e-5)
    np.testing.assert_allclose(abs(load[1]), difference * abs(sine), rtol=1e-5)


RIGID = {
    "open": ([(0.0, 0.0), (1.0, 0.0)], [0.1, 0.25], {}),
    "crossed": ([(0.0, 0.0), (1.0, 0.0)], [0.1, 0.25], {"crossed": True}),
    "three": ([(0.0, 0.0), (1.0, 0.0), (0.4, 0.9)], [0.1, 0.25, 0.15], {}),
    "idler": ([(0.0, 0.0), (0.5, 0.1), (1.0, 0.0), (0.5, 0.6)], [0.1, -0.05, 0.25, 0.1], {}),
}


def rigid_belt(places, radii, fields, moment):
    """Pulleys on hinges of ground, the last one driven by a moment."""
    scene = pulleys_at(places, [2.0 * rho * rho for rho in radii])
    names = list(scene.bodies)
    scene.add_joint("belt", "belt", joints=[f"{n}_axis" for n in names], radii=radii, **fields)
    scene.add_force("np", "drive", body_i=names[-1], np=[0.0, 0.0, moment])
    return scene


def tangents(places, radii):
    """Directions of spans by angles: a span to the right of the line of centres, turned by asin."""
    found = []
    for k, start in enumerate(places):
        after = (k + 1) % len(places)
        dx, dy = np.subtract(places[after], start)
        turn = np.arctan2(dy, dx) + np.arcsin((radii[k] - radii[after]) / np.hypot(dx, dy))
        found.append(np.array([np.cos(turn), np.sin(turn)]))
    return found


@pytest.mark.parametrize("name", RIGID)
def test_a_rigid_belt_couples_speeds_and_loads_bearings(name):
    """Closed forms: rho w is one speed; M = J w_dot + rho (T_out - T_in); loads are tensions.
    The rows are kept at each step, so that speeds after 10 s, of some 1e3 rad/s, are in ratio to
    rounding; multipliers have that of the solution of the equations."""
    places, radii, fields = RIGID[name]
    moment = 0.5 if radii[-1] > 0.0 and not fields else -0.5
    result = dap.simulate(rigid_belt(places, radii, fields, moment), t_end=10.0, dt=1.0)
    rho = np.array([radii[0], -radii[1]] if fields else radii)
    speed = result.w[:, :, 2] * rho
    np.testing.assert_allclose(speed, np.repeat(speed[:, :1], len(rho), axis=1), rtol=1e-9)
    inertia = 2.0 * rho * rho
    belt_dot = moment / rho[-1] / np.sum(inertia / rho**2)
    np.testing.assert_allclose(speed[:, 0], belt_dot * result.t, rtol=1e-8, atol=1e-12)
    T = np.append(result.quantity("belt.lambda").values.reshape(len(result.t), -1)[-1], 0.0)
    assert np.all(T >= 0.0)
    assert not [note for note in result.notes if "push" in note]
    M = np.zeros(len(rho))
    M[-1] = moment
    np.testing.assert_allclose(M + rho * (T - np.roll(T, 1)), inertia * belt_dot / rho, atol=1e-9)
    e = tangents(places, rho)
    for k, body in enumerate("abcd"[: len(rho)]):
        pull = T[k] * e[k] - T[k - 1] * e[k - 1]
        load = result.reaction(f"{body}_axis")["i"].force[-1, :2]
        np.testing.assert_allclose(load, -pull, atol=1e-8)


def test_a_rigid_belt_on_a_carrier():
    """Willis: with the wheel a held, (w_b - w_c) r_b = -w_c r_a; the carrier is driven at 2 rad/s.
    Rows of velocities hold to rounding."""
    scene = dap.Scene(name="carrier")
    scene.add_body("carrier", mass=1.0, Jp=JP, r=[0.5, 0.0, 0.0], r_dot=[0.0, 1.0, 0.0],
                   w=[0.0, 0.0, 2.0])  # fmt: skip
    scene.add_body("b", mass=1.0, Jp=JP, r=[1.0, 0.0, 0.0], r_dot=[0.0, 2.0, 0.0],
                   w=[0.0, 0.0, 1.2])  # fmt: skip
    scene.add_point("end", body="carrier", sPp=[0.5, 0.0, 0.0])
    scene.add_point("hub", body="carrier", sPp=[-0.5, 0.0, 0.0])
    axes = {"a_j": "carrier.z"}
    scene.add_joint("rev", "arm", P_i="hub", P_j="ground.O", a_i="carrier.z", a_j="ground.z")
    scene.add_joint("rev", "b_axis", P_i="b.O", P_j="end", a_i="b.z", **axes)
    pulleys = {"points": ["ground.O", "b.O"], "radii": [0.1, 0.25], "axis_i": "carrier.z"}
    scene.add_joint("belt", "belt", **pulleys)
    result = dap.simulate(scene, t_end=2.0, dt=0.5)
    np.testing.assert_allclose(result.w[:, 0, 2], 2.0, rtol=1e-9)
    np.testing.assert_allclose(result.w[:, 1, 2], 2.0 * (1.0 - 0.1 / 0.25), rtol=1e-9)


def test_a_rigid_belt_says_which_span_is_slack():
    """A moment the other way round tightens the span that is taken to be slack."""
    places, radii, fields = RIGID["open"]
    result = dap.simulate(rigid_belt(places, radii, fields, -0.5), t_end=0.1, dt=0.1)
    assert any("this span would have to push" in note for note in result.notes)


def test_two_pulleys_of_a_belt_on_one_body_are_refused():
    scene = rigid_belt(*RIGID["open"], 0.5)
    scene.joints["belt"].fields = {
        "points": ("a.O", "b.O", "a_pin", "b_pin"), "radii": (0.1,) * 4, "axis_i": "ground.z"
    }  # fmt: skip
    with pytest.raises(dap.SceneError, match="two points on ground; each is to be on a body of"):
        dap.compile(scene)


def test_a_belt_stores_energy():
    """Pulleys swing against each other on a belt without damping, and a span becomes slack.
    About equal angles, k' = 2 k r^2 of both spans and I' = J_a J_b / (J_a + J_b): the first swing
    is w = sqrt(k' / I'); the energy is 2 T_0^2 / (2 k) at the start. Steps leave 1e-9 of it."""
    for pretension, spin in ((300.0, 1.0), (20.0, 5.0)):
        scene = belt(False)
        del scene.forces["motor"]
        scene.forces["belt"].fields |= {"c": 0.0, "pretension": pretension, "radii": [0.1, 0.1]}
        scene.bodies["a"].w = [0.0, 0.0, spin]
        result = dap.simulate(scene, t_end=0.1, dt=0.0005, rtol=1e-10, atol=1e-12)
        energy = result.quantity("energy.total").values
        start = 0.5 * 0.02 * spin**2 + pretension**2 / 1e5
        np.testing.assert_allclose(energy, start, rtol=1e-8)
        assert result.ledger["total energy"].ok
        if spin == 1.0:
            w = np.sqrt(2.0 * 1e5 * 0.01 * (1.0 / 0.02 + 1.0 / 0.05))
            common = 0.02 / 0.07
            swing = common + (1.0 - common) * np.cos(w * result.t)
            np.testing.assert_allclose(result.w[:, 0, 2], swing, atol=1e-6)
        else:
            x = result.quantity("belt.x").values
            assert np.min(pretension + 1e5 * x) < 0.0


@pytest.mark.parametrize("kind", ["rP", "drive-tran", "sph-sph", "drive-rot"])
def test_an_input_is_the_speed_of_a_driver(kind):
    """A body is moved at the input, 0.5, from the start on, by which its velocity is corrected."""
    scene = dap.Scene(name="driver")
    scene.add_body("one", mass=2.0, Jp=JP, r=[1.0, 0.0, 0.0])
    scene.add_input("speed", value=0.5)
    fields = {
        "rP": {"body_i": "one", "a_j": "ground.x", "length": 1.0},
        "drive-tran": {"body_i": "one", "body_j": "ground", "a_j": "ground.x"},
        "sph-sph": {"P_i": "ground.O", "P_j": "one.O"},
        "drive-rot": {"body_i": "one", "a_j": "ground.z"},
    }[kind]
    scene.add_joint(kind, "driver", **fields, input="speed")
    result = dap.simulate(scene, t_end=1.0, dt=0.5)
    moved = result.w[:, 0, 2] * result.t if kind == "drive-rot" else result.r[:, 0, 0] - 1.0
    np.testing.assert_allclose(moved, 0.5 * result.t, atol=1e-9)
