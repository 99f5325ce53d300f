"""The balance of forces at a pose: closing, stiffness, displacements."""

import numpy as np
import pytest
from support import at_rest
from support.mechanisms import rough_four_bar

import dap3d_core as dap
from dap3d_core.simulation.equilibrium.statics import Statics, displacement
from dap3d_core.simulation.equilibrium.statics import at_rest as without_velocities


def statics_of(scene):
    evaluator = dap.compile(scene).evaluator
    evaluator.start(0.0, evaluator.model.u0)
    return Statics(evaluator), without_velocities(evaluator.model.u0)


def test_positions_are_closed_to_rounding():
    statics, u = statics_of(rough_four_bar())
    closed = statics.closed(u)
    C = statics.evaluator.rows(0.0, closed).C
    assert np.max(np.abs(C)) < 1e-15 * 20  # coordinates up to 4 m


def test_the_residual_is_what_no_reaction_carries():
    """Of a pendulum at 1 rad the moment m g l sin(1) about its hinge, in one freedom."""
    statics, u = statics_of(at_rest.pendulum(1.0))
    pose = statics.at(u)
    # the freedom turns the rod by a part a, and moves its mass centre by a l: a^2 (1 + l^2/L^2) = 1
    a = 1 / np.sqrt(1 + 1 / statics.length**2)
    moment = 2.0 * at_rest.G * np.sin(1.0)
    assert np.abs(pose.unbalanced) == pytest.approx([moment * a], rel=1e-13)


def test_stiffness_is_the_derivative_of_what_is_unbalanced():
    """By central differences; h = 1e-5 leaves 1e-10 of truncation and of rounding errors."""
    statics, u = statics_of(at_rest.toggle(0.7))
    pose, h = statics.at(statics.closed(u)), 1e-5
    x = pose.free[:, 0]
    ahead, behind = (statics.balance(statics.moved(pose.u, k * h * x), pose) for k in (1, -1))
    slope = pose.free.T @ (behind - ahead) / (2 * h)
    assert statics.stiffness(pose)[:, 0] == pytest.approx(slope, rel=1e-8)


def test_displacements_are_found_back():
    """Of a retraction p + L^T dtheta / 2 the rotation is 2 atan(|dtheta| / 2)."""
    statics, u = statics_of(at_rest.toggle(0.7))
    x = np.random.default_rng(1).normal(size=18).reshape(3, 6)
    shift, turn = displacement(u, statics.moved(u, x.ravel()))
    angle = np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
    assert shift == pytest.approx(statics.length * x[:, :3], rel=1e-12)
    assert turn == pytest.approx(x[:, 3:] / angle * 2 * np.arctan(angle / 2), rel=1e-12)
