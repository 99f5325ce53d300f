"""Equilibria, linearisation, inverse dynamics and derivatives where a ball resists rolling.

Closed forms of a solid ball on a plane; a run is the reference of inverse dynamics.
"""

import numpy as np
import pytest
from support.own_types import registry_of
from support.plain import jit_is_on
from verification.test_friction_of_ones_own import Stribeck
from verification.test_rolling_resistance import ROLLS, G, I, M, R, Wheel, by_events, wheel

import dap3d_core as dap

MU_ROLL = 0.02


def ball(angle=0.0, v=0.0, w=(0.0, 0.0, 0.0), **law):
    """A solid ball on a plane that falls off at an angle along x, in the axes of the plane."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=M, Jp=[I] * 3, r=[0.0, 0.0, R], r_dot=[v, 0.0, 0.0], w=w)
    scene.add_contact("ball_plane", "c", P_i="ball.O", radius=R, **{"mu": 0.8, **law})
    scene.add_force("weight", "g", gravity=G, wgt=[np.sin(angle), 0.0, -np.cos(angle)])
    return scene


@pytest.mark.slow
def test_a_ball_rests_up_to_the_limit_of_a_slope():
    """N = m g cos, and a moment m g R sin, at a part of 0.999 of the limit; beyond it rolls."""
    below, above = (np.arctan(part * MU_ROLL / R) for part in (0.999, 1.001))
    found = dap.equilibrium(ball(below, mu_roll=MU_ROLL))
    normal, moment = found.Lam[0], found.Lam[3:]
    assert normal == pytest.approx(M * G * np.cos(below), rel=1e-12)
    assert np.linalg.norm(moment) == pytest.approx(M * G * R * np.sin(below), rel=1e-12)
    with pytest.raises(dap.SimulationError, match="contact c_roll slips"):
        dap.equilibrium(ball(above, mu_roll=MU_ROLL))
    with pytest.raises(dap.SimulationError, match="contact c_roll would drive"):
        dap.equilibrium(wheel(Wheel, 0.0, part_lost=-0.1))


def with_spring(**fields):
    """A ball beside x = 0, on a spring that also lifts it, to a point at a height of 1 m."""
    scene = ball(**fields)
    scene.bodies["ball"].r = [0.3, 0.0, R]
    scene.add_point("A", "ground", [0.0, 0.0, 1.0])
    scene.add_force("ptp", "spring", P_i="ball.O", P_j="A", k=8.0, l0=0.5)
    return scene


def test_linearised_a_ball_rolls_against_a_moment_that_its_weight_bounds():
    """1.4 m x'' = F_x - (m g - F_z) mu_roll / R, at x = 0.3; across F_y = -k' y, and the moment
    is against the velocity, which turns by y' / v."""
    v = 1.0
    scene = with_spring(v=v, w=(0.0, v / R, 0.0), mu_roll=MU_ROLL)
    run = by_events(scene, 0.1)
    point = dap.linearize(scene, at=run, t=0.0)
    a, b, k, l0 = 0.3, 1.0 - R, 8.0, 0.5
    length = np.hypot(a, b)
    along, height = k * (1 - l0 / length), k * l0 / length**3
    x_by_x, z_by_x = -along - height * a * a, height * a * b
    square = (x_by_x + z_by_x * MU_ROLL / R) / (ROLLS * M)
    slows = (M * G - along * b) * MU_ROLL / R / (ROLLS * M) / v
    across = np.roots([1.0, slows, along / (ROLLS * M)])
    expected = [*np.sqrt(complex(square)) * np.array([1, -1]), *across]
    for value in expected:
        assert np.abs(point.eigenvalues - value).min() < 1e-9 * abs(value)


@pytest.mark.slow
def test_linearised_what_holds_is_kept():
    """A ball on a spring swings in two directions; one that resists rolling in none."""
    for mu_roll in (0.0, 0.5):
        scene = with_spring(mu_roll=mu_roll)
        scene.bodies["ball"].r = [0.0, 0.0, R]
        run = dap.simulate(scene, t_end=0.1, contact="events")
        k = 8.0 * (1 - 0.5 / (1 - R)) / (ROLLS * M)
        swings = np.abs(dap.linearize(scene, at=run, t=0.0).eigenvalues.imag) > 0.1
        assert np.count_nonzero(swings) == (0 if mu_roll else 4)
        values = dap.linearize(scene, at=run, t=0.0).eigenvalues[swings]
        assert np.abs(values) == pytest.approx(np.sqrt(k), rel=1e-9)


def forces_of(result):
    """Of each contact at all instants but those of events, where they jump."""
    at = np.isin(result.t, [e.t for e in result.events if e.t > 0.0])
    contacts = map(result.contact, result.contact_names)
    return [np.column_stack([c.normal_force, c.friction])[~at] for c in contacts]


@pytest.mark.parametrize(
    "scene",
    [
        ball(v=1.0, w=(0.1, 1.0 / R, 3.0), mu_roll=MU_ROLL, mu_spin=0.002),
        ball(0.15, mu_roll=MU_ROLL),
        ball(0.15, v=1.0, mu_roll=MU_ROLL, mu_s=0.9),
        wheel(Wheel),
    ],
    ids=["rolls and spins", "rests", "slides first", "own law"],
)
def test_inverse_dynamics_finds_the_forces_of_a_run(scene):
    run = by_events(scene, 1.0)
    found = dap.inverse(scene, run, ())
    assert not [note for note in found.notes if "cannot" in note]
    for have, expected in zip(forces_of(found), forces_of(run), strict=True):
        assert have == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
def test_inverse_dynamics_says_where_a_ball_would_have_to_resist_more():
    """By 0.9 - 0.5 of m g R tan, a moment, less what a larger normal force would hold."""
    angle = np.arctan(0.9 * MU_ROLL / R)
    run = dap.simulate(ball(angle, mu_roll=MU_ROLL), t_end=0.1)
    found = dap.inverse(ball(angle, mu_roll=0.5 * MU_ROLL), run, ())
    size = M * G * np.cos(angle) * MU_ROLL * 0.4 / np.hypot(1.0, 0.5 * MU_ROLL)
    (note,) = [note for note in found.notes if "cannot do its part" in note]
    assert f"by {size:.3g} N or N m" in note


def test_inverse_dynamics_takes_laws_of_ones_own():
    scene = dap.Scene(name="block")
    scene.add_body("block", mass=M, Jp=[I] * 3, r=[0, 0, 0], r_dot=[1.0, 0, 0])
    scene.add_contact(Stribeck.keyword, "c", P_i="block.O", v_s=0.3, mu=0.2, mu_s=0.4)
    scene.add_force("weight", "g", gravity=G)
    compiled = dap.compile(scene, registry=registry_of(Stribeck))
    run = by_events(compiled, 0.3)
    have, expected = (forces_of(r)[0] for r in (dap.inverse(compiled, run, ()), run))
    assert have == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
@pytest.mark.skipif(not jit_is_on(), reason="derivatives are those of compiled code")
def test_derivatives_of_where_and_when_a_ball_stops():
    """x = v^2 / 2 a at t = v / a, a = g mu_roll / (1.4 R); of a change of v alone it slips at once,
    and rolls on with 1 / 1.4 of it."""
    v = 1.0
    scene = ball(v=v, w=(0.0, v / R, 0.0), mu_roll=MU_ROLL)
    by = ["contacts.c.mu_roll", "forces.g.gravity", "bodies.ball.r_dot.x"]
    found = dap.sensitivities(scene, by, t_end=1.5, dt=0.5, rtol=1e-11, atol=1e-13)
    a = G * MU_ROLL / (ROLLS * R)
    far, stops = 0.5 * v * v / a, v / a
    exact = [-far / MU_ROLL, -far / G, stops / ROLLS]
    assert found.final("ball.r.x") == pytest.approx(exact, rel=1e-8)
    exact = [-stops / MU_ROLL, -stops / G, 1 / (ROLLS * a)]
    (when,) = [k for k, e in enumerate(found.result.events) if e.name == "c_roll"]
    assert found.event_times[when] == pytest.approx(exact, rel=1e-8)
