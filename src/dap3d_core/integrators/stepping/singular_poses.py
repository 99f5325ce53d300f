"""Steps across singular states, where the constraints lose rank for a moment.

``project`` gives singularity measures (one for each node of joints) that go linearly through zero
at a singular state. A step across has to keep its stages away from it: rounding of positions
changes the acceleration at distance d by rounding / d^3. So steps are cut such that the singular
state falls into the middle of the widest gap between the abscissae of the stages, and stages nearby
are evaluated on the constraints, where nothing but rounding is left of that error
(docs/decisions/0007).
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.integrators.stepping.integration_state import MEASURES
from dap3d_core.kernels.runtime.array_struct import Floats
from dap3d_core.kernels.runtime.cache import compiled

#: Rows of ``lengths``: measures at t, and their rates over the last step.
NOW, RATE = range(2)
#: The step before the one across leaves this part of the way to the middle of that one's gap.
SPARE = 0.95
#: A singular state less than this part of a step away from it is near.
MARGIN = 0.5


@compiled
def time_to_singularity(work: Any, h: float) -> float:
    """Time left until the next singular state; infinite where none is less than 2 h away."""
    left, lengths = np.inf, work.lengths
    for k in range(lengths.shape[1]):
        now, rate = lengths[NOW, k], lengths[RATE, k]
        if now + 2.0 * h * rate < 0.0:
            left = min(left, -now / rate)
    return left


@compiled
def limit_step_at_singularity(work: Any, h: float) -> float:
    """Length of a step that may have length h: h, or less to place a singular state in its gap."""
    left, gap = time_to_singularity(work, h), work.widest_gap_abscissa
    if not left < (1.0 + gap) * h:
        return h
    if left <= gap * h:
        return left / gap
    return min(h, left - SPARE * gap * h)


@compiled
def is_near_singularity(work: Any, h: float) -> bool:
    """True if a singular state lies in a step of length h, or close before or behind it."""
    found, lengths = 0, work.lengths
    for k in range(lengths.shape[1]):
        now, change = lengths[NOW, k], lengths[RATE, k] * h
        found |= (now < -(1.0 + MARGIN) * change) | (now < MARGIN * change)
    return found != 0


@compiled
def update_measures(work: Any, h: float) -> None:
    """Take over the measures at the end of a step; beyond zero they count from there."""
    lengths, found = work.lengths, work.real[MEASURES:]
    for k in range(lengths.shape[1]):
        before, now = lengths[NOW, k], found[k]
        if before + h * lengths[RATE, k] < 0.0:
            before = -before
        lengths[NOW, k], lengths[RATE, k] = now, (now - before) / h


@compiled
def predict_measures(work: Any, h: float) -> None:
    """Take rates from the end of a step that is not taken, because it is close to singular."""
    lengths, found = work.lengths, work.real[MEASURES:]
    for k in range(lengths.shape[1]):
        lengths[RATE, k] = (found[k] - lengths[NOW, k]) / h


def begin_singular(work: Any, slope: Floats, first_step: float) -> None:
    """Set the rates (n,) at the start of an integration, instead of those of its functions.

    The first step is one of those near a singular state, with its stages on the constraints, and
    as long as may be: close to the state rates are known the worse.
    """
    work.k[0], work.h = slope, first_step
    work.first_stage_valid = 1
    work.lengths[NOW], work.lengths[RATE] = 0.0, np.finfo(float).tiny
