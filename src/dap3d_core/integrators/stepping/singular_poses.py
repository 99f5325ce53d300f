"""Steps across singular states, where the constraints lose rank for a moment.

``project`` tells lengths (one for each node of joints) that go linearly through zero at a singular
state. A step across has to keep its stages away from it: rounding of positions changes
the acceleration at distance d by rounding / d^3. So steps are cut such that the singular state
falls into the middle of the widest gap between the abscissae of the stages, and stages nearby are
evaluated on the constraints, where nothing but rounding is left of that error
(docs/decisions/0007).
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.kernels.runtime.array_struct import Floats
from dap3d_core.kernels.runtime.cache import compiled_inside

#: Rows of ``lengths``: as they are at t, and their rates over the last step.
NOW, RATE = range(2)
#: The step before the one across leaves this part of the way to the middle of that one's gap.
SPARE = 0.95
#: A singular state less than this part of a step away from it is near.
MARGIN = 0.5


@compiled_inside
def singular_ahead(lengths: Floats, h: float) -> float:
    """Time left until the next singular state; infinite where none is less than 2 h away."""
    left = np.inf
    for k in range(lengths.shape[1]):
        now, rate = lengths[NOW, k], lengths[RATE, k]
        if now + 2.0 * h * rate < 0.0:
            left = min(left, -now / rate)
    return left


@compiled_inside
def aim(lengths: Floats, calm: float, h: float) -> float:
    """How long a step that may have length h should be: h, or less for the sake of a crossing.

    calm: the part of a step at which a singular state should lie.
    """
    left = singular_ahead(lengths, h)
    if not left < (1.0 + calm) * h:
        return h
    if left <= calm * h:
        return left / calm
    return min(h, left - SPARE * calm * h)


@compiled_inside
def is_near(lengths: Floats, h: float) -> bool:
    """Whether a singular state lies in a step of length h, or close before or behind it."""
    found = 0
    for k in range(lengths.shape[1]):
        now, change = lengths[NOW, k], lengths[RATE, k] * h
        found |= (now < -(1.0 + MARGIN) * change) | (now < MARGIN * change)
    return found != 0


@compiled_inside
def look_back(lengths: Floats, found: Floats, h: float) -> None:
    """Take over the lengths found at the end of a step; beyond zero they count from there."""
    for k in range(lengths.shape[1]):
        before, now = lengths[NOW, k], found[k]
        if before + h * lengths[RATE, k] < 0.0:
            before = -before
        lengths[NOW, k], lengths[RATE, k] = now, (now - before) / h


@compiled_inside
def look_ahead(lengths: Floats, found: Floats, h: float) -> None:
    """Take rates from the end of a step that is not taken, because it is close to singular."""
    for k in range(lengths.shape[1]):
        lengths[RATE, k] = (found[k] - lengths[NOW, k]) / h


def begin_singular(work: Any, slope: Floats, first_step: float) -> None:
    """Give an integration the rates (n,) at its start, which are not those of its functions there.

    The first step is one of those near a singular state, with its stages on the constraints, and
    as long as may be: close to the state rates are known the worse.
    """
    work.k[0], work.h = slope, first_step
    work.first_stage_valid = 1
    work.lengths[NOW], work.lengths[RATE] = 0.0, np.finfo(float).tiny
