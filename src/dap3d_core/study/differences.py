"""Differences of high order, for derivatives of what Python computes."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import STATE

#: Offsets of differences in steps: central, and to either side where a value has a limit.
OFFSETS = (-3, -2, -1, 1, 2, 3), (0, 1, 2, 3, 4, 5, 6), (0, -1, -2, -3, -4, -5, -6)
#: A change of a state, over its size, in differences of functions of it.
CHANGE = 1e-3
#: Differences of two orders of a smooth function agree to this part, and this of the largest. Else
#: steps are so much shorter, and tried so often.
SMOOTH, SMOOTH_OF_LARGEST = 1e-9, 1e-12
SHORTER, SHORTER_STEPS = 16.0, 4


def power_of_two(length: float) -> float:
    """The power of two below a length: added to numbers of about its size it is not rounded.

    So the differences of a number that is a copy of the parameter are exact.
    """
    return 2.0 ** math.floor(math.log2(length))


def weights_of(offsets: tuple[int, ...]) -> Floats:
    """Weights of values at some offsets in the derivative at 0, of highest order."""
    powers = np.vander(np.array(offsets, dtype=float), increasing=True).T
    return np.linalg.solve(powers, np.eye(len(offsets))[1])


def slope_at(values: Sequence[Any], offsets: tuple[int, ...], step: float) -> tuple[Any, float]:
    """The derivative at 0 from values at offsets; how far one of a lower order is from it.

    That is above 1 where a corner or a jump of the function lies among the offsets; infinite where
    it has no value there (NaN).
    """
    found = weighted(list(zip(weights_of(offsets), values, strict=True))) / step
    kept = [k for k, offset in enumerate(offsets) if abs(offset) < max(map(abs, offsets))]
    lower = weights_of(tuple(offsets[k] for k in kept))
    other = weighted([(w, values[k]) for w, k in zip(lower, kept, strict=True)]) / step
    size = np.abs(found)
    limit = SMOOTH * size + SMOOTH_OF_LARGEST * np.max(size, initial=0.0)
    parts = np.abs(found - other) / np.where(limit > 0.0, limit, 1.0)
    return found, float(np.max(np.where(np.isnan(parts), np.inf, parts), initial=0.0))


def best_of(tries: Iterable[tuple[Any, float]]) -> Any:
    """The first derivative of some that is of a smooth function, or that which is most so."""
    best, least = None, np.inf
    for found, missed in tries:
        if best is None or missed < least:
            best, least = found, missed
        if not 1.0 < missed <= least:
            break
    return best


def differences(function: Callable[[float], Floats], step: float) -> Floats:
    """The derivative at 0 of a function, by central differences of sixth order.

    Steps become shorter as long as a corner or a jump of the function lies among them.
    """
    offsets = OFFSETS[0]
    tries = (slope_at([function(k * h) for k in offsets], offsets, h)
             for h in step / SHORTER ** np.arange(SHORTER_STEPS))  # fmt: skip
    return np.asarray(best_of(tries))


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
