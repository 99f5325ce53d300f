"""Holds of an integration, whatever the method."""

import numpy as np
import pytest
from support.internals import integration_options
from support.pushed import pushed_block

import dap3d_core as dap
from dap3d_core.integrators import INTEGRATORS, Status
from dap3d_core.integrators.stepping.hold import Hold

TIMES = np.array([0.0, 0.25, 0.5, 1.0])


def begun(integrator, **more):
    """An integration of the pushed block, its evaluator and its holds."""
    scene = pushed_block(1.0)
    compiled = dap.compile(scene)
    evaluator = compiled.evaluator
    options = integration_options(evaluator, scene.simulation) | {"atol": 1e-10} | more
    y = evaluator.integrated(evaluator.model.u0)
    integration = INTEGRATORS[integrator].make(evaluator, y, TIMES, **options)
    return evaluator, integration, Hold(integration, 1)


@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "adams", "radau"])
def test_a_report_at_the_end_of_a_hold_is_made_with_what_comes_then(integrator):
    """And only once; the end of the run is reported as it is."""
    evaluator, integration, hold = begun(integrator)
    assert hold.to(0.25)
    assert integration.t == 0.25
    evaluator.set_inputs([3.0])
    hold.jump()
    assert hold.to(0.4)
    while not hold.to(np.inf):
        if integration.status is Status.FINISHED:
            break
    rows = integration.rows()
    assert rows[:, 0].tolist() == TIMES.tolist()
    accelerations = rows[:, 1 + integration.y.size]
    assert accelerations == pytest.approx([0.5, 1.5, 1.5, 1.5])
    x = 0.25 * 0.0625 + 0.125 * 0.75 + 0.75 * 0.75**2
    assert rows[-1, 1] == pytest.approx(x, abs=1e-14)


def test_a_cut_step_does_not_shorten_the_next_ones():
    """Unless one was rejected: the step of the last hold is tried again."""
    _, integration, hold = begun("dop853")
    hold.to(0.5)
    integration.work.h = 0.3
    hold.to(0.5 + 0.3000001)
    assert integration.work.h >= 0.3


def test_full_rows_and_spent_budgets_are_told():
    """Then the same hold goes on."""
    _, integration, hold = begun("rk4", step=0.01, buffer_rows=1)
    assert not hold.to(0.7)
    assert integration.rows_are_full
    calls = 0
    reached = False
    while not reached:
        integration.rows()
        reached = hold.to(0.7, 0)
        calls += 1
    assert calls > 1
    assert integration.t == 0.7


def test_what_starts_anew_is_on_the_side_of_its_modes():
    """A ball at rest whose gap is less than zero by rounding touches again, and does not fall."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, r=[0.0, 0.0, 0.1 - 1e-15])
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    scene.add_force("weight", "g")
    evaluator = dap.compile(scene).evaluator
    options = integration_options(evaluator, scene.simulation)
    y = evaluator.integrated(evaluator.model.u0)
    integration = INTEGRATORS["dop853"].make(evaluator, y, TIMES, **options)
    integration.restart()
    integration.advance(np.inf)
    assert integration.status is Status.JUMPED
    assert integration.t < 1e-6
