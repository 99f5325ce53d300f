"""The parts of a fit: times, derivatives, what a Jacobian says of parameters."""

import numpy as np
import pytest

from dap3d_core.study.fit.fit_parameters import Parameter
from dap3d_core.study.fit.identifiability import Resolution, determine, steadied
from dap3d_core.study.fit.interpolation import Sampling, common_step
from dap3d_core.study.fit.jacobian import Differences

RESOLUTION = Resolution(1e-6, 1e-12)


def test_the_common_step_of_times():
    """Of regular times it is their step, of decimals their greatest common divisor."""
    assert common_step(0.02 * np.arange(500)) == pytest.approx(0.02, rel=1e-12)
    assert common_step(np.array([0.1 + 0.2, 0.7, 0.35])) == pytest.approx(0.05, rel=1e-12)
    assert common_step(np.linspace(0.0, 1.0, 7)) == pytest.approx(1.0 / 6.0, rel=1e-12)
    assert common_step(np.array([0.0, 1.0, np.pi])) is None
    assert common_step(np.array([0.000001, 100.0])) is None  # a hundred million instants
    assert common_step(np.zeros(3)) is None


def test_a_spline_between_instants_is_as_good_as_it_says():
    """Its estimated error bounds that for sines and where a force jumps; at instants it is none."""
    grid = np.linspace(0.0, 2.0, 201)
    t = np.linspace(0.003, 1.999, 777)
    sampling = Sampling.of(grid, t)
    for curve in (
        lambda t: np.sin(3.0 * t),
        lambda t: np.sin(9.0 * t),
        lambda t: np.maximum(t - 0.7777, 0.0) ** 2,
    ):
        found = np.abs(sampling(curve(grid)[None])[0] - curve(t)).max()
        assert found < sampling.error(curve(grid)) < 1e-4
    exact = Sampling.of(grid, grid[[3, 0, 200, 3]] + 1e-13)
    assert exact(grid).tolist() == grid[[3, 0, 200, 3]].tolist()
    assert exact.error(grid) == 0.0
    assert np.isnan(sampling(np.where(grid > 1.5, np.nan, grid))).all()


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


def test_derivatives_beside_points_that_fail():
    """They are taken to the side where runs succeed, or from a shorter step; else it is told."""
    from dap3d_core import SimulationError

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


def jacobian(*columns):
    return np.stack(columns, axis=1)


def said(names, x, J, scale=None):
    x = np.array(x)
    scale = np.abs(x) if scale is None else np.array(scale)
    held = np.zeros(len(x), dtype=bool)
    return determine(names, x, scale, J, np.zeros_like(J), held, RESOLUTION)


def test_words_for_what_cannot_be_told_apart():
    """Quotient, product, powers, sum, ratios: each from predictions that depend on it alone."""
    rng = np.random.default_rng(0)
    f, g = rng.standard_normal((2, 30))
    k, m = 40.0, 2.0
    assert said("km", (k, m), jacobian(f / k, -f / m)).words[0].endswith("only k / m is determined")
    assert said("km", (k, m), jacobian(f / k, f / m)).words[0].endswith("only k * m is determined")
    assert said("km", (k, m), jacobian(f / k, 2 * f / m)).words[0].endswith("k * m^2 is determined")
    assert said("ab", (0.0, 3.0), jacobian(f, f), (1, 1)).words[0].endswith("a + b is determined")
    found = said("ab", (3.7, 1.3), jacobian(f, -2 * f)).words[0]
    assert found.endswith("only a - 2 b is determined")
    c = 0.5
    found = said("kmc", (k, m, c), jacobian(f / k, -(f + g) / m, g / c))
    assert found.words == ("k, m and c cannot be told apart by these data: only their ratios are "
                           "determined",)  # fmt: skip
    assert found.rank == 2
    found = said("kmc", (k, m, c), jacobian(f / k, -f / m, g / c))
    assert found.words == ("k and m cannot be told apart by these data: only k / m is determined",)
    assert np.isfinite(found.covariance[2, 2])
    found = said("abc", (1.0, 2.0, 3.0), jacobian(f, g, f + 2 * g))
    assert "changing" in found.words[0]
    found = said("abcd", (k, m, 1.0, 2.0), jacobian(f / k, -f / m, g, 2.0 * g))
    assert len(found.words) == 2
    assert said("kq", (k, m), jacobian(f, 0.0 * f)).words == ("q has no effect on these data",)


def test_a_scale_changes_nothing_of_what_is_said():
    """Also a parameter of 1e9 beside one of 1e-9 is determined where the data say so."""
    rng = np.random.default_rng(1)
    J = rng.standard_normal((20, 2)) / np.array([1e9, 1e-9])
    found = said("ab", (1e9, 1e-9), J)
    assert found.words == ()
    assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J), rel=1e-9)


def test_no_step_goes_along_what_is_lost():
    """The Gauss-Newton step of a steadied Jacobian is the shortest one, over the sizes."""
    rng = np.random.default_rng(2)
    f, residual = rng.standard_normal((2, 20))
    J = jacobian(f, -f * (1.0 + 1e-9), np.zeros(20))
    J[:, 1] += 1e-8 * rng.standard_normal(20)
    kept, rows = steadied(J, RESOLUTION)
    step, *_ = np.linalg.lstsq(
        np.vstack([kept, rows]), np.append(residual, np.zeros(3)), rcond=None
    )
    best = f @ residual / (f @ f)
    assert step == pytest.approx([best / 2.0, -best / 2.0, 0.0], abs=1e-6)


def test_the_size_of_a_parameter():
    assert Parameter(-3.0).size == 3.0
    assert Parameter(0.0).size == 1.0
    assert Parameter(0.0, -1.0, 4.0).size == 0.5
    assert Parameter(0.0, -1.0, 4.0, 7.0).size == 7.0
