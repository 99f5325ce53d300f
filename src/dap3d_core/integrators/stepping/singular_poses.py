"""Steps across singular states, where the constraints lose rank for a moment.

``project`` gives singularity measures (one for each node of joints) that go through zero at a
singular state: with the distance d, where one singular value vanishes, with a power of d where
several do at once. Its last three values tell when (docs/decisions/0032).

A step across has to keep its stages away from the singular state: rounding of positions changes the
acceleration at distance d by rounding / d^3. So steps are cut such that the singular state falls
into the middle of the widest gap between the abscissae of the stages, and stages nearby are
evaluated on the constraints, where nothing but rounding is left of that error
(docs/decisions/0007).
"""

import math
from typing import Any

import numpy as np

from dap3d_core.integrators.stepping.integration_state import MEASURES
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ldlt.factor import SINGULAR_NODE_RATIO

#: Rows of ``lengths``: measures at t; their mean rates until they vanish, or over the last step;
#: those over the last step; its length; when they vanish, where a stage has shown that.
NOW, RATE, SLOPE, STEP, WHEN, ROWS = range(6)
#: A measure that has fallen to this part in a step is prolonged by more than its rate.
FALLEN = 2.0 / 3.0
#: The step before the one across leaves this part of the way to the middle of that one's gap.
SPARE = 0.95
#: A singular state less than this part of a step away from it is near.
MARGIN = 0.5
#: Measures of poses that are close to a singular one are below this (linear/ldlt/factor.py).
CLOSE = math.sqrt(SINGULAR_NODE_RATIO)
#: A state at this part of the distance at the start of a step, or less, is at the singular one.
AT_SINGULARITY = 0.05


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
    least = least_time_to_singularity(work, left)
    if least < left:
        return min(h, max(least - SPARE * gap * h, 0.5 * least))
    return min(h, left - SPARE * gap * h)


@compiled
def least_time_to_singularity(work: Any, left: float) -> float:
    """The same time, which is ``left``, by the rates of the last step: no measure falls faster."""
    least, lengths = left, work.lengths
    for k in range(lengths.shape[1]):
        if lengths[SLOPE, k] < lengths[RATE, k] < 0.0 and not lengths[WHEN, k] > work.t:
            least = min(least, -lengths[NOW, k] / lengths[SLOPE, k])
    return least


@compiled
def is_near_singularity(work: Any, h: float) -> bool:
    """True if a singular state lies in a step of length h, or close before or behind it."""
    found, lengths = 0, work.lengths
    for k in range(lengths.shape[1]):
        now, change = lengths[NOW, k], lengths[RATE, k] * h
        found |= (now < -(1.0 + MARGIN) * change) | (now < MARGIN * change)
    return found != 0


@compiled
def rate_to_zero(
    earlier: float, rate: float, before: float, now: float, step: float, h: float
) -> float:
    """Mean rate of a measure from now until it vanishes; over the last step where it is not near.

    A measure that falls ever slower is prolonged by the parabola through its last three values, as
    far as its vertex.

    earlier, rate: mean rates over two steps in a row, of the lengths step and h. before, now:
    values at the ends of the second one.
    """
    bend = (rate - earlier) / (step + h)
    if not (0.0 < now < FALLEN * before and earlier < 0.0 and bend > 0.0):
        return rate
    slope = rate + bend * h
    inside = max(0.0, slope * slope - 4.0 * bend * now)
    return max(rate, 0.5 * (slope - math.sqrt(inside)))


@compiled
def update_measures(work: Any, h: float) -> None:
    """Take over the measures at the end of a step; beyond zero they count from there."""
    lengths, found = work.lengths, work.real[MEASURES:]
    for k in range(lengths.shape[1]):
        before, now, left = lengths[NOW, k], found[k], lengths[WHEN, k] - (work.t + h)
        slope = rate = (now - before) / h
        if left > 0.0:
            rate = -now / left
        elif before + h * lengths[RATE, k] < 0.0:
            slope, lengths[WHEN, k] = (now + before) / h, np.nan
            rate = slope
        else:
            rate = rate_to_zero(lengths[SLOPE, k], slope, before, now, lengths[STEP, k], h)
        lengths[NOW, k], lengths[RATE, k] = now, rate
        lengths[SLOPE, k], lengths[STEP, k] = slope, h


@compiled
def predict_measures(work: Any, h: float) -> None:
    """Take rates from the end of a step that is not taken, because it is close to singular."""
    lengths, found = work.lengths, work.real[MEASURES:]
    for k in range(lengths.shape[1]):
        now, ahead = lengths[NOW, k], found[k]
        if not lengths[WHEN, k] > work.t:
            slope = (ahead - now) / h
            rate = rate_to_zero(lengths[SLOPE, k], slope, now, ahead, lengths[STEP, k], h)
            if rate < 0.0:
                rate = -now / (h - ahead / rate)
            lengths[RATE, k] = rate


@compiled
def is_at_singularity(work: Any) -> bool:
    """True at a singular state from which a run starts (``begin_singular``)."""
    lengths, count = work.lengths, 0
    for k in range(lengths.shape[1]):
        count |= lengths[NOW, k] == 0.0
    return count != 0


@compiled
def is_approaching(work: Any) -> bool:
    """True if a measure that is close to zero at the state projected last was not less at t.

    Also at the start of a run from a singular state, whose first step shall lead away from it.
    """
    lengths, found, count = work.lengths, work.real[MEASURES:], 0
    if is_at_singularity(work):
        return True
    for k in range(lengths.shape[1]):
        count |= found[k] < CLOSE and not found[k] >= lengths[NOW, k]
    return count != 0


@compiled
def record_singularity(work: Any, h: float) -> bool:
    """Take the state that was projected last, h from the start, for singular if it is; whether so.

    Measures are compared by the power of the distance with which they fall, seen from the start.
    """
    lengths, found, count = work.lengths, work.real[MEASURES:], 0
    for k in range(lengths.shape[1]):
        power = lengths[SLOPE, k] / lengths[RATE, k]
        if found[k] < AT_SINGULARITY ** max(1.0, min(2.0, power)) * lengths[NOW, k]:
            lengths[RATE, k], lengths[WHEN, k] = -lengths[NOW, k] / h, work.t + h
            count += 1
    return count != 0


def begin_singular(work: Any, slope: Floats, first_step: float) -> None:
    """Set the rates (n,) at the start of an integration, instead of those of its functions.

    The first step is one of those near a singular state, with its stages on the constraints, and
    as long as may be: close to the state rates are known the worse.
    """
    work.k[0], work.h = slope, first_step
    work.first_stage_valid = 1
    forget_measures(work)
    work.lengths[NOW], work.lengths[RATE] = 0.0, np.finfo(float).tiny


def forget_measures(work: Any) -> None:
    """Start the measures anew: nothing is known of them."""
    work.lengths[:] = np.nan
