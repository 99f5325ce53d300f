"""Vector operations of a step: norms of errors, interpolation."""

import math

from dap3d_core.assembly.evaluate import copy
from dap3d_core.integrators.stepping.integration_state import ABSOLUTE, MOST, NOISE
from dap3d_core.kernels.array_types import Floats, SeparateFloats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import values_alone, where

#: Larger numbers leave double precision in products such as m v^2: they end a run before an energy
#: of it becomes infinite. What a scene may give has the same bound (validate/coerce_values.py).
_LARGEST = 1e100
#: Beyond this magnitude a state is close to a pole, not in a short transition.
POLE = 1e12
NAN = math.nan


@compiled
def all_finite(x: Floats) -> bool:
    """True if no component is NaN, infinite, or larger than 1e100."""
    bad = 0
    for i in range(x.size):
        bad |= not (abs(x[i]) <= _LARGEST)
    return bad == 0


@compiled
def scaled_largest(
    ratios: SeparateFloats,
    x: Floats,
    y0: Floats,
    y1: Floats,
    size: int,
    rtol: float,
    tolerance: Floats,
    h: float,
    least: float = 0.0,
) -> float:
    """``max |x_i| / (atol_i + rtol max(|y0_i|, |y1_i|))`` over i < ``size``; NaN if one is NaN.

    What of x_i is rounding of a step h (rounding.py) is not counted, and the rest is compared with
    no less than that; atol_i is ``least`` or more. ``ratios`` is scratch.
    """
    values_alone()
    for i in range(size):
        a, b = abs(y0[i]), abs(y1[i])
        atol = tolerance[ABSOLUTE, i]
        scale = where(atol > least, atol, least) + rtol * where(a > b, a, b)
        noise, most = h * tolerance[NOISE, i], tolerance[MOST, i]
        noise = where(most < noise, most, noise)
        ratios[i] = (abs(x[i]) - noise) / where(noise > scale, noise, scale)
    largest, unknown = 0.0, 0
    for i in range(size):
        ratio = ratios[i]
        largest = where(ratio > largest, ratio, largest)
        unknown |= ratio != ratio
    return largest if unknown == 0 else NAN


@compiled
def scaled_beyond(
    x: Floats, y0: Floats, y1: Floats, f0: Floats, f1: Floats, dt: float, size: int, rtol: float,
    tolerance: Floats,
) -> float:  # fmt: skip
    """As ``scaled_largest``; rates f0, f1 make dt max(|f0_i|, |f1_i|) of a doubt dt of time.

    Close to a pole that excuses nothing.
    """
    values_alone()
    largest, most = 0.0, 0.0
    for i in range(size):
        most = max(most, abs(y0[i]), abs(y1[i]))
    if most > POLE:
        dt = 0.0
    for i in range(size):
        doubt = dt * max(abs(f0[i]), abs(f1[i]))
        scale = tolerance[ABSOLUTE, i] + rtol * max(abs(y0[i]), abs(y1[i]))
        ratio = abs(x[i]) / (scale + doubt)
        largest = where((ratio > largest) | (ratio != ratio), ratio, largest)
    return largest


@compiled
def interpolate(out: SeparateFloats, terms: Floats, theta: float) -> None:
    """Dense output at ``t + theta h`` out of its terms r (rows):

    ``r0 + theta (r1 + (1 - theta) (r2 + theta (r3 + (1 - theta) (r4 + ...))))``, HNW I (II.6.12).
    """
    last = terms.shape[0] - 1
    copy(out, terms[last])
    for row in range(last - 1, -1, -1):
        factor = theta if row % 2 == 0 else 1.0 - theta
        for i in range(out.size):
            out[i] = terms[row, i] + factor * out[i]
