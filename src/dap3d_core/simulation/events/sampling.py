"""Sampling of the function of an event within a step, as closely as it changes."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.result.file.validate import is_number

#: Parts of a window at which a function is looked at; uneven, so that they fall in step with none.
PARTS = (0.0, 0.17, 0.41, 0.63, 0.86, 1.0)
#: Each inner value is predicted from the others: it may miss by this part of their range, and by
#: this part of the largest value so far, which is rounding.
MISFIT, ROUNDING = 0.2, 1e-12
#: Factors on the width of a window whose function is not followed, and after one where it is.
NARROWER, WIDER = 0.25, 2.0
#: The narrowest window, as a part of a step; and how many in a row may not be followed: in one
#: there may be a jump.
NARROWEST, MOST_LOST = 2.0**-10, 2


def _misfits() -> Floats:
    """(inner, all) weights of the values: an inner one less what the others predict (Lagrange)."""
    count = len(PARTS)
    found = np.zeros((count - 2, count))
    for row, k in zip(found, range(1, count - 1), strict=True):
        others = [j for j in range(count) if j != k]
        for j in others:
            ratios = [(PARTS[k] - PARTS[i]) / (PARTS[j] - PARTS[i]) for i in others if i != j]
            row[j] = -np.prod(ratios)
        row[k] = 1.0
    return found


MISFITS = _misfits()
WIDEST_GAP = float(np.max(np.diff(PARTS)))


class Sampler:
    """Looks at one function of time, step by step, in windows as narrow as it takes to follow it.

    Attributes:
        lost: the first instant, s, from which the function changed too fast to be followed; None
            where it was followed everywhere.
    """

    def __init__(self, every: float | None) -> None:
        """Args: the largest distance of two looks, s; None: what the steps and the function ask."""
        self.lost: float | None = None
        self._widest = np.inf if every is None else every / WIDEST_GAP
        self._width, self._largest = self._widest, 0.0

    def state(self) -> tuple[float | None, float | None, float]:
        """State of the sampling, as plain data."""
        return self.lost, None if np.isinf(self._width) else self._width, self._largest

    def restore(self, state: Any) -> None:
        """Go on from what ``state`` gave.

        Raises:
            ValueError: it is not of that form.
        """
        if not (isinstance(state, list | tuple) and len(state) == 3):
            raise ValueError("what is known of how an event changes should be three numbers")
        lost, width, largest = state
        good = (lost is None or is_number(lost)) and is_number(largest) and largest >= 0.0
        if not good or not (width is None or (is_number(width) and width > 0.0)):
            raise ValueError("what is known of how an event changes is damaged")
        self.lost, self._largest = lost, float(largest)
        self._width = self._widest if width is None else min(float(width), self._widest)

    def look(
        self, value: Callable[[float], float], a: float, first: float, end: float
    ) -> Iterator[tuple[float, float]]:
        """Instants and values from behind a, where the value is ``first``, to the end, in order."""
        narrowest, lost = min(NARROWEST * (end - a), self._widest), 0
        while a < end:
            b = a + self._width
            b = b if b < end - 0.1 * self._width else end
            instants = [a + part * (b - a) for part in PARTS[1:-1]] + [b]
            values = np.array([first, *map(value, instants)])
            followed = self._is_followed(values)
            if not followed and b - a > narrowest:
                self._width = max(NARROWER * (b - a), narrowest)
                continue
            lost = 0 if followed else lost + 1
            self._width = min(WIDER * (b - a), self._widest)
            yield from zip(instants, values[1:].tolist(), strict=True)
            if lost > MOST_LOST:
                self.lost = a if self.lost is None else self.lost
                yield end, value(end)
                return
            a, first = b, values[-1]

    def _is_followed(self, values: Floats) -> bool:
        """True if the values of a window are those of a function that is smooth there."""
        self._largest = max(self._largest, float(np.max(np.abs(values))))
        miss = np.max(np.abs(MISFITS @ values))
        return bool(miss <= MISFIT * np.ptp(values) + ROUNDING * self._largest)
