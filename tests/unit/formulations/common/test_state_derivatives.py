"""Derivatives by and of states, against differences of the evaluator."""

import numpy as np
import pytest
from support.state_types import REGISTRY, stated, steered

import dap3d_core as dap
from dap3d_core.formulations.common.state_derivatives import state_derivatives
from dap3d_core.simulation.initial.least_change import displaced

#: Step of central differences: truncation 1e-10, rounding 1e-10 of numbers of order one to 100.
H = 1e-5


@pytest.fixture(params=[stated, steered], ids=["forces", "joint"])
def evaluator(request):
    return dap.compile(request.param(), registry=REGISTRY).evaluator


def derivatives(evaluator, u):
    model = evaluator.model
    n = model.body_count
    evaluator.start(0.0, u)
    reported = evaluator.report(0.0, u)
    layout = model.report_layout
    v = u[7 * n :]
    evaluator.place(0.0, u)
    return state_derivatives(evaluator, 0.0, v, reported[layout["Lam"]], reported[layout["v_dot"]])


def moving(model):
    """The start with velocities."""
    u = model.u0.copy()
    u[7 * model.body_count :] = np.random.default_rng(1).normal(size=6 * model.body_count)
    return u


def test_rates_and_their_derivatives(evaluator):
    """By displacements, velocities and states."""
    model, u = evaluator.model, moving(evaluator.model)
    n, own = model.body_count, derivatives(evaluator, u)
    assert own.rates == pytest.approx(evaluator.state_rates(0.0, u), abs=1e-14)
    start = evaluator.states.copy()

    def difference(change):
        ahead, behind = (change(H), change(-H))
        return (ahead - behind) / (2.0 * H)

    for k in range(6 * n):
        step = np.eye(6 * n)[k].reshape(n, 6)
        by_x = difference(lambda h, s=step: evaluator.state_rates(0.0, displaced(u, h * s)))
        assert own.rate_by_displacement.toarray()[:, k] == pytest.approx(by_x, abs=1e-6)
        along = np.concatenate([np.zeros(7 * n), step.ravel()])
        by_v = difference(lambda h, s=along: evaluator.state_rates(0.0, u + h * s))
        assert own.rate_by_velocity.toarray()[:, k] == pytest.approx(by_v, abs=1e-6)
    for k in range(model.state_count):

        def moved(h, k=k):
            evaluator.states = start + h * np.eye(model.state_count)[k]
            found = evaluator.state_rates(0.0, u)
            evaluator.states = start
            return found

        assert own.rate_by_states.toarray()[:, k] == pytest.approx(difference(moved), abs=1e-6)


def test_forces_and_rows_by_states(evaluator):
    """Applied forces; D v - nu and D a - gamma of the joint whose rows see its state."""
    model, u = evaluator.model, moving(evaluator.model)
    own = derivatives(evaluator, u)
    start = evaluator.states.copy()
    for k in range(model.state_count):
        found = []
        for h in (H, -H):
            evaluator.states = start + h * np.eye(model.state_count)[k]
            rows = evaluator.rows(0.0, u)
            found.append((evaluator.applied_forces(0.0, u).ravel(), -rows.nu, -rows.gamma))
        evaluator.states = start
        matrices = (own.force_by_states, own.velocity_by_states, own.acceleration_by_states)
        for ahead, behind, matrix in zip(*found, matrices, strict=True):
            want = (ahead - behind) / (2.0 * H)
            assert matrix.toarray()[:, k] == pytest.approx(want, abs=1e-6)
    if model.joints and model.joints[0].type_info.layout.states:
        assert own.velocity_by_states.toarray() == pytest.approx(-np.eye(1))
        assert own.acceleration_by_states.toarray() == pytest.approx(np.eye(1) / 0.25)
