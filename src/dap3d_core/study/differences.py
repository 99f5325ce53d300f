"""Differences of high order, for derivatives of what Python computes."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import STATE

#: Offsets of differences in steps: central, and to either side where a value has a limit.
OFFSETS = (-3, -2, -1, 1, 2, 3), (0, 1, 2, 3, 4, 5, 6), (0, -1, -2, -3, -4, -5, -6)
#: A change of a state, over its size, in differences of functions of it.
CHANGE = 1e-3


def power_of_two(length: float) -> float:
    """The power of two below a length: added to numbers of about its size it is not rounded.

    So the differences of a number that is a copy of the parameter are exact.
    """
    return 2.0 ** math.floor(math.log2(length))


def weights_of(offsets: tuple[int, ...]) -> Floats:
    """Weights of values at some offsets in the derivative at 0, of highest order."""
    powers = np.vander(np.array(offsets, dtype=float), increasing=True).T
    return np.linalg.solve(powers, np.eye(len(offsets))[1])


def differences(function: Callable[[float], Floats], step: float) -> Floats:
    """The derivative at 0 of a function, by central differences of sixth order."""
    offsets = OFFSETS[0]
    pairs = zip(offsets, weights_of(offsets), strict=True)
    return weighted([(w, function(k * step)) for k, w in pairs]) / step


def weighted(pairs: Sequence[tuple[float, Any]]) -> Any:
    """The sum of weights times values, whose weights add up to zero: exactly 0 of equal values."""
    _, first = pairs[0]
    return sum(w * (value - first) for w, value in pairs[1:])


def motion_of(body_count: int) -> slice:
    """Columns of poses and velocities in rows; reactions, which may be large, are behind them."""
    return slice(1, 1 + STATE * body_count)


def change_along(state: Floats, slopes: Floats) -> float:
    """How far to go along slopes, for differences of functions of a state; 0 where there are none.

    So far that the state changes by ``CHANGE`` of its largest number.
    """
    size, speed = (float(np.max(np.abs(x), initial=0.0)) for x in (state, slopes))
    return CHANGE * max(size, 1e-3) / speed if speed > 0.0 and math.isfinite(speed) else 0.0
