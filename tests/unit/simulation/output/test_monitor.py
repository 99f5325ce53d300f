"""Who watches a run is told how it stands, as the result tells it in the end."""

import numpy as np
import pytest
from support import problems
from support.plain import long_in_plain_python

import dap3d_core as dap


@long_in_plain_python
@pytest.mark.parametrize("options", [{}, {"integrator": "rk4", "step": 0.002}])
def test_the_last_word_is_that_of_the_result(options):
    """Steps and drift at the end are those of statistics and ledger.
    A tenth is allowed for the drift: it is measured by the largest energy at the end of a chunk."""
    seen = []
    result = dap.simulate("pen1", t_end=1.0, dt=1.0, watch=seen.append, **options)
    last = seen[-1]
    assert (last.t, last.t_end, last.steps) == (1.0, 1.0, result.stats.steps)
    assert last.drift == pytest.approx(result.ledger["energy"].value, rel=0.1)


def test_it_goes_on_from_chunk_to_chunk():
    seen = []
    dap.simulate(problems.pendulum(), t_end=3.0, rtol=1e-12, watch=seen.append)
    times = [run.t for run in seen]
    assert times == sorted(times)
    assert all(0.0 <= run.t <= run.t_end == 3.0 for run in seen)
    steps = np.diff([0, *(run.steps for run in seen)])
    spans = np.diff([0.0, *times])
    np.testing.assert_allclose([run.step for run in seen], spans / steps, rtol=1e-12)


@long_in_plain_python
def test_drift_is_measured_by_the_work_between_turning_points():
    """A run with friction stops where the pendulum turns back, with its energy that of the start.
    The limit is that of the tolerance, with a factor for some hundred steps."""
    scene = dap.Scene()
    scene.add_body("rod", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[0.25, 0.0, 0.0])
    scene.add_point("end", "rod", [-0.25, 0.0, 0.0])
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="rod.y", a_j="ground.y")
    scene.add_force("friction", joint="hinge", mu=0.1, radius=0.01)
    scene.add_force("weight")
    seen = []
    result = dap.simulate(scene, t_end=3.0, watch=seen.append)
    assert len(seen) > 3
    assert max(run.drift for run in seen) < 1e-6
    assert result.ledger["energy"].ok
