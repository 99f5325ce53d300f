"""Contacts of boxes and cylinders against closed forms, to 1e-9 at rtol 1e-12."""

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81
TOLERANCE = 1e-9
TIGHT = {"rtol": 1e-12, "atol": 1e-14}


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


def test_a_lying_cylinder_slides_then_rolls_with_two_thirds_of_its_speed():
    v, mu, radius = 3.0, 0.3, 0.1
    scene = dap.Scene(name="roller")
    Jp = [0.02, 0.5 * 2.0 * radius**2, 0.02]
    scene.add_body("roller", mass=2.0, Jp=Jp, r=[0.0, 0.0, radius], r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "g")
    shape = {"P_i": "roller.O", "a_i": "roller.y", "radius": radius, "length": 0.3}
    scene.add_contact("cylinder_plane", "floor", **shape, mu=mu)
    result = dap.simulate(scene, t_end=1.5, dt=0.1, **TIGHT)
    assert first(result, "stick").t == pytest.approx(v / (3.0 * mu * G), abs=TOLERANCE)
    assert result.rd[-1, 0] == pytest.approx([2.0 / 3.0 * v, 0.0, 0.0], abs=TOLERANCE)
    forces = result.contact("floor").normal_force
    assert forces[:, :2] == pytest.approx(G, abs=1e-9)  # the rims, one half each
    assert np.all(forces[:, 2:] == 0.0)
    assert result.ledger["energy"].value < TOLERANCE


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
    result = dap.simulate(scene, t_end=0.2, dt=0.05)
    moved = np.max(np.abs(result.r - result.r[0]))
    if part < 1.0:
        assert moved < 1e-14
        assert result.contact("floor").normal_force.sum(axis=1) == pytest.approx(mass * G)
    else:
        # the rate at which it begins: J of the rim w_dot = F h - m g a
        J = 0.05 + mass * (a**2 + h**2)
        angle = 0.5 * (F * h - mass * G * a) / J * 0.05**2
        assert result.p[1, 0, 2] * 2.0 == pytest.approx(angle, rel=1e-2)
