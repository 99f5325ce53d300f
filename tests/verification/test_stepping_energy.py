"""Energy of contacts by stepping: what bounces keeps, what stops loses, and the ledger of it."""

import numpy as np
import pytest
from verification.test_stepping import G, ball, collide

import dap3d_core as dap


def test_a_pair_without_loss_keeps_its_energy():
    scene = dap.Scene(name="pair")
    scene.add_material("surface", e=1.0)
    scene.add_collisions(material="surface")
    balls = ("a", 2.0, [0.0] * 3, [3.0, 0.1, 0.0]), ("b", 1.0, [0.5, 0.02, 0.01], [0.0] * 3)
    for name, mass, r, v in balls:
        scene.add_body(name, mass=mass, Jp=[0.004 * mass] * 3, r=r, r_dot=v)
        scene.add_shape("sphere", body=name, radius=0.1, collides=True)
    result = dap.simulate(scene, t_end=0.5, dt=0.1)
    energy = (np.array([2.0, 1.0]) * (result.rd**2).sum(axis=2)).sum(axis=1)
    assert result.rd[-1, 1, 0] > 3.0
    assert energy[-1] == pytest.approx(energy[0], rel=1e-12)


@pytest.mark.parametrize(("e", "left"), [(1.0, 1.0), (0.9, 0.0)])
def test_a_ball_that_bounces_has_the_energy_of_its_height(e, left):
    """20 s at 10 ms: all of it, or none where it has come to rest; limit: rounding."""
    result = dap.simulate(ball(height=1.0, v=0.0, e=e), t_end=20.0, dt=1.0, contact_step=1e-2)
    energy = result.energy.total - 2.0 * G * 0.1
    assert abs(energy[-1] / energy[0] - left) < 1e-12
    # Once it gained m G h v a bounce, by impulses of an impact that did work on what they stopped.
    assert result.ledger["contact work"].value < 1e-9
    assert result.ledger["energy"].value < 1e-9


@pytest.mark.parametrize(("mu", "most"), [(0.0, 0.015), (0.5, 5e-4)])
def test_a_box_that_tumbles_does_not_gain_energy(mu, most):
    """e = 1, 20 s; limits: of order h, of some 40 impacts. By Newton's law alone: 0.033 at 1 ms.

    Each impact is off by the turning of a step times its arms, either way: of 16 boxes at 1 ms the
    root mean square is 0.028, at 0.5 ms 0.005.
    """
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=1.0, Jp=[0.01, 0.015, 0.02], r=[0, 0, 1.1], w=[1.0, 2.0, 3.0])
    scene.add_shape("box", body="box", size=[0.4, 0.3, 0.1], collides=True)
    result = dap.simulate(collide(scene, mu=mu, e=1.0), t_end=20.0, dt=0.1, contact_step=5e-4)
    change = result.energy.total / result.energy.total[0] - 1.0
    assert change.max() < most
    assert mu > 0.0 or change.min() > -most


def test_what_a_stack_loses_at_an_impact_is_the_work_of_its_contacts():
    """A box falls on three that rest, and stops: contacts take m g h, to rounding.

    By velocities behind the impact, from the start of the step, 0.1 of it were left over.
    """
    scene = dap.Scene(name="stack")
    for k, gap in enumerate([0.0, 0.0, 0.0, 0.02]):
        scene.add_body(f"box{k}", mass=1.0, Jp=[1 / 600] * 3, r=[0.0, 0.0, 0.05 + 0.1 * k + gap])
        scene.add_shape("box", body=f"box{k}", size=[0.1] * 3, collides=True)
    result = dap.simulate(collide(scene, mu=0.5), t_end=0.1, dt=0.05, contact_step=1e-2)
    assert result.record.stepping["contact_work"] == pytest.approx(-0.02 * G, rel=1e-13)
    assert result.record.stepping["friction_work"] == 0.0
    for name in ("energy", "total energy", "contact work"):
        assert result.ledger[name].value < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_the_ledger_of_a_pile_is_balanced(e):
    """27 balls onto each other at 4 ms: energy to the residual, 1.3e-2 once; heights to h^2."""
    scene, rng = dap.Scene(name="pile"), np.random.default_rng(1)
    for k in range(27):
        at = [0.21 * (k % 3), 0.21 * (k // 3 % 3), 0.15 + 0.23 * (k // 9)]
        at[:2] += 0.01 * rng.standard_normal(2)
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.004] * 3, r=at, r_dot=[0.0, 0.0, -1.0])
        scene.add_shape("sphere", body=f"b{k}", radius=0.1, collides=True)
    result = dap.simulate(collide(scene, mu=0.3, e=e), t_end=0.4, dt=0.2, contact_step=4e-3)
    assert result.ledger["energy"].value < 1e-7
    assert result.ledger["total energy"].value < 1e-3
    assert result.ledger["contact work"].value < 1e-12
