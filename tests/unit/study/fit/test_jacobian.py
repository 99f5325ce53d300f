"""Derivatives of predictions by differences."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core import SimulationError
from dap3d_core.study.fit.jacobian import Differences


def differences(function, low=-np.inf, high=np.inf):
    """Differences of a function of one number, with a step of 1e-3."""
    return Differences(
        lambda points: np.array([function(x) for x in points[:, 0]]),
        np.array([low]), np.array([high]), np.array([1.0]), 1e-3, ["x"],
    )  # fmt: skip


@pytest.mark.parametrize(("low", "high"), [(-np.inf, np.inf), (1.0, np.inf), (0.0, 1.0)])
def test_derivatives_at_bounds(low, high):
    """Second order everywhere: some h^2 of the third derivative; no point beyond a bound."""

    def function(x):
        assert low <= x <= high
        return np.array([np.exp(x), np.sin(x)])

    of, x = differences(function, low, high), np.array([1.0])
    steps = of.steps(x, function(1.0), None)
    assert steps.tolist() == pytest.approx([1e-3])
    found = of(x, function(1.0), steps)[:, 0]
    assert found == pytest.approx([np.e, np.cos(1.0)], abs=2e-6)
    assert found != pytest.approx([np.e, np.cos(1.0)], abs=1e-9)


def test_derivatives_near_points_that_fail():
    """To the side where runs succeed, or from a shorter step; else an error."""

    def rooted(x, limit):
        return np.array([np.nan]) if x < limit else np.array([np.sqrt(x)])

    for limit in (1.0, 1.0 - 5e-4):
        of = differences(lambda x, limit=limit: rooted(x, limit))
        found = of(np.array([1.0]), np.array([1.0]), np.array([1e-3]))
        assert found[0, 0] == pytest.approx(0.5, abs=1e-6)
    of = differences(lambda x: np.array([np.nan]))
    of.predict.note = "the run fell over"
    with pytest.raises(SimulationError, match=r"x = 1 succeeds.*the run fell over"):
        of(np.array([1.0]), np.array([1.0]), np.array([1e-3]))


def test_steps_are_short_where_a_parameter_acts_fast():
    """A phase that turns 100 times as fast as the parameter's own size needs a shorter step."""
    t = np.linspace(0.0, 1.0, 50)
    of = differences(lambda x: np.sin(300.0 * x * t))
    base = np.sin(300.0 * t)
    slopes = (300.0 * t * np.cos(300.0 * t))[:, None]
    assert of.steps(np.array([1.0]), base, slopes)[0] < 1e-3 / 100.0


def test_the_size_of_a_parameter():
    assert dap.Parameter(-3.0).size == 3.0
    assert dap.Parameter(0.0).size == 1.0
    assert dap.Parameter(0.0, -1.0, 4.0).size == 0.5
    assert dap.Parameter(0.0, -1.0, 4.0, 7.0).size == 7.0
