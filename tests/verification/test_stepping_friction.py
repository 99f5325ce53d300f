"""Friction of joints that sticks, by stepping: closed forms, and events on the same scene."""

from itertools import pairwise

import numpy as np
import pytest
from verification.test_sticking_friction import hinge, slider
from verification.test_sticking_under_load import pendulum, wheel

import dap3d_core as dap

STEPS = {"contact": "stepping", "contact_step": 5e-3}
G = 9.81


def loaded(part):
    """A hinge that carries 5 kg, and a torque that is a part of what it holds."""
    scene, moment, inertia = wheel()
    scene.add_force("motor", "push", joint="pin", torque=part * moment)
    return scene, (part - 1.0) * moment / inertia


@pytest.mark.slow
def test_a_loaded_hinge_does_not_creep():
    """Limit: rounding of a turn."""
    result = dap.simulate(loaded(0.999)[0], t_end=60.0, dt=30.0, **STEPS)
    assert abs(result.quantity("pin.angle").values[-1]) < 1e-14
    rub = result.contact("rub")
    assert list(rub.mode) == [2, 2, 2]
    assert result.ledger["contact work"].ok
    assert rub.normal_force == pytest.approx(0.02 * 5.0 * G / 0.02, rel=1e-12)


def test_a_coulomb_oscillator_rests_where_it_should():
    """Each half swing is 2 f / k less: from 1 m to -0.04 m, where 2 N do not move it; k x <= f."""
    f, k, h = 8.0, 50.0, STEPS["contact_step"]
    scene = slider(x=1.0)
    scene.add_force("tran_sda", "spring", P_i="block.O", P_j="ground.O", a_j="ground.x", k=k)
    scene.add_force("tran_friction", "rub", joint="way", f_c=f)
    result = dap.simulate(scene, t_end=4.0, dt=2.0, **STEPS)
    assert result.r[-1, 0, 0] == pytest.approx(-0.04, abs=k / 2.0 * h**2)
    assert abs(result.rd[-1, 0, 0]) < 1e-15
    assert result.contact("rub").friction[-1, 0] == pytest.approx(k * result.r[-1, 0, 0], rel=1e-9)
    took = 0.5 * k * (1.0 - 0.04**2)
    assert result.energy.total[-1] - result.energy.total[0] == pytest.approx(-took, rel=h**2)
    assert all(entry.ok in (True, None) for entry in result.ledger.values())


@pytest.mark.parametrize(("sticks", "begins"), [(0.4, 0.4), (0.8, 0.8)])
def test_what_sticks_begins_to_slip_by_its_own_coefficient(sticks, begins):
    """A torque of t N m against n_s, and n_c = 0.4 N m from then on."""
    scene, n, inertia, end = hinge(spin=0.0), 0.4, 0.3, 1.0
    scene.add_function("a", "grows", coeff=[0.0, 1.0, 0.0])
    scene.add_force("motor", "push", joint="axle", torque="grows")
    scene.add_force("rot_friction", "rub", joint="axle", n_c=n, n_s=sticks)
    result = dap.simulate(scene, t_end=end, dt=0.5, **STEPS)
    speed = (0.5 * (end**2 - begins**2) - n * (end - begins)) / inertia
    assert result.w[-1, 0, 2] == pytest.approx(speed, abs=STEPS["contact_step"] * begins / inertia)


def sleeve():
    """It slides along its rod and turns about it, by its weight."""
    scene, axis = dap.Scene(name="sleeve"), {"a_i": "sleeve.x", "a_j": "ground.x"}
    scene.add_body("sleeve", mass=2.0, Jp=[0.05] * 3, r_dot=(1.5, 0, 0), w=(4.0, 0, 0))
    scene.add_joint("cyl", "rod", P_i="sleeve.O", P_j="ground.O", **axis)
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="rod", mu=0.3, radius=0.04)
    return scene


def socket():
    """A ball joint off the mass centre, whose load turns with the ball."""
    scene = dap.Scene(name="socket")
    scene.add_body("ball", mass=2.0, Jp=[0.05, 0.06, 0.07], r=(0.1, 0, 0), w=(1.0, -2.0, 2.0))
    scene.add_point("centre", "ball", (-0.1, 0.0, 0.0))
    scene.add_joint("sph", "socket", P_i="centre", P_j="ground.O")
    scene.add_force("weight")
    scene.add_force("friction", "rub", joint="socket", mu=0.3, radius=0.04)
    return scene


@pytest.mark.parametrize("make", [pendulum, sleeve, socket])
def test_steps_extrapolate_to_events(make):
    """While they slide: errors of order h, whose limit by h, h/2, h/4 is less than 1e-6 away."""
    given = {"t_end": 0.3, "dt": 0.3}
    exact = dap.simulate(make(), contact="events", rtol=1e-10, **given).u[-1]
    first, second, third = (
        dap.simulate(make(), contact="stepping", contact_step=h, **given).u[-1] - exact
        for h in (2e-3, 1e-3, 5e-4)
    )
    assert np.abs(first).max() < 2.0 * 2e-3
    assert np.abs((8.0 * third - 6.0 * second + first) / 3.0).max() < 1e-6


@pytest.mark.parametrize("shapes", [False, True])
@pytest.mark.parametrize(
    ("ends", "t"), [({"active": "t < 0.25"}, 0.25), ({"breaks_at": 25.0}, 0.2)]
)
def test_what_hangs_on_a_joint_that_ends_falls_onto_the_floor(ends, t, shapes):
    """It carries m g + 26.9 t N; it has come to rest to the square of a step."""
    scene, fall = dap.Scene(name="hung"), 0.5
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=(0.0, 0.0, 0.1 + fall))
    scene.add_joint("rev", "hook", P_i="ball.O", P_j="on", a_i="ball.x", a_j="ground.x", **ends)
    scene.add_point("on", "ground", (0.0, 0.0, 0.1 + fall))
    scene.add_force("weight", "gravity")
    scene.add_function("a", "grows", coeff=[0.0, (2.0 * G - 25.0) / 0.2, 0.0])
    scene.add_force("motor", "pull", P_i="ball.O", P_j="ground.O", a_j="ground.z",
                    coordinate="length", force="grows")  # fmt: skip
    if shapes:
        scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
        scene.add_shape("plane", body="ground", collides=True)
        scene.add_collisions()
    else:
        scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    result = dap.simulate(scene, t_end=0.8, dt=0.4, **STEPS)
    (event,) = result.events
    assert (event.kind, event.name) == ("break", "hook")
    assert event.t == pytest.approx(t, abs=1e-9)
    assert result.r[-1, 0, 2] == pytest.approx(0.1, abs=STEPS["contact_step"] ** 2)


def test_friction_beside_a_damper_is_of_second_order():
    """A block slides against mu m g and c v: dampers know the speed that friction leaves.

    v = (v0 + a / k) e^(-k t) - a / k with a = mu g, k = c / m; half the step leaves a quarter.
    """
    mass, mu, c, t, errors = 2.0, 0.3, 4.0, 0.4, []
    for h in (0.02, 0.01, 0.005):
        scene = dap.Scene(name="block")
        scene.add_material("surface", mu=mu)
        scene.add_collisions(material="surface")
        scene.add_body("b", mass=mass, Jp=[0.01] * 3, r=[0.0, 0.0, 0.1], r_dot=[3.0, 0.0, 0.0])
        scene.add_shape("box", body="b", size=[0.2] * 3, collides=True)
        scene.add_shape("plane", body="ground", collides=True)
        scene.add_force("weight", "gravity")
        scene.add_point("far", "ground", [-10.0, 0.0, 0.1])
        scene.add_force("ptp", "damper", P_i="b.O", P_j="far", l0=10.0, c=c)
        run = dap.simulate(scene, t_end=t, dt=t, contact_step=h, estimate_error=False)
        a, k = mu * 9.81, c / mass
        x = (3.0 + a / k) * (1.0 - np.exp(-k * t)) / k - a / k * t
        errors.append(abs(run.r[-1, 0, 0] - x))
    assert errors[0] < 1e-3
    assert all(3.8 < one / half < 4.2 for one, half in pairwise(errors))


@pytest.mark.parametrize("contact", ["stepping", "events"])
def test_a_run_that_begins_where_another_ended_rubs_once(contact):
    """w = w_0 - n_c t / J; what was said to slide had its own force besides the impulse."""
    scene, J, n_c, start = dap.Scene(name="hinge"), 0.3, 0.4, 2.0
    scene.add_body("wheel", mass=2.0, Jp=[0.5, 0.5, J], w=[0.0, 0.0, start])
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force("rot_friction", "rub", joint="axle", n_c=n_c)
    half = dap.simulate(scene, t_end=0.4, dt=0.4, contact=contact)
    result = dap.simulate(scene, start=half, t_end=0.4, dt=0.4, contact="stepping")
    assert result.w[-1, 0, 2] == pytest.approx(start - 0.8 * n_c / J, rel=1e-9)
