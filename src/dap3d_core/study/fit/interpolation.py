"""Interpolates reported series at the times of measurements."""

from math import gcd

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers

#: Largest number of reported instants of a run, so that the measured times are among them.
MAX_INSTANTS = 5000
#: Times are equal where they differ by less than this fraction of the reporting step.
SAME = 1e-9
#: Decimals of times that a common step takes into account.
DECIMALS = 6
#: Degree of the spline between instants, whose error is of order step**(DEGREE + 1).
DEGREE = 5


def common_step(t: Floats) -> float | None:
    """The longest step of which all times are multiples; None where it would be too short.

    Times that differ by one step, or that have few decimals, have such a step.
    """
    times = np.unique(np.append(t, 0.0))
    if len(times) == 1:
        return None
    last = times[-1]
    candidates = [float(np.diff(times).min())]
    scaled = times * 10.0**DECIMALS
    if last < 1e6 and np.abs(scaled - np.round(scaled)).max() < 1e-4:
        common = gcd(*(int(number) for number in np.round(scaled)))
        candidates.append(common / 10.0**DECIMALS)
    for step in candidates:
        count = round(last / step)
        if 1 <= count <= max(MAX_INSTANTS, 2 * len(times)):
            step = last / count
            if np.abs(times / step - np.round(times / step)).max() < SAME * _rounding(count):
                return float(step)
    return None


def _rounding(count: int) -> float:
    """Factor of the rounding errors of times of so many steps."""
    return max(1.0, count / 1e4)


@attrs.frozen(eq=False)
class SeriesInterpolator:
    """Takes series at given times: at reported instants, else by a spline.

    Attributes:
        grid: (n,) reported instants.
        t: (nt,) the times.
        index: (nt,) of each time in the grid; None where one is not in the grid.
    """

    grid: Floats
    t: Floats
    index: Integers | None

    @classmethod
    def of(cls, grid: Floats, t: Floats) -> "SeriesInterpolator":
        """Interpolator of series on a grid at times within it."""
        if len(grid) == 1:
            return cls(grid, t, np.zeros(len(t), dtype=np.int64))
        after = np.clip(np.searchsorted(grid, t), 1, len(grid) - 1)
        index = np.where(t - grid[after - 1] < grid[after] - t, after - 1, after)
        exact = np.abs(grid[index] - t) <= 2.0 * SAME * (grid[1] - grid[0]) * _rounding(len(grid))
        return cls(grid, t, index if exact.all() else None)

    def __call__(self, series: Floats) -> Floats:
        """Series (..., n) at the times: (..., nt); NaN where a series has one."""
        if self.index is not None:
            return np.asarray(series[..., self.index])
        return _spline(self.grid, series, self.t)

    def error(self, series: Floats) -> float:
        """Largest error of the spline, estimated from one through every second instant.

        That one has an error 64 times as large where a series is smooth, but only 4 times where a
        force jumps, and the smaller factor is taken. Infinite where there are too few instants.
        """
        if self.index is not None:
            return 0.0
        if len(self.grid) < 4 * DEGREE:
            return np.inf
        coarse, between = self.grid[::2], self.grid[1 : 2 * (len(self.grid[::2]) - 1) : 2]
        interpolated = _spline(coarse, series[..., ::2], between)
        return float(np.abs(interpolated - series[..., 1 : 2 * len(between) : 2]).max()) / 4.0

    def relative_error(self, series: Floats) -> float:
        """The error over the size of a series (n,)."""
        size = float(np.ptp(series))
        return self.error(series) / size if size else 0.0


def _spline(grid: Floats, series: Floats, t: Floats) -> Floats:
    from scipy.interpolate import make_interp_spline

    degree = min(DEGREE, 2 * ((len(grid) - 2) // 2) + 1)
    flat = series.reshape(-1, len(grid))
    values = np.full((len(flat), len(t)), np.nan)
    good = np.isfinite(flat).all(axis=-1)
    if good.any():
        values[good] = make_interp_spline(grid, flat[good].T, k=degree)(t).T
    return values.reshape(*series.shape[:-1], len(t))
