"""Prepared runs: each is the run of a new integration, bit for bit."""

import numpy as np
import pytest
from support import trees
from support.on_axles import wheel

from dap3d_core.integrators import INTEGRATORS
from dap3d_core.integrators.prepared import PreparedRun
from dap3d_core.simulation import CompiledModel

TIMES = np.array([0.0, 0.05, 0.1])
SETTINGS = {
    "dop853": {"rtol": 1e-6, "atol": 1e-6},
    "dopri5": {"rtol": 1e-6, "atol": 1e-6},
    "adams": {"rtol": 1e-6, "atol": 1e-6},
    "rk4": {"step": 0.01},
}


def problem(method):
    """An evaluator, a start and another one, and what makes a new integration from a start."""
    evaluator = CompiledModel(trees.mixed_chain(2), method=method).evaluator
    y0 = evaluator.coordinates.start(evaluator.model.u0)
    other = y0.copy()
    other[-4:-1] += 0.3

    def make(name, y, rows=3):
        evaluator.start(0.0, evaluator.model.u0)  # turns are counted from there
        options = {"report_size": evaluator.report_size, "buffer_rows": rows, "project_on": True}
        options |= {"stops": [(0.03, True), (0.07, False)]}  # passed anew in each run
        return INTEGRATORS[name].make(evaluator, y, TIMES, **options, **SETTINGS[name])

    return y0, other, make


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_each_run_is_that_of_a_new_integration(method, name):
    y0, other, make = problem(method)
    prepared = PreparedRun(make(name, y0))
    ends = []
    for start in (None, other, y0, None):
        new = make(name, y0 if start is None else start)
        new.advance(10**9)
        assert prepared.run(start)
        assert np.array_equal(prepared.integration.rows(), new.rows())
        assert prepared.integration.statistics == new.statistics
        ends.append(prepared.integration.y)
    assert np.array_equal(ends[0], ends[3])
    assert not np.array_equal(ends[0], ends[1])


def test_turns_are_put_back_to_the_start():
    """A wheel that turns more than once, on a spring that counts turns."""
    evaluator = CompiledModel(wheel(), method="standard").evaluator
    y = evaluator.integrated(evaluator.model.u0)
    evaluator.start(0.0, evaluator.model.u0)
    options = {"report_size": evaluator.report_size, "project_on": True}
    prepared = PreparedRun(INTEGRATORS["dop853"].make(evaluator, y, [0.0, 1.0, 2.0], **options))
    rows = [prepared.integration.rows() for _ in range(2) if prepared.run()]
    assert np.array_equal(*rows)


def test_a_run_that_fails_says_so_and_the_next_one_does_not():
    y0, _, make = problem("joint")
    prepared = PreparedRun(make("rk4", y0))
    lost = y0.copy()
    lost[-2] = 1e300
    assert not prepared.run(lost)
    assert prepared.integration.status.name == "NOT_FINITE"
    assert prepared.run()


def test_what_cannot_be_put_back_is_refused():
    y0, _, make = problem("joint")
    begun = make("dop853", y0)
    begun.advance(0)
    with pytest.raises(ValueError, match="has begun"):
        PreparedRun(begun)
    with pytest.raises(ValueError, match="takes 2 of 3 rows"):
        PreparedRun(make("dop853", y0, rows=2))
