"""Adams methods: the formulas of one step, and the solution between two points.

Rates are kept as the divided differences Phi_j of HNW (Hairer, Norsett, Wanner, Solving Ordinary
Differential Equations I), III.5, whose recursions are those of Krogh; sigma and the comparison of
orders are those of Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975).
"""

from collections.abc import Container, Mapping
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.integrators.stepping.integration_state import (
    ABSOLUTE,
    MOST,
    MOST_COUNTED,
    NOISE,
    SCRATCH,
    TRIAL,
    IntegrationState,
    Y,
)
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import MATRIX, Scalar
from dap3d_core.kernels.runtime.cache import compiled

HIGHEST = 12
#: Rows of differences: up to one more than the order, from zero; one more for a right-hand side.
ROWS = HIGHEST + 3
#: Rows of ``table``. x_n - x_(n-j) for j = 1, ...; the same of the coming step; beta, g, sigma of
#: HNW (III.5.9, 5.10) and Shampine, Gordon; scratch; |gamma*_j|, error constants at equal steps;
#: g of an interpolation. Its row is its own: among equal steps the next step uses g once more.
PSI, PSI_NEXT, BETA_ROW, G_ROW, SIGMA, LINE, CONSTANT, WITHIN, TABLE_ROWS = range(9)
#: Two steps are equal to this part: t + h - t is not quite h.
EQUAL_TO = 1e-11


def _error_constants() -> Floats:
    """gamma*_j, j = 0, 1, ...: sum over i of gamma*_i / (j + 1 - i) = 0, HNW III (1.14)."""
    constants = np.zeros(ROWS + HIGHEST)
    constants[0] = 1.0
    for j in range(1, ROWS + 1):
        constants[j] = -sum(constants[i] / (j + 1 - i) for i in range(j))
    return np.abs(constants)


@attrs.define(eq=False, kw_only=True, slots=False)
class AdamsState(IntegrationState):
    """State of an integration by Adams methods; n components."""

    types: ClassVar[dict[str, Any]] = {
        **IntegrationState.types,
        **dict.fromkeys(("differences", "scaled", "table"), MATRIX),
    }

    next_order = Scalar[int]("integer")
    last_order = Scalar[int]("integer")
    equal_steps = Scalar[int]("integer")  # in a row, the coming one included
    is_starting = Scalar[int]("integer")
    failure_count = Scalar[int]("integer")  # of the coming step, in a row

    differences: Floats  # (ROWS, n) Phi_j at t, HNW (III.5.8)
    scaled: Floats  # (ROWS, n) Phi*_j = beta_j Phi_j; in the last row the rates at the prediction
    table: Floats  # (TABLE_ROWS, ROWS + HIGHEST)


def allowed_adams_integers(found: Mapping[str, int]) -> dict[str, Container[int]]:
    """Values of these integers between two chunks of a run, as ``allowed_integers`` has them."""
    return {
        "next_order": range(1 if found["first_stage_valid"] else 0, HIGHEST + 1),
        "last_order": range(HIGHEST + 1),
        "is_starting": (0, 1),
        **dict.fromkeys(("equal_steps", "failure_count"), range(MOST_COUNTED)),
    }


def make_table() -> Floats:
    """The table before the first step."""
    table = np.zeros((TABLE_ROWS, ROWS + HIGHEST))
    table[CONSTANT] = _error_constants()
    return table


@compiled
def update_coefficients(work: AdamsState, h: float, k: int) -> None:
    """beta, g and sigma of a step h; among equal steps they stay what they were."""
    table = work.table
    psi, following, beta, sigma = table[PSI], table[PSI_NEXT], table[BETA_ROW], table[SIGMA]
    if abs(h - psi[1]) > EQUAL_TO * h:
        work.equal_steps = 0
    elif work.equal_steps > HIGHEST + 1:
        return
    highest = k
    if work.equal_steps == HIGHEST + 1:  # from here on they are those of equal steps, of all orders
        highest = HIGHEST
        for j in range(1, highest + 2):
            psi[j] = j * h
    beta[0] = sigma[0] = 1.0
    following[1] = h
    for j in range(2, highest + 2):
        following[j] = h + psi[j - 1]
    for j in range(1, highest + 1):
        beta[j] = beta[j - 1] * (following[j] / psi[j])
        sigma[j] = sigma[j - 1] * (j * h / following[j])
    weights(table, h, highest)


@compiled
def weights(table: Floats, h: float, order: int) -> None:
    """g_j, j = 0 ... order, by c_j,q = c_j-1,q - c_j-1,q+1 h / psi_j: HNW (III.5.10)."""
    g, line, distance = table[G_ROW], table[LINE], table[PSI_NEXT]
    g[0] = 1.0
    for q in range(order + 1):
        line[q] = 1.0 / ((q + 1.0) * (q + 2.0))
    for j in range(1, order + 1):
        if j > 1:
            part = h / distance[j]
            for q in range(order + 1 - j):
                line[q] -= part * line[q + 1]
        g[j] = line[0]


@compiled
def predict(work: AdamsState, h: float, k: int) -> None:
    """Phi*_j; the prediction into TRIAL, the sum of Phi*_0 to Phi*_(k-1) into SCRATCH."""
    table, star, f, y = work.table, work.scaled, work.differences, work.state[Y]
    trial, total = work.state[TRIAL], work.state[SCRATCH]
    beta, g = table[BETA_ROW], table[G_ROW]
    for i in range(y.size):
        trial[i] = total[i] = 0.0
    j = 0
    while j + 1 < k:  # two at a time: sums are read and written half as often
        b0, b1, g0, g1 = beta[j], beta[j + 1], g[j], g[j + 1]
        for i in range(y.size):
            v0, v1 = b0 * f[j, i], b1 * f[j + 1, i]
            star[j, i], star[j + 1, i] = v0, v1
            total[i] += v0 + v1
            trial[i] += g0 * v0 + g1 * v1
        j += 2
    b0, b1 = beta[k - 1], beta[k]
    g0 = g[k - 1] if j < k else 0.0
    one = 1.0 if j < k else 0.0
    for i in range(y.size):
        v0 = b0 * f[k - 1, i]
        star[k - 1, i], star[k, i] = v0, b1 * f[k, i]
        total[i] += one * v0
        trial[i] = y[i] + h * (trial[i] + g0 * v0)


@compiled
def difference_norms(work: AdamsState, k: int, h: float) -> tuple[float, float, float]:
    """Scaled sizes of Phi_k, Phi_(k-1), Phi_(k-2) at the prediction; NaN where a number is none.

    What of them is rounding (stepping/rounding.py) is not counted.
    """
    size, star = work.error_size, work.scaled
    y, trial, change = work.state[Y], work.state[TRIAL], work.state[SCRATCH]
    rtol, tolerance, last, before = work.rtol, work.tolerance, k - 1, max(k - 2, 0)
    zero, one, two = 0.0, 0.0, 0.0
    for i in range(size):
        a, b = abs(y[i]), abs(trial[i])
        noise, wide = tolerance[NOISE, i], tolerance[ABSOLUTE, i] + rtol * (a if a > b else b)
        noise = min(noise, tolerance[MOST, i] / h)
        scale = 1.0 / (h * noise if h * noise > wide else wide)
        d0 = change[i]
        d1 = d0 + star[last, i]
        d2 = (abs(d1 + star[before, i]) - noise) * scale
        d0, d1 = (abs(d0) - noise) * scale, (abs(d1) - noise) * scale
        if not d0 <= zero:
            zero = d0
        if d1 > one:
            one = d1
        if d2 > two:
            two = d2
    return zero, one, two


@compiled
def compare_orders(
    table: Floats, h: float, k: int, sizes: tuple[float, float, float]
) -> tuple[float, float, bool]:
    """Errors of orders k and k - 1 at equal steps, and whether the lower one is to be taken."""
    sigma, constant = table[SIGMA], table[CONSTANT]
    here = h * sigma[k] * constant[k] * sizes[0]
    if k == 1:
        return here, 0.0, False
    below = h * sigma[k - 1] * constant[k - 1] * sizes[1]
    if k == 2:
        return here, below, below <= 0.5 * here
    return here, below, max(below, h * sigma[k - 2] * constant[k - 2] * sizes[2]) <= here


@compiled
def interpolate(work: AdamsState, back: float, out: Floats) -> None:
    """The solution at t + back, -h <= back <= 0: the integral of the polynomial through the rates.

    Shampine, Gordon, chapter 5 (their code INTRP); the order is one more than that of the step.
    """
    table, differences, last = work.table, work.differences, work.last_order + 1
    line, g, psi, y = table[LINE], table[WITHIN], table[PSI], work.state[Y]
    for q in range(last):
        line[q] = 1.0 / (q + 1.0)
    g[0], before = 1.0, 0.0
    for j in range(1, last):
        gamma, eta = (back + before) / psi[j], back / psi[j]
        for q in range(last - j):
            line[q] = gamma * line[q] - eta * line[q + 1]
        g[j], before = line[0], psi[j]
    for i in range(out.size):
        out[i] = 0.0
    for j in range(last - 1, -1, -1):
        for i in range(out.size):
            out[i] += g[j] * differences[j, i]
    for i in range(out.size):
        out[i] = y[i] + back * out[i]
