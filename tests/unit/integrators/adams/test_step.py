"""Runs of scenes with the integrator adams."""

import numpy as np
import pytest
from support import problems

import dap3d_core as dap


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


def test_what_does_not_fit_is_refused():
    scene = problems.pendulum()
    with pytest.raises(dap.SimulationError, match="adams does not fit method penalty"):
        dap.simulate(scene, t_end=0.1, method="penalty", integrator="adams")
    with pytest.raises(dap.SceneError, match="chooses its step itself"):
        dap.simulate(scene, t_end=0.1, integrator="adams", step=0.01)
