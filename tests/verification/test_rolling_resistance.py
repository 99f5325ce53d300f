"""What resists rolling and spinning, beside closed forms of a solid ball.

Accelerations are constant, which steps follow to rounding; only where motion ends within a step is
it off, by a part of a h^2. Events locate where it ends.
"""

import numpy as np
import pytest
from fuzz.contacts import LEGS, scene_on_legs
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.interface import Contact, Point, Vector, number, point, vector
from dap3d_core.kernels import dot, scale, sub
from dap3d_core.testing import check_type, checks_for

G, R, M = 9.81, 0.1, 2.0
I = 0.4 * M * R * R
#: Inertia of rolling over m R^2.
ROLLS = 1.4


def ball(declared, angle=0.0, v=0.0, w=(0.0, 0.0, 0.0), **material):
    """A solid ball on a plane that falls off at an angle along x, in the axes of the plane."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=M, Jp=[I] * 3, r=[0.0, 0.0, R], r_dot=[v, 0.0, 0.0], w=w)
    scene.add_material("felt", mu=0.8, **material)
    if declared:
        scene.add_contact("ball_plane", P_i="ball.O", radius=R, material="felt")
    else:
        scene.add_shape("sphere", body="ball", radius=R, collides=True)
        scene.add_shape("plane", body="ground", collides=True)
        scene.add_collisions(material="felt")
    scene.add_force("weight", "gravity", gravity=G, wgt=[np.sin(angle), 0.0, -np.cos(angle)])
    return scene


@pytest.mark.parametrize("declared", [False, True])
def test_a_ball_that_rolls_slows_down_evenly_and_stops(declared):
    v, mu_roll, h = 1.0, 0.01, 1e-3
    a = G * mu_roll / (ROLLS * R)
    result = dap.simulate(ball(declared, v=v, w=[0.0, v / R, 0.0], mu_roll=mu_roll),
                          t_end=2.0, dt=0.1, contact_step=h)  # fmt: skip
    t = np.minimum(result.t, v / a)
    x = v * t - 0.5 * a * t**2
    assert result.r[:, 0, 0] == pytest.approx(x, abs=a * h**2)
    assert abs(result.rd[-1, 0, 0]) < 1e-12
    early = result.t < 1.0
    assert result.r[early, 0, 0] == pytest.approx(x[early], abs=1e-13)


@pytest.mark.parametrize("part", [0.95, 1.3])
@pytest.mark.parametrize("declared", [False, True])
def test_a_ball_rolls_down_slopes_beyond_a_limit(declared, part):
    mu_roll = 0.02
    angle = np.arctan(part * mu_roll / R)
    result = dap.simulate(ball(declared, angle, mu_roll=mu_roll), t_end=1.0, dt=0.1,
                          contact_step=2e-3)  # fmt: skip
    a = max(G * np.sin(angle) - G * np.cos(angle) * mu_roll / R, 0.0) / ROLLS
    assert result.r[:, 0, 0] == pytest.approx(0.5 * a * result.t**2, abs=1e-14)


@pytest.mark.parametrize("declared", [False, True])
def test_a_ball_that_spins_stops_in_its_time(declared):
    mu_spin, w = 0.002, 20.0
    a = mu_spin * M * G / I
    result = dap.simulate(ball(declared, w=[0.0, 0.0, w], mu_spin=mu_spin), t_end=0.6, dt=0.05,
                          contact_step=1e-3)  # fmt: skip
    assert result.w[:, 0, 2] == pytest.approx(np.maximum(w - a * result.t, 0.0), abs=1e-11)


def by_events(scene, t_end, **settings):
    """A run whose instants are located."""
    tight = {"rtol": 1e-11, "atol": 1e-13, "dt": 0.1, "contact": "events"}
    return dap.simulate(scene, t_end=t_end, **(tight | settings))


def test_work_of_an_impact_is_what_it_takes_of_kinetic_energy():
    """With the moments that resist: friction alone gives energy, as they turn the ball back."""
    scene = ball(True, v=-0.8, w=[5.0, -8.0, -9.0], mu_roll=0.02, mu_spin=0.001, e=1.0)
    scene.bodies["ball"].r_dot = (-0.8, -0.6, -2.0)
    impact = next(e for e in by_events(scene, 0.1).events if e.kind == "impact")
    v, w = (np.array([u[7:10], u[10:13]]) for u in (impact.u, impact.u_after))
    before, after = (0.5 * (M * x[0] @ x[0] + I * x[1] @ x[1]) for x in (v, w))
    assert impact.work == pytest.approx(after - before, rel=1e-12)
    assert impact.work < 0.0


def test_what_hardly_spins_in_the_air_spins_on():
    """Rates as slow are stopped where something presses: not at a contact that is open."""
    scene = ball(True, v=0.0, mu_spin=0.001, e=0.5)
    scene.bodies["ball"].r = (0.0, 0.0, R + 0.01)
    scene.add_body("other", mass=M, Jp=[I] * 3, r=[5.0, 0.0, 5.0], w=[0.0, 0.0, 1e-10])
    scene.add_contact("ball_plane", P_i="other.O", radius=R, material="felt")
    result = by_events(scene, 0.2)
    assert any(event.kind == "impact" for event in result.events)
    assert np.all(result.w[:, 1, 2] == 1e-10)


def instants(result, name):
    """Where one sticks, by its name."""
    return [event.t for event in result.events if (event.kind, event.name) == ("stick", name)]


@pytest.mark.parametrize("settings", [{}, {"method": "joint"}, {"integrator": "radau"}])
def test_events_locate_where_a_ball_stops_that_slides_at_first(settings):
    """It slides by mu g, turned by (mu R - mu_roll) g, until it rolls; that ends at rest."""
    v, mu, mu_roll = 2.0, 0.8, 0.01
    scene = ball(True, v=v, mu_roll=mu_roll)
    name = next(iter(scene.contacts))
    turning = R * (mu * R - mu_roll) * G * M / I
    rolls = v / (mu * G + turning)
    a = G * mu_roll / (ROLLS * R)
    speed = v - mu * G * rolls
    result = by_events(scene, 3.0, **settings)
    assert instants(result, name) == pytest.approx([rolls], abs=1e-9)
    assert instants(result, f"{name}_roll") == pytest.approx([rolls + speed / a], abs=1e-9)
    x = v * rolls - 0.5 * mu * G * rolls**2 + 0.5 * speed**2 / a
    assert result.r[-1, 0, 0] == pytest.approx(x, abs=1e-9)
    assert np.abs(result.rd[-1]).max() < 1e-15
    assert result.ledger["energy"].ok


@pytest.mark.parametrize("part", [0.999, 1.001])
def test_events_hold_a_ball_up_to_the_limit_of_a_slope(part):
    mu_roll = 0.003
    angle = np.arctan(part * mu_roll / R)
    result = by_events(ball(True, angle, mu_roll=mu_roll), 10.0)
    a = max(G * np.sin(angle) - G * np.cos(angle) * mu_roll / R, 0.0) / ROLLS
    assert result.r[:, 0, 0] == pytest.approx(0.5 * a * result.t**2, abs=1e-13)


def test_auto_steps_where_several_contacts_of_a_body_resist():
    """The corners of a box share the moment; a wheel has one contact, however many wheels."""
    box = dap.Scene(name="box")
    box.add_body("box", mass=1.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.1])
    box.add_contact("box_plane", "c", body_i="box", size=[0.2] * 3, mu=0.5, mu_spin=0.01)
    box.add_force("weight", "gravity")
    notes = dap.simulate(box, t_end=0.01).notes
    assert any("by stepping" in note and "several contacts of one body" in note for note in notes)
    notes = dap.simulate(ball(True, mu_roll=0.01), t_end=0.01).notes
    assert not any("by stepping" in note for note in notes)


def test_slip_of_legs_that_jams_is_stopped_where_one_of_them_resists_rolling():
    """By an impulse without a collision, as without; energy is never gained."""
    scene = scene_on_legs(LEGS + 2)
    scene.contacts["c3"].fields["mu_roll"] = 0.001
    result = by_events(scene, 0.05, dt=1e-3)
    assert {event.name for event in result.events if event.kind == "impact"} >= {"c0", "c1", "c2"}
    gain = np.max(np.diff(result.energy.total))
    assert gain <= 1e-9 * np.max(result.energy.kinetic)


def test_events_locate_where_a_ball_ends_to_spin_while_it_rolls_on():
    mu_spin, w, v = 0.002, 20.0, 1.0
    scene = ball(True, v=v, w=[0.0, v / R, w], mu_spin=mu_spin, mu_roll=0.001)
    name = next(iter(scene.contacts))
    result = by_events(scene, 6.0)
    assert instants(result, f"{name}_spin") == pytest.approx([w * I / (mu_spin * M * G)], abs=1e-9)
    a = G * 0.001 / (ROLLS * R)
    assert result.r[-1, 0, 0] == pytest.approx(6.0 * v - 18.0 * a, abs=1e-9)


class Wheel(Contact):
    """A ball that resists rolling by a part of its radius."""

    keyword = "test-wheel"
    P_i: Point = point()
    P_j: Point = point("ground.O")
    a_j: Vector = vector("ground.z")
    radius: float = number(unit="m")
    part_lost: float = number(0.02)

    def gap(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def at(r_P_i, a_j, radius):
        return sub(r_P_i, scale(radius, a_j))

    def normal(a_j):
        return a_j

    def resist(radius, part_lost):
        return part_lost * radius, 0.0


class Downhill(Wheel):
    """Its length falls along x, and is zero at x = 0.5."""

    keyword = "test-downhill"

    def resist(r_P_i, part_lost):
        return part_lost * (1.0 - 2.0 * r_P_i[0]), 0.0


def scene_on_wheel(type_, v=1.0, **fields):
    """A solid ball of a type of contact of one's own that rolls along x."""
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=M, Jp=[I] * 3, r=[0, 0, R], r_dot=[v, 0, 0], w=[0, v / R, 0])
    scene.add_contact(type_.keyword, "c", P_i="wheel.O", radius=R, mu=0.8, **fields)
    scene.add_force("weight", "gravity", gravity=G)
    return scene


def wheel(type_, v=1.0, **fields):
    """The same, compiled."""
    return dap.compile(scene_on_wheel(type_, v, **fields), registry=registry_of(type_))


@pytest.mark.slow
@pytest.mark.parametrize(("contact", "limit"), [("events", 1e-9), ("stepping", 1e-6)])
def test_a_type_of_one_s_own_says_what_resists(contact, limit):
    """Of steps of 2 ms the last is off by a part of a h^2 / 2, 3e-7 m."""
    v, a = 1.0, G * 0.02 / ROLLS
    result = dap.simulate(wheel(Wheel, v), t_end=8.0, dt=0.1, contact=contact, contact_step=2e-3)
    assert result.r[-1, 0, 0] == pytest.approx(0.5 * v**2 / a, abs=limit)


@pytest.mark.slow
def test_check_plugin_takes_lengths_that_are_not_negative_alone():
    assert check_type(Wheel).ok
    words = "a negative length would drive"
    (check,) = [check for check in checks_for(Downhill) if check.name == "resist"]
    assert not check.run().ok
    assert "for rolling: what resists by" in str(check.run())
    assert words in str(check.run())


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["events", "stepping"])
def test_a_run_ends_where_a_length_becomes_negative(contact):
    """v dv/dx = -a (1 - 2 x), a = 0.02 g / (1.4 R), up to x = 0.5; steps look every 2 ms."""
    with pytest.raises(dap.SimulationError, match=r"contact c_roll would drive: .* is -"):
        dap.simulate(wheel(Wheel, part_lost=-0.1), t_end=1.0, contact=contact)
    with pytest.raises(dap.SimulationError, match="contact c_roll would drive") as error:
        dap.simulate(wheel(Downhill), t_end=1.0, contact=contact, contact_step=2e-3, dt=1e-3)
    x, h = error.value.result.r[-1, 0, 0], 1e-3 if contact == "events" else 3e-3
    assert 0.5 - h < x < 0.5 + 1e-3


def test_of_pairs_that_are_not_named_the_mean_counts_and_the_pair_where_it_is():
    a = G / (ROLLS * R)
    for with_, mu_roll in (({}, 0.004), ({"ice": {"mu_roll": 0.001}}, 0.001)):
        scene = ball(False, v=1.0, w=[0.0, 1.0 / R, 0.0], mu_roll=0.002, with_=with_)
        scene.add_material("ice", mu=0.8, mu_roll=0.008)
        scene.shapes["plane1"].fields["material"] = "ice"
        result = dap.simulate(scene, t_end=0.5, contact_step=1e-3)
        assert result.rd[-1, 0, 0] == pytest.approx(1.0 - 0.5 * a * mu_roll, abs=1e-10)


@pytest.mark.slow
def test_a_cart_on_wheels_slows_down_by_what_its_wheels_resist():
    """However the load is shared: mu_roll M g / R over M and the inertia of the wheels."""
    scene, v, mu_roll, whole = dap.Scene(name="cart"), 2.0, 0.004, 5.0 + 4 * M
    scene.add_body("cart", mass=5.0, Jp=[0.1] * 3, r=[0.3, 0.0, 0.3], r_dot=[v, 0.0, 0.0])
    for k in range(4):
        x, y = (-0.5, 0.5)[k % 2], (-0.3, 0.3)[k // 2]
        scene.add_body(
            f"wheel{k}", mass=M, Jp=[I] * 3, r=[x, y, R], r_dot=[v, 0, 0], w=[0, v / R, 0]
        )
        scene.add_shape("sphere", body=f"wheel{k}", radius=R, collides=True)
        scene.add_point(f"hub{k}", body="cart", sPp=[x - 0.3, y, R - 0.3])
        scene.add_joint(
            "rev", f"axle{k}", P_i=f"wheel{k}.O", P_j=f"hub{k}", a_i=f"wheel{k}.y", a_j="cart.y"
        )
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_material("rubber", mu=0.8, mu_roll=mu_roll)
    scene.add_collisions(material="rubber")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=1.0, dt=0.5, contact_step=2e-3)
    a = mu_roll * whole * G / R / (whole + 4 * I / R**2)
    assert result.rd[-1, 0, 0] == pytest.approx(v - a, abs=1e-11)
    taken = 0.5 * (whole + 4 * I / R**2) * (v**2 - (v - a) ** 2)
    assert -result.record.stepping["friction_work"] == pytest.approx(taken, rel=1e-9)
    assert all(entry.ok for entry in result.ledger.values())


def test_forty_balls_slow_down_as_one():
    """More than a hundred contacts: sweeps, and Newton's method on each that they leave."""
    scene, v, mu_roll, a = dap.Scene(name="forty"), 1.0, 0.01, G * 0.01 / (ROLLS * R)
    for k in range(40):
        r, turn = [0.0, 0.3 * k, R], [0.0, v / R, 0.0]
        scene.add_body(f"ball{k}", mass=M, Jp=[I] * 3, r=r, r_dot=[v, 0.0, 0.0], w=turn)
        scene.add_shape("sphere", body=f"ball{k}", radius=R, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_material("felt", mu=0.8, mu_roll=mu_roll, mu_spin=0.002)
    scene.add_collisions(material="felt")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.2, dt=0.1, contact_step=2e-3, rtol=1e-10)
    assert result.rd[-1, :, 0] == pytest.approx(
        np.full(40, v - 0.2 * a), abs=1e-9
    )  # rtol, 100 steps


def test_a_heap_comes_to_rest_where_its_balls_resist_rolling():
    """27 balls in a box, with more than a hundred contacts that press on each other."""
    scene, rng, radius = dap.Scene(name="heap"), np.random.default_rng(3), 0.05
    for k in range(27):
        x, y = 0.12 * (np.array([k % 3, k // 3 % 3]) - 1) + 1e-3 * rng.standard_normal(2)
        r = [x, y, 0.06 + 0.11 * (k // 9)]
        scene.add_body(f"ball{k}", mass=1.0, Jp=[0.4 * radius**2] * 3, r=r)
        scene.add_shape("sphere", body=f"ball{k}", radius=radius, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    for n in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]):
        at = [-0.25 * n[0], -0.25 * n[1], 0.0]
        scene.add_shape("plane", body="ground", at=at, normal=n, collides=True)
    scene.add_material("felt", mu=0.4, mu_roll=0.005, mu_spin=0.01)
    scene.add_collisions(material="felt")
    scene.add_force("weight")
    result = dap.simulate(scene, t_end=0.5, dt=0.1, contact_step=4e-3)
    assert result.record.stepping["largest_residual"] <= 1e-8  # rtol
    assert max(np.abs(result.rd[-1]).max(), np.abs(result.w[-1]).max()) < 1e-12
