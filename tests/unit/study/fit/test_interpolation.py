"""Times of measurements, and series between instants."""

import numpy as np
import pytest

from dap3d_core.study.fit.interpolation import SeriesInterpolator, common_step


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
    interpolator = SeriesInterpolator.of(grid, t)
    for curve in (
        lambda t: np.sin(3.0 * t),
        lambda t: np.sin(9.0 * t),
        lambda t: np.maximum(t - 0.7777, 0.0) ** 2,
    ):
        found = np.abs(interpolator(curve(grid)[None])[0] - curve(t)).max()
        assert found < interpolator.error(curve(grid)) < 1e-4
    exact = SeriesInterpolator.of(grid, grid[[3, 0, 200, 3]] + 1e-13)
    assert exact(grid).tolist() == grid[[3, 0, 200, 3]].tolist()
    assert exact.error(grid) == 0.0
    assert np.isnan(interpolator(np.where(grid > 1.5, np.nan, grid))).all()
