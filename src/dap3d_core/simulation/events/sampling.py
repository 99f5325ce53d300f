"""Sampling of the function of an event within a step, as closely as it changes.

A window of the step is sampled at six instants. The quintic through them shows where the function
turns towards its level, and is sampled there, too. What the samples miss of the values that the
others predict, and those at the turning points of the quintic, bounds how far the quintic is wrong.
Where that is more than the distance of a turning point from the level, two crossings can hide
there, and the window is narrowed.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import comb
from typing import Any, NamedTuple

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.result.file.validate import is_number

#: Fractions of a window at which a function is sampled; uneven, to be in phase with no oscillation.
FRACTIONS = np.array((0.0, 0.17, 0.41, 0.63, 0.86, 1.0))
#: Each inner value is predicted from the others: it may miss by this part of their range, and by
#: this part of the largest value so far, which is rounding.
MISFIT, LEVEL_ROUNDING = 0.2, 1e-12
#: A function this many times its misfit away from the level does not reach it.
CLEARANCE = 3.0
#: A turning point this near to the level, as a part of the range in its window, is evaluated at the
#: end of a step to it: dense output is less accurate than the ends of steps.
NEAR_LEVEL = 1e-3
#: Factors on the width of a window whose function is not followed, and after one where it is.
NARROWER, WIDER = 0.25, 2.0
#: The narrowest window, as a part of a step; and how many in a row may not be followed: in one
#: there may be a jump.
NARROWEST, MAX_LOST = 2.0**-12, 2
#: The narrowest window about a kink, and how many more of the kind than of others are tried.
NARROWEST_AT_KINK, MAX_KINK_WINDOWS = 2.0**-40, 128
#: Windows that are tried in a step at most, but for those that ``every`` requires.
MAX_WINDOWS = 2**13
#: Of the slope of the quintic: coefficients below this part of the largest are rounding.
NO_COEFFICIENT = 1e-15


def _predictions() -> Floats:
    """(inner, all) weights of the values: an inner one less what the others predict (Lagrange)."""
    count = len(FRACTIONS)
    found = np.zeros((count - 2, count))
    for row, k in zip(found, range(1, count - 1), strict=True):
        others = [j for j in range(count) if j != k]
        for j in others:
            ratios = [
                (FRACTIONS[k] - FRACTIONS[i]) / (FRACTIONS[j] - FRACTIONS[i])
                for i in others
                if i != j
            ]
            row[j] = -np.prod(ratios)
        row[k] = 1.0
    return found


MISFITS = _predictions()
#: Coefficients of the quintic, lowest first, and of its slope, from the values.
COEFFICIENTS = np.linalg.inv(np.vander(FRACTIONS, increasing=True))
SLOPES = np.arange(1, len(FRACTIONS))[:, None] * COEFFICIENTS[1:]
#: Bernstein coefficients of the slope from the values: it has no zero where all have one sign.
BERNSTEIN = np.array([[comb(i, j) / comb(4, j) for j in range(5)] for i in range(5)]) @ SLOPES
WIDEST_GAP = float(np.max(np.diff(FRACTIONS)))


def turning_points(values: Floats) -> list[tuple[float, float]]:
    """(fraction of the window, value) of the extrema of the quintic through the values.

    They lie between the middles of the zeros of its slope, however close these are.
    """
    bernstein = BERNSTEIN @ values
    if np.all(bernstein >= 0.0) or np.all(bernstein <= 0.0):
        return []
    slope = SLOPES @ values
    slope[np.abs(slope) <= NO_COEFFICIENT * np.max(np.abs(slope))] = 0.0
    zeros = np.sort(np.roots(slope[::-1]).real)
    places = np.array([0.0, *zeros[(zeros > 0.0) & (zeros < 1.0)], 1.0])
    middles = (0.5 * (places[:-1] + places[1:])).tolist()
    coefficients, polynomial = slope.tolist(), (COEFFICIENTS @ values).tolist()
    signs = [(x, y) for x in middles if (y := _polynomial(coefficients, x)) != 0.0]
    found = []
    for (low, side), (high, other) in pairwise(signs):
        if (side > 0.0) != (other > 0.0):
            while low < (middle := 0.5 * (low + high)) < high:
                if (_polynomial(coefficients, middle) > 0.0) == (side > 0.0):
                    low = middle
                else:
                    high = middle
            found.append((middle, _polynomial(polynomial, middle)))
    return found


def is_sampling(state: Any) -> bool:
    """True for plain data that may be the state of a ``Sampler``."""
    if not isinstance(state, list) or len(state) != 5:
        return False
    *optional, largest, windows = state
    numbers = [x for x in optional if x is not None]
    good = all(map(is_number, [*numbers, largest, windows]))
    return good and min(largest, windows) >= 0.0 and (state[2] is None or state[2] > 0.0)


def _polynomial(coefficients: list[float], x: float) -> float:
    """Value of a polynomial, its lowest coefficient first."""
    value = 0.0
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


class Turn(NamedTuple):
    """A turning point towards the level.

    Attributes:
        after: index of the sample of the window before it.
        t, value: s, the function there.
        miss: difference of the quintic.
    """

    after: int
    t: float
    value: float
    miss: float


class Sampler:
    """Samples one function of time, step by step, in windows as narrow as it takes to follow it.

    Attributes:
        lost: the first instant, s, from which the function changed too fast to be followed; None
            where it was followed everywhere.
        touch: the first instant, s, at which it turned within rounding of its level; None where
            it did not.
    """

    def __init__(self, every: float | None) -> None:
        """Args: the largest distance of two samples, s; None: what steps and function require."""
        self.lost: float | None = None
        self.touch: float | None = None
        self._widest = np.inf if every is None else every / WIDEST_GAP
        self._width, self._largest, self._kink_windows = self._widest, 0.0, 0

    def state(self) -> tuple[float | None, ...]:
        """State of the sampling, as plain data."""
        width = None if np.isinf(self._width) else self._width
        return self.lost, self.touch, width, self._largest, self._kink_windows

    def restore(self, state: Any) -> None:
        """Continue from what ``state`` gave (``is_sampling``)."""
        self.lost, self.touch, width, largest, windows = state
        self._largest, self._kink_windows = float(largest), int(windows)
        self._width = self._widest if width is None else min(float(width), self._widest)

    def samples(
        self,
        value: Callable[[float], float],
        exact: Callable[[float], float],
        a: float,
        first: float,
        end: float,
    ) -> Iterator[tuple[float, float]]:
        """Instants and values from behind a, where the value is ``first``, to the end, in order.

        value, exact: the function, by dense output, and at the end of a step to that instant.
        """
        step, lost, left = end - a, 0, MAX_WINDOWS + 4.0 * (end - a) / self._widest
        resolution = 8.0 * np.finfo(float).eps * max(abs(a), abs(end))
        while a < end:
            b = a + self._width
            b = b if b < end - 0.1 * self._width else end
            instants = [*(a + FRACTIONS[1:-1] * (b - a)).tolist(), b]
            values = np.array([first, *map(value, instants)])
            left -= 1.0
            miss, turns = self._misfit(values), self._turns(value, a, b, values)
            followed = miss <= MISFIT * np.ptp(values) + LEVEL_ROUNDING * self._largest
            if self._may_hide(values, miss, turns, followed):
                many = self._kink_windows > MAX_KINK_WINDOWS
                least = (NARROWEST if many else NARROWEST_AT_KINK) * step
                least = min(max(least, resolution), self._widest)
                if b - a > least and left > 0.0:
                    self._kink_windows += b - a < NARROWEST * step
                    self._width = max(NARROWER * (b - a), least)
                    continue
                lost = 0 if followed else lost + 1
            else:
                lost = 0
            if b - a >= NARROWEST * step:
                self._kink_windows = max(0, self._kink_windows - 1)
            self._width = min(WIDER * (b - a), self._widest)
            yield from self._with_turns(exact, instants, values, turns)
            if lost > MAX_LOST or (left <= 0.0 and b < end):
                self.lost = a if self.lost is None else self.lost
                yield end, value(end)
                return
            a, first = b, values[-1]

    def _misfit(self, values: Floats) -> float:
        """Largest difference of an inner value from what the others predict."""
        self._largest = max(self._largest, float(np.max(np.abs(values))))
        return float(np.max(np.abs(MISFITS @ values)))

    def _turns(
        self, value: Callable[[float], float], a: float, b: float, values: Floats
    ) -> list[Turn]:
        """The turning points of a window that are at or across the level, or towards it."""
        found = []
        for fraction, expected in turning_points(values):
            k = int(np.searchsorted(FRACTIONS, fraction)) - 1
            sides = np.sign(expected) * values[k : k + 2]
            if np.all(sides > abs(expected)) or np.any(sides <= 0.0):
                t = a + fraction * (b - a)
                here = value(t)
                found.append(Turn(k, t, here, abs(here - expected)))
        return found

    def _may_hide(self, values: Floats, miss: float, turns: list[Turn], followed: bool) -> bool:
        """True if a window may have crossings that its samples and turning points do not show."""
        miss = max([miss, *(turn.miss for turn in turns)])
        if miss <= LEVEL_ROUNDING * self._largest:
            return False
        if any(abs(turn.value) <= CLEARANCE * miss for turn in turns):
            return True
        nearest = np.abs(values).tolist()
        ends = [x for x in (nearest[0], nearest[-1]) if x > LEVEL_ROUNDING * self._largest]
        is_alike = np.sign(values[0]) * np.sign(values[-1]) > 0.0
        if is_alike and min(ends, default=np.inf) <= CLEARANCE * miss:
            return True
        one_side = bool(np.all(values > 0.0) or np.all(values < 0.0))
        return not (followed or (one_side and min(nearest) > CLEARANCE * miss))

    def _with_turns(
        self,
        exact: Callable[[float], float],
        instants: list[float],
        values: Floats,
        turns: list[Turn],
    ) -> Iterator[tuple[float, float]]:
        """The samples of a window and its turning points, in order."""
        near = NEAR_LEVEL * float(np.ptp(values))
        for k, sample in enumerate(zip(instants, values[1:].tolist(), strict=True)):
            for turn in turns:
                if turn.after != k:
                    continue
                is_near = abs(turn.value) <= near
                found = exact(turn.t) if is_near else turn.value
                if is_near and self.touch is None and abs(found) <= LEVEL_ROUNDING * self._largest:
                    self.touch = turn.t
                yield turn.t, found
            yield sample
