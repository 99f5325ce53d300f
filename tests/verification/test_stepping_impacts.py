"""Impacts by stepping that travel through bodies that touch: against closed forms, and events."""

import numpy as np
import pytest
from support.plain import long_in_plain_python
from verification.test_contacts import TIGHT
from verification.test_stepping import G

import dap3d_core as dap

RADIUS = 0.1


def add_ball(scene, name, at, v=(0.0, 0.0, 0.0), mass=1.0, collides=True):
    """A ball."""
    scene.add_body(name, mass=mass, Jp=[0.004 * mass] * 3, r=at, r_dot=v)
    scene.add_shape("sphere", body=name, radius=RADIUS, collides=collides)


def declare(scene, one, other, **law):
    """Let two balls touch by a declared contact, of Newton's law."""
    scene.add_contact("ball_ball", f"{one}_{other}", P_i=f"{one}.O", P_j=f"{other}.O",
                      radius_i=RADIUS, radius_j=RADIUS, law="newton", **law)  # fmt: skip


def cradle(moving, e, masses=(1.0,) * 5, declared=False):
    """Balls in a row that touch; so many come from the left, at 1 m/s."""
    scene = dap.Scene(name="cradle")
    for k, mass in enumerate(masses):
        at = [2.0 * RADIUS * k - (0.05 if k < moving else 0.0), 0.0, 0.0]
        v = [1.0 if k < moving else 0.0, 0.0, 0.0]
        if declared:
            scene.add_body(f"b{k}", mass=mass, Jp=[0.004 * mass] * 3, r=at, r_dot=v)
        else:
            add_ball(scene, f"b{k}", at, v, mass)
    if declared:
        for k in range(len(masses) - 1):
            declare(scene, f"b{k}", f"b{k + 1}", e=e)
    else:
        scene.add_material("steel", e=e)
        scene.add_collisions(material="steel")
    return scene


def speeds(scene, contact="stepping", **settings):
    """Speeds of the balls of a row behind the impact."""
    result = dap.simulate(scene, t_end=0.1, dt=0.1, contact=contact, **settings)
    return result.rd[-1, :, 0]


@pytest.mark.parametrize("h", [1e-3, 7e-3])
@pytest.mark.parametrize("moving", [1, 2])
def test_as_many_balls_leave_a_cradle_that_touches_as_hit_it(moving, h):
    """Limit: rounding. By one impact of all, the first ball came back."""
    found = speeds(cradle(moving, 1.0), contact_step=h)
    assert found == pytest.approx([0.0] * (5 - moving) + [1.0] * moving, abs=1e-14)


@pytest.mark.parametrize(("moving", "e", "masses"), [
    (1, 0.8, (1.0,) * 5),
    (2, 0.8, (1.0,) * 5),
    (1, 1.0, (1.0, 3.0, 0.5, 2.0, 7.0)),
    (1, 0.6, (1.0, 3.0, 0.5, 2.0, 7.0)),
])  # fmt: skip
def test_speeds_of_a_cradle_are_those_of_events(moving, e, masses):
    """Limit: residuals of 1e-14 of some ten rounds; balls of a half weigh them twice."""
    exact = speeds(cradle(moving, e, masses, declared=True), contact="events")
    for declared in (False, True):
        found = speeds(cradle(moving, e, masses, declared), contact_step=2e-3)
        assert found == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(("e", "mu", "mu_roll"), [
    (0.8, 0.3, 0.0),
    (1.0, 1.0, 0.0),
    (0.6, 0.4, 0.01),
])  # fmt: skip
def test_rough_balls_that_spin_leave_an_impact_as_by_events(e, mu, mu_roll):
    """Friction and what resists rolling act in each round. Limit: residuals of some ten rounds.

    With friction once for all rounds speeds were off by 1e-2 m/s, by 0.4 where rolling is resisted.
    """
    rng, scene = np.random.default_rng(4), cradle(1, e, (1.0, 3.0, 0.5, 2.0), declared=True)
    for body in scene.bodies.values():
        body.w = 20.0 * rng.normal(size=3)
    for contact in scene.contacts.values():
        contact.fields |= {"mu": mu, "mu_roll": mu_roll, "mu_spin": 0.5 * mu_roll}
    exact, found = (
        dap.simulate(scene, t_end=0.06, dt=0.06, contact=contact, contact_step=h, **TIGHT)
        for contact, h in (("events", None), ("stepping", 2e-3))
    )
    assert abs(exact.rd[-1, :, 1:]).max() > 0.1
    assert found.rd[-1] == pytest.approx(exact.rd[-1], abs=1e-12)
    assert found.w[-1] == pytest.approx(exact.w[-1], abs=1e-11)


@pytest.mark.parametrize("mu", [0.0, 0.5])
@pytest.mark.parametrize("declared", [False, True])
def test_a_glancing_blow_is_that_of_where_balls_meet(mu, declared):
    """A ball at v = 2 m/s hits another out of line: of the second order in the step.

    Limit: v (v h / R)^2 / 8, as of a chord in place of an arc of one step. With normals of the
    start of the step speeds were off by 2e-2 m/s at 4 ms.
    """
    off = []
    for contact, h in (("events", None), ("stepping", 4e-3), ("stepping", 1e-3)):
        scene, collides = dap.Scene(name="glance"), not declared and contact != "events"
        add_ball(scene, "a", [-0.3, 0.05, 0.02], [2.0, 0.1, 0.0], collides=collides)
        add_ball(scene, "b", [0.0, 0.0, 0.0], mass=2.0, collides=collides)
        scene.bodies["a"].w = [3.0, 2.0, 20.0]
        if not collides:
            declare(scene, "a", "b", e=0.7, mu=mu)
        else:
            scene.add_material("ivory", e=0.7, mu=mu)
            scene.add_collisions(material="ivory")
        result = dap.simulate(scene, t_end=0.2, dt=0.2, contact=contact, contact_step=h, **TIGHT)
        off.append(np.concatenate([result.rd[-1], RADIUS * result.w[-1]]))
    for h, found in zip((4e-3, 1e-3), off[1:], strict=True):
        assert found == pytest.approx(off[0], abs=2.0 * (2.0 * h / RADIUS) ** 2 / 8.0)


def stack(contact, e, masses, t_end, h=None, e_floor=None):
    """A ball that falls 0.1 m onto one that rests on a floor."""
    scene = dap.Scene(name="stack")
    for name, mass, z in zip("ab", masses, (RADIUS, 3.0 * RADIUS + 0.1), strict=True):
        scene.add_body(name, mass=mass, Jp=[0.004 * mass] * 3, r=[0.0, 0.0, z])
    floor = e if e_floor is None else e_floor
    scene.add_contact("ball_plane", "floor", P_i="a.O", radius=RADIUS, e=floor, law="newton")
    declare(scene, "b", "a", e=e)
    scene.add_force("weight", "gravity")
    settings = {} if h is None else {"contact_step": h}
    return dap.simulate(scene, t_end=t_end, dt=0.02, contact=contact, **settings)


@long_in_plain_python
@pytest.mark.parametrize("masses", [(1.0, 1.0), (1.0, 3.0)])
def test_a_ball_that_falls_on_one_that_rests_comes_back_to_its_height(masses):
    """e = 1: what the lower one gets it has back from the floor at once, at any step.

    Limit: rounding of two impacts. By one impact of all it was off by 1e-3 m at 2 ms.
    """
    result = stack("stepping", 1.0, masses, 0.4, 2e-3)
    assert result.energy.total / result.energy.total[0] == pytest.approx(1.0, abs=1e-13)
    assert result.r[:, 0, 2] == pytest.approx(RADIUS, abs=1e-14)
    exact = stack("events", 1.0, masses, 0.4)
    assert result.r == pytest.approx(exact.r, abs=1e-12)
    assert result.rd[-1] == pytest.approx(exact.rd[-1], abs=1e-12)


@long_in_plain_python
def test_balls_that_both_rise_have_the_second_order():
    """A light one on a heavy one: both rise, and meet again; a quarter of the step, a tenth left.

    Where the lower one rises it has rested for a part of the step, and falls for the rest.
    """
    exact = stack("events", 1.0, (3.0, 1.0), 0.4)
    off = [abs(stack("stepping", 1.0, (3.0, 1.0), 0.4, h).r - exact.r).max() for h in (2e-3, 5e-4)]
    assert off[0] < 2e-5
    assert off[1] < 0.1 * off[0]


@long_in_plain_python
@pytest.mark.parametrize(("e", "e_floor", "masses"), [
    (0.5, 0.5, (1.0, 1.0)),
    (0.8, 0.0, (3.0, 1.0)),
    (0.0, 0.8, (1.0, 3.0)),
])  # fmt: skip
def test_balls_that_bounce_on_each_other_come_to_rest(e, e_floor, masses):
    """As by events, and stay: gaps and speeds are rounding; bounces are off by less than h^2 g."""
    h = 5e-4
    result = stack("stepping", e, masses, 2.0, h, e_floor)
    exact = stack("events", e, masses, 2.0, e_floor=e_floor)
    assert abs(result.r - exact.r).max() < 40.0 * h**2
    rest = result.t > 1.5
    assert abs(result.rd[rest]).max() < 1e-13
    assert abs(result.r[rest][:, :, 2] - [RADIUS, 3.0 * RADIUS]).max() < 1e-11


@long_in_plain_python
def test_a_rack_of_balls_keeps_energy_and_momentum():
    """Ten balls of unlike masses that touch each other, hit out of line, e = 1; limit: rounding."""
    scene, rng, masses = dap.Scene(name="rack"), np.random.default_rng(0), []
    for row in range(4):
        for k in range(row + 1):
            masses.append(float(rng.choice([0.7, 1.0, 2.0])))
            at = [RADIUS * np.sqrt(3.0) * row, RADIUS * (2.0 * k - row), 0.0]
            add_ball(scene, f"ball{row}{k}", at, mass=masses[-1])
    masses.append(1.0)
    add_ball(scene, "cue", [-3.0 * RADIUS, 0.2 * RADIUS, 0.0], [3.0, 0.0, 0.0])
    scene.add_material("ivory", e=1.0)
    scene.add_collisions(material="ivory")
    result = dap.simulate(scene, t_end=0.3, dt=0.1, contact_step=2e-3)
    mass = np.array(masses)[:, None]
    energy = (mass * result.rd**2).sum(axis=(1, 2))
    assert energy / energy[0] == pytest.approx(1.0, abs=1e-12)
    momentum = (mass * result.rd).sum(axis=1)
    assert momentum[-1] == pytest.approx([3.0, 0.0, 0.0], abs=1e-14)
    assert np.count_nonzero(np.linalg.norm(result.rd[-1], axis=1) > 0.01) >= 8


@long_in_plain_python
@pytest.mark.parametrize("declared", [False, True])
def test_pendulums_pass_an_impact_on(declared):
    """Five rods of 1 m on hinges, whose balls touch; the first falls from 0.3 rad, e = 1.

    The last rises as high, half a period of the pendulum later, by (1 + a^2 / 16 + ...) of it;
    limits: h^2, as of a pendulum by steps, and of those that rest what its speed is off by.
    """
    scene, angle, h = dap.Scene(name="pendulums"), 0.3, 1e-3
    for k in range(5):
        x, a = 2.0 * RADIUS * k, 0.0 if k else angle
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.004] * 3, r=[x - np.sin(a), 0.0, -np.cos(a)],
                       p=[np.cos(0.5 * a), 0.0, np.sin(0.5 * a), 0.0])  # fmt: skip
        scene.add_point(f"eye{k}", f"b{k}", [0.0, 0.0, 1.0])
        scene.add_point(f"pin{k}", "ground", [x, 0.0, 0.0])
        scene.add_joint("rev", f"hinge{k}", P_i=f"eye{k}", P_j=f"pin{k}", a_i=f"b{k}.y",
                        a_j="ground.y")  # fmt: skip
        if declared and k:
            declare(scene, f"b{k - 1}", f"b{k}", e=1.0)
        elif not declared:
            scene.add_shape("sphere", body=f"b{k}", radius=RADIUS, collides=True)
    if not declared:
        scene.add_material("steel", e=1.0)
        scene.add_collisions(material="steel")
    scene.add_force("weight", "gravity")
    half = np.pi * np.sqrt(1.004 / G) * (1.0 + angle**2 / 16.0 + 11.0 * angle**4 / 3072.0)
    result = dap.simulate(scene, t_end=half, dt=half, contact="stepping", contact_step=h)
    x = result.r[-1, :, 0] - 2.0 * RADIUS * np.arange(5)
    assert x[4] == pytest.approx(np.sin(angle), abs=4.0 * h**2)
    assert abs(x[:4]).max() < 4.0 * h**2
    assert abs(result.rd[-1]).max() < 20.0 * h**2


def test_an_arm_meets_a_floor_by_its_joints_of_that_instant():
    """Two links that fall onto their tip; limit: (w h)^2 / 8 of its 3 m/s, w = 15 rad/s.

    With rows of contacts or of joints of the start of the step it was off by 2.9e-3 m/s.
    """
    scene = dap.Scene(name="arm")
    scene.add_force("weight", "gravity")
    ends = {"ground": [0.0, 0.0, 0.3], "upper": [0.1, 0.0, 0.0], "lower": [0.1, 0.0, 0.0]}
    for holder, name, x in (("ground", "upper", 0.1), ("upper", "lower", 0.3)):
        scene.add_body(name, mass=1.0, Jp=[0.02] * 3, r=[x, 0.0, 0.3])
        scene.add_point(f"{name}_hinge", holder, ends[holder])
        scene.add_point(f"{name}_eye", name, [-0.1, 0.0, 0.0])
        scene.add_joint("rev", f"{name}_pin", P_i=f"{name}_eye", P_j=f"{name}_hinge",
                        a_i=f"{name}.y", a_j=f"{holder}.y")  # fmt: skip
    scene.add_point("tip", "lower", ends["lower"])
    scene.add_contact("ball_plane", "floor", P_i="tip", radius=0.02, mu=0.3, e=0.5, law="newton")
    h = 1e-3
    exact, found = (
        dap.simulate(scene, t_end=0.32, dt=0.32, contact=contact, contact_step=step, **TIGHT)
        for contact, step in (("events", None), ("stepping", h))
    )
    assert [event.kind for event in exact.events] == ["impact"]
    assert found.rd[-1] == pytest.approx(exact.rd[-1], abs=3.0 * (15.0 * h) ** 2 / 8.0)


@pytest.mark.slow
@long_in_plain_python
def test_rough_balls_that_fall_on_each_other_are_solved_to_the_tolerance():
    """180 balls: velocities that rounds ask for lie on rims of cones, where it ended at 8e-7."""
    scene, rng = dap.Scene(name="pile"), np.random.default_rng(0)
    for i, j, k in np.ndindex(6, 6, 5):
        x, y = [0.21 * i + 0.02 * rng.random(), 0.21 * j + 0.02 * rng.random()]
        add_ball(scene, f"b{i}_{j}_{k}", [x, y, 0.12 + 0.25 * k])
    scene.add_shape("box", body="ground", at=[0.6, 0.6, -0.5], size=[6.0, 6.0, 1.0], collides=True)
    scene.add_material("rubber", e=0.5, mu=0.4)
    scene.add_collisions(material="rubber")
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=0.6, dt=0.1, contact_step=2e-3, rtol=1e-8)
    assert result.ledger["residual"].value < 1e-8
    assert all(entry.ok for entry in result.ledger.values())
