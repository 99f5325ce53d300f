"""The tangent of states in the stages of Radau, against closed forms and differences."""

import numpy as np
import pytest
from support.internals import MOST_STAGES
from support.state_types import MASS, REGISTRY, C, K, pulled, steered

import dap3d_core as dap
from dap3d_core.integrators import INTEGRATORS


def radau_of(compiled):
    """An integration by Radau after its first steps, with the tangent of the last one."""
    evaluator = compiled.evaluator
    u = compiled.model.u0
    evaluator.start(0.0, u)
    integration = INTEGRATORS["radau"].make(
        evaluator, evaluator.coordinates.start(u), np.linspace(0.0, 0.1, 3), rtol=1e-6,
        atol=1e-8, report_size=evaluator.report_size, error_size=evaluator.coordinates.size,
    )  # fmt: skip
    integration.advance(30)
    return integration


def test_the_derivatives_of_a_maxwell_element():
    """By z, by x, and of the force by z, in scaled coordinates: exact but for differences."""
    integration = radau_of(dap.compile(pulled(), registry=REGISTRY))
    own = integration.tangent.states
    m, at_rate, at_body, at_force, *_ = own.records[0]
    assert m == 1
    assert own.values[at_rate] == pytest.approx(-K / C, rel=1e-6)
    by_x = own.values[at_body : at_body + 3]
    assert np.linalg.norm(by_x) == pytest.approx(K / C / np.sqrt(MASS), rel=1e-6)
    force = own.values[at_force : at_force + 6]
    assert np.linalg.norm(force) == pytest.approx(K / np.sqrt(MASS), rel=1e-6)


def on_one_leg():
    """A body that slides on the end of a leg ahead of it: friction changes its own normal force."""
    scene = dap.Scene(name="on one leg")
    scene.add_body("b", mass=1.0, Jp=[0.02, 0.025, 0.03], r=[0, 0, 0.15], r_dot=[-0.5, 0.2, 0])
    scene.add_point("foot", "b", [-0.2, 0.05, -0.15])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="foot", mu=0.8)
    scene.simulation.contact = "events"
    return scene


def test_newton_converges_where_friction_lifts_or_presses():
    """The tangent has sliding friction by the normal force: 13 steps, without that 153."""
    result = dap.simulate(on_one_leg(), t_end=0.1, dt=0.05, integrator="radau", rtol=1e-10)
    assert result.contact("floor").mode[-1] == 1
    assert result.stats.steps < 30


@pytest.mark.parametrize("make", [pulled, steered])
def test_newton_converges_at_the_rate_of_an_exact_tangent(make):
    """Some two iterations a step: without a part of the tangent it would be ten and more."""
    compiled = dap.compile(make(), registry=REGISTRY)
    result = dap.simulate(compiled, t_end=1.0, dt=0.5, integrator="radau", rtol=1e-6)
    assert result.stats.rhs < 2.5 * MOST_STAGES * result.stats.steps
    assert result.stats.rejected < 0.2 * result.stats.steps


def test_a_stiff_state_costs_no_more_steps():
    """A relaxation a thousand times faster than the motion is stepped over."""
    steps = [
        dap.simulate(dap.compile(pulled(c=c, z_0=0.4), registry=REGISTRY), t_end=1.0,
                     integrator="radau", rtol=1e-6).stats.steps
        for c in (3.0, 1e-4)
    ]  # fmt: skip
    assert steps[1] < 2 * steps[0]
