"""Derivatives of predictions by differences, and what they say of the parameters."""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core import SimulationError
from dap3d_core.study.fit.jacobian import Differences, NoiseFloor, identify, regularised


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


FLOOR = NoiseFloor(1e-6, 1e-12)


def jacobian(*columns):
    return np.stack(columns, axis=1)


def identified(names, x, J, scale=None):
    x = np.array(x)
    scale = np.abs(x) if scale is None else np.array(scale)
    held = np.zeros(len(x), dtype=bool)
    return identify(names, x, scale, J, np.zeros_like(J), held, FLOOR)


def test_messages_on_what_cannot_be_told_apart():
    """Quotient, product, powers, sum, ratios: each from predictions that depend on it alone."""
    rng = np.random.default_rng(0)
    f, g = rng.standard_normal((2, 30))
    k, m = 40.0, 2.0
    assert (
        identified("km", (k, m), jacobian(f / k, -f / m))
        .messages[0]
        .endswith("only k / m is determined")
    )
    assert (
        identified("km", (k, m), jacobian(f / k, f / m))
        .messages[0]
        .endswith("only k * m is determined")
    )
    assert (
        identified("km", (k, m), jacobian(f / k, 2 * f / m))
        .messages[0]
        .endswith("k * m^2 is determined")
    )
    assert (
        identified("ab", (0.0, 3.0), jacobian(f, f), (1, 1))
        .messages[0]
        .endswith("a + b is determined")
    )
    found = identified("ab", (3.7, 1.3), jacobian(f, -2 * f)).messages[0]
    assert found.endswith("only a - 2 b is determined")
    c = 0.5
    found = identified("kmc", (k, m, c), jacobian(f / k, -(f + g) / m, g / c))
    assert found.messages[0].startswith("k, m and c cannot be told apart by these data: only their")
    assert found.rank == 2
    found = identified("kmc", (k, m, c), jacobian(f / k, -f / m, g / c))
    assert found.messages == (
        "k and m cannot be told apart by these data: only k / m is determined",
    )
    assert np.isfinite(found.covariance[2, 2])
    found = identified("abc", (1.0, 2.0, 3.0), jacobian(f, g, f + 2 * g))
    assert "changing" in found.messages[0]
    found = identified("abcd", (k, m, 1.0, 2.0), jacobian(f / k, -f / m, g, 2.0 * g))
    assert len(found.messages) == 2
    assert identified("kq", (k, m), jacobian(f, 0.0 * f)).messages == (
        "q has no effect on these data",
    )


def test_a_scale_changes_nothing_of_what_is_identified():
    """Also a parameter of 1e9 beside one of 1e-9 is determined where the data say so."""
    rng = np.random.default_rng(1)
    J = rng.standard_normal((20, 2)) / np.array([1e9, 1e-9])
    found = identified("ab", (1e9, 1e-9), J)
    assert found.messages == ()
    assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J), rel=1e-9)


def test_no_step_goes_along_what_is_lost():
    """The Gauss-Newton step of a regularised Jacobian is the shortest one, over the sizes."""
    rng = np.random.default_rng(2)
    f, residual = rng.standard_normal((2, 20))
    J = jacobian(f, -f * (1.0 + 1e-9), np.zeros(20))
    J[:, 1] += 1e-8 * rng.standard_normal(20)
    kept, rows = regularised(J, FLOOR)
    step, *_ = np.linalg.lstsq(
        np.vstack([kept, rows]), np.append(residual, np.zeros(3)), rcond=None
    )
    best = f @ residual / (f @ f)
    assert step == pytest.approx([best / 2.0, -best / 2.0, 0.0], abs=1e-6)
