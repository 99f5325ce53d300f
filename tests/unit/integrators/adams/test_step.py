"""Runs of scenes with the integrator adams."""

import numpy as np
import pytest
from support import problems
from support.plain import long_in_plain_python

import dap3d_core as dap


@long_in_plain_python
def test_a_chain_moves_as_with_another_method():
    """Two methods without a common formula agree; constraints and energy hold at every report."""
    scene = problems.chain(3)
    options = {"t_end": 1.0, "dt": 0.05, "rtol": 1e-10, "atol": 1e-10}
    ours = dap.simulate(scene, integrator="adams", **options)
    other = dap.simulate(scene, integrator="dop853", **options)
    assert np.abs(ours.r - other.r).max() < 2e-9
    assert np.abs(ours.w - other.w).max() < 2e-8
    assert ours.ledger["energy"].ok
    assert ours.ledger["position"].value < 1e-12
    assert ours.stats.projections > ours.stats.steps  # accepted and reported states


@long_in_plain_python
def test_steady_precession_of_a_top():
    """G4: the closed form of the motion; fewer right-hand sides than dop853."""
    scene = problems.heavy_top(0.5, 200.0, _precession(0.5, 200.0))
    options = {"t_end": 2.0, "dt": 0.5, "rtol": 1e-11, "atol": 1e-11}
    ours = dap.simulate(scene, integrator="adams", **options)
    other = dap.simulate(scene, integrator="dop853", **options)
    height = 0.1 * np.cos(0.5)
    assert np.abs(ours.r[:, 0, 2] - height).max() < 1e-9
    angle = _precession(0.5, 200.0) * ours.t
    wanted = 0.1 * np.sin(0.5) * np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    assert np.abs(ours.r[:, 0, :2] - wanted).max() < 1e-8
    assert ours.stats.rhs < 0.7 * other.stats.rhs


def _precession(theta, spin, A=0.02, C=0.005, moment=0.1 * 9.81):
    """The slow root of A cos(theta) x^2 - C spin x + m g l = 0."""
    a, b = A * np.cos(theta), C * spin
    return (b - np.sqrt(b * b - 4 * a * moment)) / (2 * a)


@pytest.mark.slow
def test_errors_follow_the_tolerances():
    """Andrews' mechanism with 100 reports, beside dop853 at 1e-12: no setting errs out of its turn.
    Errors of its 500 to 1100 steps are not multiplied: their sum is below 20 rtol of its size
    (2.5 at the most). A single bad step would show in the balance of energy, too."""
    model = dap.compile(dap.load("A03"))
    run = {"t_end": 0.05, "dt": 0.0005}
    other = dap.simulate(model, rtol=1e-12, atol=1e-14, **run)
    size, errors = np.abs(other.r).max(), {}
    ladder = [(10.0**-k, 10.0 ** -(k + 2)) for k in range(6, 11)]
    for rtol, atol in [*ladder, (1e-8, 1e-7)]:
        ours = dap.simulate(model, integrator="adams", rtol=rtol, atol=atol, **run)
        errors[rtol, atol] = np.abs(ours.r - other.r).max() / size
        assert errors[rtol, atol] < 20.0 * rtol, (rtol, atol)
        assert ours.ledger["energy"].ok
    assert errors[ladder[-1]] < errors[ladder[0]] / 100.0


def test_turns_are_counted():
    """What is watched at accepted steps is watched here, too: a torsion spring over two turns."""
    scene = dap.Scene(name="torsion")
    scene.add_body("wheel", mass=1.0, Jp=(0.1, 0.1, 0.1), w=(0.0, 0.0, 15.0))
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    axes = {"v_i": "wheel.x", "v_j": "ground.x", "axis": "ground.z"}
    scene.add_force("rot_sda", "spring", k=0.4, turns=True, **axes)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, integrator="adams", rtol=1e-10, atol=1e-10)
    assert 2 * np.pi < 15.0 / 2.0  # amplitude of the swing: more than a turn
    assert np.abs(result.w[:, 0, 2] - 15.0 * np.cos(2.0 * result.t)).max() < 1e-7


def test_what_does_not_fit_is_refused():
    scene = problems.pendulum()
    with pytest.raises(dap.SimulationError, match="adams does not fit method penalty"):
        dap.simulate(scene, t_end=0.1, method="penalty", integrator="adams")
    with pytest.raises(dap.SceneError, match="chooses its step itself"):
        dap.simulate(scene, t_end=0.1, integrator="adams", step=0.01)
