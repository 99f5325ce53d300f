"""Vector operations of a step: sums over stages, the norm of the error, interpolation.

Loops run over the components innermost, four stages at a time, so that a sum of many stages reads
and writes its result a few times only; the terms come from ``tableau.combinations``.
"""

from dap3d_core.integrators.stepping.integration_state import ABSOLUTE, MOST, NOISE
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where

#: Terms of a linear combination of stages that are added in one pass over the components.
GROUP = 4
#: Columns of a row of such terms: number of groups; then for each group its weights and the stages
#: that they belong to.
GROUPS, TERMS = 1, 2
#: Larger numbers leave double precision in products such as m v^2: they end a run before an energy
#: of it becomes infinite. What a scene may give has the same bound (validate/coerce_values.py).
_LARGEST = 1e100
#: Beyond this magnitude a state is close to a pole, not in a short transition.
POLE = 1e12


@compiled
def combine(
    out: Floats, share: float, y: Floats, h: float, table: Floats, row: int, k: Floats
) -> None:
    """``out = share y + h sum_j weight_j k[j]``; y is added last, which rounds least."""
    terms = table[row]
    for group in range(int(terms[GROUPS])):
        j = TERMS + 2 * GROUP * group
        w0, w1, w2, w3 = terms[j], terms[j + 1], terms[j + 2], terms[j + 3]
        j0, j1, j2, j3 = int(terms[j + 4]), int(terms[j + 5]), int(terms[j + 6]), int(terms[j + 7])
        if group == 0:
            for i in range(out.size):
                out[i] = w0 * k[j0, i] + w1 * k[j1, i] + w2 * k[j2, i] + w3 * k[j3, i]
        else:
            for i in range(out.size):
                out[i] += w0 * k[j0, i] + w1 * k[j1, i] + w2 * k[j2, i] + w3 * k[j3, i]
    for i in range(out.size):
        out[i] = share * y[i] + h * out[i]


@compiled
def copy(out: Floats, x: Floats) -> None:
    """``out = x``; they may be the same row."""
    for i in range(out.size):
        out[i] = x[i]


@compiled
def all_finite(x: Floats) -> bool:
    """True if no component is NaN, infinite, or larger than 1e100."""
    bad = 0
    for i in range(x.size):
        bad |= not (abs(x[i]) <= _LARGEST)
    return bad == 0


@compiled
def scaled_largest(
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
    no less than that; atol_i is ``least`` or more.
    """
    largest = 0.0
    for i in range(size):
        a, b = abs(y0[i]), abs(y1[i])
        atol = tolerance[ABSOLUTE, i]
        scale = (atol if atol > least else least) + rtol * (a if a > b else b)
        noise = min(h * tolerance[NOISE, i], tolerance[MOST, i])
        ratio = (abs(x[i]) - noise) / (noise if noise > scale else scale)
        largest = where((ratio > largest) | (ratio != ratio), ratio, largest)
    return largest


@compiled
def scaled_beyond(
    x: Floats, y0: Floats, y1: Floats, f0: Floats, f1: Floats, dt: float, size: int, rtol: float,
    tolerance: Floats,
) -> float:  # fmt: skip
    """As ``scaled_largest``; rates f0, f1 make dt max(|f0_i|, |f1_i|) of a doubt dt of time.

    Close to a pole that excuses nothing.
    """
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
def interpolate(out: Floats, terms: Floats, theta: float) -> None:
    """Dense output at ``t + theta h`` out of its terms r (rows):

    ``r0 + theta (r1 + (1 - theta) (r2 + theta (r3 + (1 - theta) (r4 + ...))))``, HNW I (II.6.12).
    """
    last = terms.shape[0] - 1
    for i in range(out.size):
        out[i] = terms[last, i]
    for row in range(last - 1, -1, -1):
        factor = theta if row % 2 == 0 else 1.0 - theta
        for i in range(out.size):
            out[i] = terms[row, i] + factor * out[i]
