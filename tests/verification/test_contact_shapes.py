"""Contacts of boxes and cylinders against closed forms, to 1e-9 at rtol 1e-12."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import dap3d_core as dap

G = 9.81
TOLERANCE = 1e-9
#: Of many contacts `auto` takes an integrator of given steps.
TIGHT = {"rtol": 1e-12, "atol": 1e-14, "integrator": "dop853"}


def first(result, kind, name=""):
    """The first event of a kind."""
    return next(e for e in result.events if e.kind == kind and e.name.startswith(name))


def leaves_at(v, R):
    """Cosine of the angle at which what slides off a round edge leaves it."""
    return 2.0 / 3.0 * (1.0 + v**2 / (2.0 * G * R))


def test_a_ball_slides_over_the_edge_of_a_table():
    """Its centre turns about the edge, once it is past the face: both in one contact."""
    radius, v = 0.1, 0.3
    scene = dap.Scene(name="table")
    r = [-0.2, 0.0, radius]
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3, r=r, r_dot=[v, 0.0, 0.0])
    scene.add_point("table", "ground", [-0.5, 0.0, -0.05])
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "table", "radius": radius, "size": [1.0, 1.0, 0.1]}
    scene.add_contact("ball_box", "top", **ends)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, **TIGHT)
    lift = first(result, "lift")
    assert lift.u[2] / radius == pytest.approx(leaves_at(v, radius), abs=TOLERANCE)
    assert lift.u[0] ** 2 + lift.u[2] ** 2 == pytest.approx(radius**2, abs=1e-10)
    assert result.ledger["energy"].value < TOLERANCE


def test_a_ball_leaves_a_cylinder_at_two_thirds_of_the_height():
    big, small, v = 1.0, 0.1, 0.2
    scene = dap.Scene(name="log")
    R = big + small
    r_dot = [0.0, v, 0.0]
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3, r=[0.3, 0.0, R], r_dot=r_dot)
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "ground.O", "a_j": "ground.x"}
    sizes = {"radius_i": small, "radius_j": big, "length": 1.0}
    scene.add_contact("ball_cylinder", "log", **ends, **sizes)
    result = dap.simulate(scene, t_end=1.5, dt=0.1, **TIGHT)
    assert first(result, "lift").u[2] / R == pytest.approx(leaves_at(v, R), abs=TOLERANCE)


def test_a_ball_slides_over_the_rim_of_a_standing_cylinder():
    big, small, v = 0.5, 0.1, 0.3
    scene = dap.Scene(name="column")
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3, r=[0.2, 0.0, small], r_dot=[v, 0.0, 0.0])
    scene.add_point("column", "ground", [0.0, 0.0, -0.5])
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "column", "a_j": "ground.z"}
    sizes = {"radius_i": small, "radius_j": big, "length": 1.0}
    scene.add_contact("ball_cylinder", "top", **ends, **sizes)
    result = dap.simulate(scene, t_end=1.5, dt=0.1, **TIGHT)
    lift = first(result, "lift")
    assert lift.u[2] / small == pytest.approx(leaves_at(v, small), abs=TOLERANCE)


@pytest.mark.slow
def test_a_disk_rolls_on_its_rim_about_a_centre_at_rest():
    """Omega^2 sin(alpha) = g / (k a), J = k m a^2 about a diameter (Moffatt, Nature 404, 2000)."""
    a, alpha, k = 0.2, 0.4, 0.25
    rate = np.sqrt(G / (k * a * np.sin(alpha)))
    scene = dap.Scene(name="disk")
    # its plane turned about y by alpha: the lowest point is towards x, w along that radius
    p = [np.cos(alpha / 2.0), 0.0, np.sin(alpha / 2.0), 0.0]
    low = np.array([np.cos(alpha), 0.0, -np.sin(alpha)])
    Jp = [k * a**2, k * a**2, 2.0 * k * a**2]
    r = [0.0, 0.0, a * np.sin(alpha)]
    scene.add_body("disk", mass=1.0, Jp=Jp, r=r, p=p, w=rate * np.sin(alpha) * -low)
    scene.add_force("weight", "g")
    scene.add_point("C", "disk", [0.0, 0.0, 0.05])  # a cylinder whose lower rim is the disk
    shape = {"P_i": "C", "a_i": "disk.z", "radius": a, "length": 0.1}
    scene.add_contact("cylinder_plane", "floor", **shape, mu=2.0)
    result = dap.simulate(scene, t_end=3.0, dt=0.1, **TIGHT)
    contact = result.contact("floor")
    lowest = int(np.argmax(contact.normal_force[0]))
    assert set(contact.mode[:, lowest]) == {2}
    assert result.r[:, 0] == pytest.approx(np.tile(r, (len(result.t), 1)), abs=TOLERANCE)
    at = contact.at[:, lowest] - r
    turned = np.unwrap(np.arctan2(at[:, 1], at[:, 0]), period=2.0 * np.pi)
    wanted = rate * result.t
    away = np.angle(np.exp(1j * (turned - wanted)))
    back = np.angle(np.exp(1j * (turned + wanted)))
    assert min(np.abs(away).max(), np.abs(back).max()) < 1e-8


@pytest.mark.parametrize("part", [0.999, 1.001])
def test_a_standing_cylinder_tips_where_a_push_passes_its_rim(part):
    """A force F at the height h tips it where F h > m g a, towards a point of its cap."""
    a, h, mass = 0.1, 0.25, 2.0
    scene = dap.Scene(name="column")
    scene.add_body("column", mass=mass, Jp=[0.05, 0.05, 0.01], r=[0.0, 0.0, h])
    scene.add_force("weight", "g")
    F = part * mass * G * a / h
    scene.add_force("f", "push", body_i="column", f=[F, 0.0, 0.0])
    shape = {"P_i": "column.O", "a_i": "column.z", "radius": a, "length": 2.0 * h}
    scene.add_contact("cylinder_plane", "floor", **shape, mu=0.8)
    result = dap.simulate(scene, t_end=0.2, dt=0.05, integrator="dop853")
    moved = np.max(np.abs(result.r - result.r[0]))
    if part < 1.0:
        assert moved < 1e-14
        assert result.contact("floor").normal_force.sum(axis=1) == pytest.approx(mass * G)
    else:
        # the rate at which it begins: J of the rim w_dot = F h - m g a
        J = 0.05 + mass * (a**2 + h**2)
        angle = 0.5 * (F * h - mass * G * a) / J * 0.05**2
        assert result.p[1, 0, 2] * 2.0 == pytest.approx(angle, rel=1e-2)


@pytest.mark.parametrize("t_end", [0.17, 0.6])
def test_a_tilted_cylinder_falls_flat(t_end):
    """Without friction its rim slides away below it: energy gives the instant, and all is lost."""
    m, R, half, tilt = 3.0, 0.2, 0.25, 0.3
    across = m * (3.0 * R**2 + 4.0 * half**2) / 12.0

    def height(angle):
        return half * np.cos(angle) + R * np.sin(angle)

    def slowness(root):  # from the start, at angle = tilt - root^2: of the rate, 2 root / rate
        angle = tilt - root**2
        arm = R * np.cos(angle) - half * np.sin(angle)
        drop = height(tilt) - height(angle)
        return 2.0 * root * np.sqrt((across + m * arm**2) / (2.0 * m * G * drop))

    scene = dap.Scene(name="column")
    start = {"r": [0.0, 0.0, height(tilt)], "axis_angle": [np.cos(0.4), np.sin(0.4), 0.0, tilt]}
    scene.add_body("column", mass=m, Jp=[across, across, 0.5 * m * R**2], **start)
    scene.add_force("weight", "g")
    shape = {"P_i": "column.O", "a_i": "column.z", "radius": R, "length": 2.0 * half}
    scene.add_contact("cylinder_plane", "floor", **shape)
    result = dap.simulate(scene, t_end=t_end, dt=t_end / 4.0, **TIGHT)
    impacts = [event for event in result.events if event.kind == "impact"]
    falls = quad(slowness, 1e-12, np.sqrt(tilt), epsabs=1e-13)[0]
    assert [event.t for event in impacts] == pytest.approx([falls] * len(impacts), abs=TOLERANCE)
    assert sum(event.work for event in impacts) == pytest.approx(-m * G * (height(tilt) - half))
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, half], abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


def stack(offset=0.0, yaw=0.0, mu=0.5):
    """A cube of 1 kg on another, on a floor."""
    scene = dap.Scene(name="stack")
    scene.add_force("weight", "g")
    size = [0.1, 0.1, 0.1]
    for k in range(2):
        r, rpy = [offset * k, 0.0, 0.05 + 0.1 * k], [0.0, 0.0, yaw * k]
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.01 / 6.0] * 3, r=r, rpy=rpy)
    scene.add_contact("box_plane", "floor", P_i="b0.O", size=size, mu=mu)
    ends = {"P_i": "b1.O", "P_j": "b0.O", "size_i": size, "size_j": size}
    scene.add_contact("box_box", "upper", **ends, mu=mu)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(("offset", "yaw"), [(0.0, 0.0), (0.0499, 0.0), (0.01, 0.5)])
def test_a_box_rests_on_another_while_its_centre_is_above_it(offset, yaw):
    result = dap.simulate(stack(offset, yaw), t_end=100.0, dt=50.0, integrator="dop853")
    assert np.max(np.abs(result.r - result.r[0])) < 1e-14
    assert np.max(np.abs(result.p - result.p[0])) < 1e-14
    assert result.contact("upper").normal_force.sum(axis=1) == pytest.approx(G, rel=1e-9)


@pytest.mark.slow
def test_a_box_tips_over_the_edge_of_another_where_its_centre_is_beyond():
    """J about the edge w_dot = m g x, x = 1e-4 m: the angle x m g / (2 J) t^2 at first."""
    result = dap.simulate(stack(0.0501), t_end=0.02, dt=0.01, **TIGHT)
    J = 0.01 / 6.0 + 0.05**2 + 1e-4**2
    growth = np.sqrt(G * 0.05 / J)  # of the inverted pendulum, whose centre begins above the edge
    angle = 1e-4 / 0.05 * (np.cosh(growth * result.t[1:]) - 1.0)
    assert 2.0 * result.p[1:, 1, 2] == pytest.approx(angle, rel=1e-5)


@pytest.mark.slow
def test_a_box_slides_on_another_that_sticks():
    scene, mu, F = stack(mu=0.2), 0.2, 3.0
    scene.add_force("f", "push", body_i="b1", f=[F, 0.0, 0.0])
    result = dap.simulate(scene, t_end=0.15, dt=0.05, **TIGHT)
    assert result.r[:, 1, 0] == pytest.approx(0.5 * (F - mu * G) * result.t**2, abs=TOLERANCE)
    assert np.max(np.abs(result.r[:, 0] - result.r[0, 0])) < 1e-14
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.slow
def test_edges_of_crossed_boxes_bounce():
    e, h, drop = 0.5, 0.1, 0.2
    scene = dap.Scene(name="crossed")
    r = [0.0, 0.0, 2.0 * h * np.sqrt(2.0) + drop]
    scene.add_body("b", mass=1.0, Jp=[0.01, 0.02, 0.03], r=r, rpy=[np.pi / 4.0, 0.0, 0.0])
    scene.add_body("t", mass=1.0, Jp=[0.01, 0.02, 0.03], rpy=[0.0, np.pi / 4.0, 0.0])
    scene.add_joint("weld", "stand", body_i="t", body_j="ground")
    scene.add_force("weight", "g")
    sizes = {"size_i": [1.0, 2.0 * h, 2.0 * h], "size_j": [2.0 * h, 1.0, 2.0 * h]}
    scene.add_contact("box_box", "c", P_i="b.O", P_j="t.O", **sizes, e=e)
    result = dap.simulate(scene, t_end=0.25, dt=0.05, **TIGHT)
    impact = first(result, "impact")
    assert impact.t == pytest.approx(np.sqrt(2.0 * drop / G), abs=TOLERANCE)
    after = np.array(impact.u_after).reshape(2, -1)
    assert e * np.sqrt(2.0 * G * drop) == pytest.approx(np.max(after), abs=TOLERANCE)
    assert int(impact.name.split("#")[1]) > 16  # a pair of edges, not a corner


ROLL = {"mass": 2.0, "radius": 0.5, "axial": 0.3, "across": 0.2}


def wheel(r_dot=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0), centre=(0.0, 0.0, 0.0), **contact):
    """An upright disk whose axis is y, with its mass centre off its centre."""
    scene = dap.Scene(name="wheel")
    Jp = [ROLL["across"], ROLL["axial"], ROLL["across"]]
    r = [0.0, 0.0, ROLL["radius"] - centre[2]]
    scene.add_body("wheel", mass=ROLL["mass"], Jp=Jp, r=r, r_dot=r_dot, w=w)
    scene.add_force("weight", "g")
    scene.add_point("C", "wheel", centre)
    shape = {"P_i": "C", "a_i": "wheel.y", "radius": ROLL["radius"]}
    scene.add_contact("disk_plane", "floor", **shape, **contact)
    return scene


@pytest.mark.slow
def test_a_disk_rolls_as_the_joint_disk_does():
    """Leaning and turning, without slip: the same motion by other rows and another method."""
    lean = 1.1
    p = [np.cos(lean / 2.0), np.sin(lean / 2.0), 0.0, 0.0]
    eta = np.array([0.0, np.cos(lean), np.sin(lean)])
    level = eta - [0.0, 0.0, eta[2]]
    size = np.linalg.norm(level)
    spoke = ROLL["radius"] * (eta[2] / size * level - [0.0, 0.0, size])
    w = np.array([0.3, -1.0, 2.0])
    found = []
    for kind in ("joint", "contact"):
        scene = wheel(r_dot=list(-np.cross(w, spoke)), w=list(w), mu=10.0)
        scene.bodies["wheel"].p, scene.bodies["wheel"].r = p, [0.0, 0.0, ROLL["radius"] * size]
        if kind == "joint":
            del scene.contacts["floor"]
            scene.add_joint("disk", "floor", body_i="wheel", radius=ROLL["radius"])
        found.append(dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT))
    joint, contact = found
    assert contact.r == pytest.approx(joint.r, abs=TOLERANCE)
    assert contact.w == pytest.approx(joint.w, abs=TOLERANCE)
    assert contact.contact("floor").force[:, 0] == pytest.approx(joint.Lam, abs=1e-8)
    assert set(contact.contact("floor").mode[:, 0]) == {2}


def test_a_spinning_wheel_slides_until_it_rolls():
    """v = mu g t, w = w_0 - mu m g R / J t: it rolls where v = R w."""
    mu, w, R = 0.2, 20.0, ROLL["radius"]
    result = dap.simulate(wheel(w=(0.0, w, 0.0), mu=mu), t_end=4.0, dt=0.5, **TIGHT)
    t = R * w / (mu * G * (1.0 + ROLL["mass"] * R**2 / ROLL["axial"]))
    assert first(result, "stick").t == pytest.approx(t, abs=TOLERANCE)
    assert result.rd[-1, 0] == pytest.approx([mu * G * t, 0.0, 0.0], abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


def test_an_unbalanced_wheel_lifts_off():
    """Without friction its mass centre goes straight up and down: z = R - e cos(phi).

    Energy gives phi_dot^2 = F(phi), phi_ddot = F' / 2, and z_ddot; it lifts where that is -g. The
    instant is the integral of 1 / phi_dot.
    """
    m, J, R, e, w = ROLL["mass"], ROLL["axial"], ROLL["radius"], 0.2, 12.0

    def square(phi):
        energy = J * w**2 - 2.0 * m * G * e * (1.0 - np.cos(phi))
        return energy / (J + m * e**2 * np.sin(phi) ** 2)

    def load(phi):  # from below: phi = 0 is the lowest place of the mass centre
        h = 1e-5
        bent = (square(phi + h) - square(phi - h)) / (4.0 * h)
        return G + e * (np.cos(phi) * square(phi) + np.sin(phi) * bent)

    result = dap.simulate(wheel(w=(0.0, w, 0.0), centre=(0.0, 0.0, e)), t_end=1.0, dt=0.1, **TIGHT)
    lift = first(result, "lift")
    phi = brentq(load, 0.5, np.pi)
    assert lift.u[2] == pytest.approx(R - e * np.cos(phi), abs=TOLERANCE)
    t = quad(lambda x: 1.0 / np.sqrt(square(x)), 0.0, phi, epsabs=1e-13, epsrel=1e-13)[0]
    assert lift.t == pytest.approx(t, abs=TOLERANCE)


def test_a_coin_falls_flat_and_its_spin_ends():
    """It lands on all of its rim at once, and mu R times the load of its rim stops the spin.

    The impulse of the landing is the weight times the time of the fall, as if it had lain before:
    t = J w_0 / (mu m g R).
    """
    mu, w, R = 0.3, 4.0, ROLL["radius"]
    scene = wheel(w=(0.0, 0.0, w), mu=mu)
    coin = scene.bodies["wheel"]
    coin.p, coin.r = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0], [0.0, 0.0, 0.1]
    result = dap.simulate(scene, t_end=2.0, dt=0.1, **TIGHT)
    lands = np.sqrt(0.2 / G)
    assert first(result, "impact").t == pytest.approx(lands, abs=TOLERANCE)
    stops = ROLL["axial"] * w / (mu * ROLL["mass"] * G * R)
    assert first(result, "stick").t == pytest.approx(stops, abs=TOLERANCE)
    assert np.max(np.abs(result.w[-1])) < 1e-12
    assert result.ledger["energy"].value < TOLERANCE
