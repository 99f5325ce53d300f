"""What resists rolling and spinning, beside closed forms of a solid ball."""

import numpy as np
import pytest

import dap3d_core as dap

G, R, M = 9.81, 0.1, 2.0
I = 0.4 * M * R * R  # noqa: E741
#: Inertia of rolling over m R^2.
ROLLS = 1.4


def ball(angle=0.0, v=0.0, w=(0.0, 0.0, 0.0), **material):
    """A solid ball on a plane that falls off at an angle along x, whose axes are those of the plane."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=M, Jp=[I] * 3, r=[0.0, 0.0, R], r_dot=[v, 0.0, 0.0], w=w)
    scene.add_shape("sphere", body="ball", radius=R, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    scene.add_material("felt", mu=0.8, **material)
    scene.add_collisions(material="felt")
    scene.add_force("weight", "gravity", gravity=G, wgt=[np.sin(angle), 0.0, -np.cos(angle)])
    return scene


def test_a_ball_that_rolls_slows_down_evenly_and_stops():
    v, mu_roll, h = 1.0, 0.01, 1e-3
    a = G * mu_roll / (ROLLS * R)
    result = dap.simulate(ball(v=v, w=[0.0, v / R, 0.0], mu_roll=mu_roll), t_end=2.0, dt=0.1,
                          contact_step=h)
    t = np.minimum(result.t, v / a)
    x = v * t - 0.5 * a * t**2
    assert result.r[:, 0, 0] == pytest.approx(x, abs=a * h**2)
    assert abs(result.rd[-1, 0, 0]) < 1e-12
    early = result.t < 1.0
    assert result.r[early, 0, 0] == pytest.approx(x[early], abs=1e-8)


@pytest.mark.parametrize("part", [0.95, 1.3])
def test_a_ball_rolls_down_slopes_beyond_a_limit(part):
    mu_roll = 0.02
    angle = np.arctan(part * mu_roll / R)
    result = dap.simulate(ball(angle, mu_roll=mu_roll), t_end=1.0, dt=0.1, contact_step=2e-3)
    a = max(G * np.sin(angle) - G * np.cos(angle) * mu_roll / R, 0.0) / ROLLS
    assert result.r[:, 0, 0] == pytest.approx(0.5 * a * result.t**2, abs=1e-12 if part < 1 else 1e-8)


def test_a_ball_that_spins_stops_in_its_time():
    mu_spin, w = 0.002, 20.0
    a = mu_spin * M * G / I
    result = dap.simulate(ball(w=[0.0, 0.0, w], mu_spin=mu_spin), t_end=0.6, dt=0.05, contact_step=1e-3)
    assert result.w[:, 0, 2] == pytest.approx(np.maximum(w - a * result.t, 0.0), abs=1e-9)
