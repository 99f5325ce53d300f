"""Reported series at the times of measurements, which are any times."""

from math import gcd

import attrs
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Reported instants a run may have so that the times of measurements are among them.
MOST_INSTANTS = 5000
#: Times are instants where they differ by less than this part of the reporting step.
SAME = 1e-9
#: Decimals in which times are looked at.
DECIMALS = 6
#: Degree of the spline between instants, whose error falls with step**(DEGREE + 1).
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
    whole = times * 10.0**DECIMALS
    if last < 1e6 and np.abs(whole - np.round(whole)).max() < 1e-4:
        common = gcd(*(int(w) for w in np.round(whole)))
        candidates.append(common / 10.0**DECIMALS)
    for step in candidates:
        count = round(last / step)
        if 1 <= count <= max(MOST_INSTANTS, 2 * len(times)):
            step = last / count
            if np.abs(times / step - np.round(times / step)).max() < SAME * _slack(count):
                return float(step)
    return None


def _slack(count: int) -> float:
    """How much more times of so many steps differ by rounding."""
    return max(1.0, count / 1e4)


@attrs.frozen(eq=False)
class Sampling:
    """Takes series at times: from the instants that they are, else from a spline.

    Attributes:
        grid: (n,) reported instants.
        t: (nt,) the times.
        places: (nt,) where in the grid each stands; None where one stands nowhere.
    """

    grid: Floats
    t: Floats
    places: NDArray[np.int64] | None

    @classmethod
    def of(cls, grid: Floats, t: Floats) -> "Sampling":
        """The sampling of series on a grid at times within it."""
        if len(grid) == 1:
            return cls(grid, t, np.zeros(len(t), dtype=np.int64))
        at = np.clip(np.searchsorted(grid, t), 1, len(grid) - 1)
        places = np.where(t - grid[at - 1] < grid[at] - t, at - 1, at)
        exact = np.abs(grid[places] - t) <= 2.0 * SAME * (grid[1] - grid[0]) * _slack(len(grid))
        return cls(grid, t, places if exact.all() else None)

    def __call__(self, series: Floats) -> Floats:
        """Series (..., n) at the times: (..., nt); NaN where a series has one."""
        if self.places is not None:
            return np.asarray(series[..., self.places])
        return _spline(self.grid, series, self.t)

    def error(self, series: Floats) -> float:
        """Largest error of the spline, estimated from one through every second instant.

        That one errs 64 times as much where a series is smooth, but only 4 times where a force
        jumps, and the smaller figure is taken. Infinite where there are too few instants to tell.
        """
        if self.places is not None:
            return 0.0
        if len(self.grid) < 4 * DEGREE:
            return np.inf
        coarse, between = self.grid[::2], self.grid[1 : 2 * (len(self.grid[::2]) - 1) : 2]
        found = _spline(coarse, series[..., ::2], between)
        misfit = np.abs(found - series[..., 1 : 2 * len(between) : 2]).max()
        return float(misfit) / 4.0


def _spline(grid: Floats, series: Floats, t: Floats) -> Floats:
    from scipy.interpolate import make_interp_spline

    degree = min(DEGREE, 2 * ((len(grid) - 2) // 2) + 1)
    flat = series.reshape(-1, len(grid))
    found = np.full((len(flat), len(t)), np.nan)
    good = np.isfinite(flat).all(axis=-1)
    if good.any():
        found[good] = make_interp_spline(grid, flat[good].T, k=degree)(t).T
    return found.reshape(*series.shape[:-1], len(t))
