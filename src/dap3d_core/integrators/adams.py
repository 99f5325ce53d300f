"""Adams methods of order 1 to 12 with variable step: predict, evaluate, correct, evaluate.

Two right-hand sides a step, whatever the order: the choice for long smooth motions at tight
tolerances. Order and step are chosen together; a run starts itself with order 1.

Sources: Shampine, Gordon, Computer Solution of Ordinary Differential Equations (1975), chapters 5
to 7 (their code STEP: order selection, doubling of steps, start); Hairer, Norsett, Wanner, Solving
Ordinary Differential Equations I (HNW), III.5 (recursions of Krogh for divided differences, in
whose notation this is written) and III.7.
"""

import math
from collections.abc import Container, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.evaluate import zero
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping import step_control
from dap3d_core.integrators.stepping.event_location import (
    end_is_across,
    is_sample_across,
    next_length,
    update_switches_after_step,
)
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import Function, IntegrationState
from dap3d_core.integrators.stepping.output import project_state
from dap3d_core.integrators.stepping.restore import restored
from dap3d_core.integrators.stepping.rounding import record_failure
from dap3d_core.integrators.stepping.switch_values import evaluate
from dap3d_core.integrators.stepping.vector_ops import all_finite, scaled_beyond, scaled_largest
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import Matrix, Scalar
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where, with_slopes

#: The first step is no longer part of the run: one of order 1 sees nothing of what comes to rest.
FIRST_PART = 0.01
#: The step is doubled, kept, or multiplied by a factor in between these.
SLOWEST, STEADY = 0.5, 0.9
#: The error that a next step is planned for, and how often a step fails before order 1 is taken.
PLANNED, PATIENCE = 0.5, 3
#: What each step keeps of the length of those before, which doubles anew where a switch cut one.
KEPT = 0.99
#: The highest order.
HIGHEST = 12
#: Rows of differences: up to one more than the order, from zero; one more for a right-hand side.
ROWS = HIGHEST + 3
#: Rows of ``table``. x_n - x_(n-j) for j = 1, ...; the same of the coming step; beta, g, sigma of
#: HNW (III.5.9, 5.10) and Shampine, Gordon; scratch; |gamma*_j|, error constants at equal steps;
#: g of an interpolation. Its row is its own: among equal steps the next step uses g once more.
PSI, PSI_NEXT, BETA_ROW, G_ROW, SIGMA, LINE, CONSTANT, WITHIN, TABLE_ROWS = range(9)
#: Two steps are equal to this part: t + h - t is not quite h.
EQUAL_TO = 1e-11


@attrs.define(eq=False, kw_only=True, slots=False)
class AdamsState(IntegrationState):
    """State of an integration by Adams methods; n components."""

    next_order = Scalar[int]("integer")
    last_order = Scalar[int]("integer")
    equal_steps = Scalar[int]("integer")  # in a row, the coming one included
    is_starting = Scalar[int]("integer")
    failure_count = Scalar[int]("integer")  # of the coming step, in a row

    differences: Matrix  # (ROWS, n) Phi_j at t, HNW (III.5.8)
    scaled: Matrix  # (ROWS, n) Phi*_j = beta_j Phi_j; in the last row the rates at the prediction
    table: Matrix  # (TABLE_ROWS, ROWS + HIGHEST)


def make_table() -> Floats:
    """The table before the first step."""
    table = np.zeros((TABLE_ROWS, ROWS + HIGHEST))
    constants = table[CONSTANT]  # sum over i of gamma*_i / (j + 1 - i) = 0, HNW III (1.14)
    constants[0] = 1.0
    for j in range(1, ROWS + 1):
        constants[j] = -sum(constants[i] / (j + 1 - i) for i in range(j))
    table[CONSTANT] = np.abs(constants)
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
    table, star, f, y = work.table, work.scaled, work.differences, work.state[at.Y]
    trial, total = work.state[at.TRIAL], work.state[at.SCRATCH]
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
    y, trial, change = work.state[at.Y], work.state[at.TRIAL], work.state[at.SCRATCH]
    rtol, tolerance, last, before = work.rtol, work.tolerance, k - 1, max(k - 2, 0)
    zero, one, two = 0.0, 0.0, 0.0
    for i in range(size):
        a, b = abs(y[i]), abs(trial[i])
        noise, wide = tolerance[at.NOISE, i], tolerance[at.ABSOLUTE, i] + rtol * (a if a > b else b)
        noise = min(noise, tolerance[at.MOST, i] / h)
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
    line, g, psi, y = table[LINE], table[WITHIN], table[PSI], work.state[at.Y]
    for q in range(last):
        line[q] = 1.0 / (q + 1.0)
    g[0], before = 1.0, 0.0
    for j in range(1, last):
        gamma, eta = (back + before) / psi[j], back / psi[j]
        for q in range(last - j):
            line[q] = gamma * line[q] - eta * line[q + 1]
        g[j], before = line[0], psi[j]
    zero(out)
    for j in range(last - 1, -1, -1):
        for i in range(out.size):
            out[i] += g[j] * differences[j, i]
    for i in range(out.size):
        out[i] = y[i] + back * out[i]


@compiled
def advance_adams(
    work: AdamsState, functions: Sequence[Function], system: Any, loops: Any, budget: int
) -> None:
    """Integrate as ``runge_kutta.advance`` does; functions and budget as there."""
    first = work.differences[0]
    step_control.advance_by(
        step, state_at, work, first, functions, system, loops, budget, step_control.FROM_END
    )


@compiled
def state_at(work: AdamsState, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by the polynomial of the method."""
    interpolate(work, t - work.t, y)


@compiled
def begin(work: AdamsState, rhs: Function, system: Any, loops: Any) -> None:
    """The rates at the start, the first step, order 1."""
    f = work.differences
    y = work.state[at.Y]
    work.rhs_count += 1
    rhs(work.t, y, f[0], system, loops)
    work.first_stage_valid = 1
    if not all_finite(f[0]):
        work.t_stop, work.status = work.t, at.NOT_FINITE
        return
    if work.h == 0.0:
        longest = FIRST_PART * (work.times[-1] - work.times[0])
        work.h = with_slopes(
            min(step_control.first_step(work, f, rhs, system, loops), longest), 0.0
        )
    zero(f[1])
    for j in range(ROWS):
        work.table[PSI, j] = j * work.h
    work.next_order, work.is_starting, work.equal_steps = 1, 1, 0


@compiled
def step(work: AdamsState, functions: Any, system: Any, loops: Any) -> None:
    """Try one step: accept it, reject it, or stop the run; functions as ``advance`` has them."""
    rhs, project, accepted, watch = functions
    if work.first_stage_valid == 0:
        begin(work, rhs, system, loops)
        if work.status != at.RUNNING:
            return
    t, k, end = work.t, work.next_order, step_control.end_of_step(work)
    t1 = min(end, work.step_limit)
    h = t1 - t
    if work.switch_count != 0:
        h = min(h, next_length(work, end, work.differences[0], rhs, project, watch, system, loops))
        if h == 0.0:
            return
        t1 = t1 if h == t1 - t else t + h
    update_coefficients(work, h, k)
    predict(work, h, k)
    trial, table = work.state[at.TRIAL], work.table
    if work.switch_count != 0 and is_sample_across(work, t1, t1 - t, trial, watch, system, loops):
        return
    rates, change = work.scaled[ROWS - 1], work.state[at.SCRATCH]
    work.rhs_count += 1
    rhs(t1, trial, rates, system, loops)
    for i in range(trial.size):
        change[i] = rates[i] - change[i]  # Phi_k at t1
    sizes = difference_norms(work, k, h)
    error = error_of(work, t1, h, k, sizes[0])
    here, below, lower = compare_orders(table, h, k, sizes)
    if error <= 1.0:
        g = h * table[G_ROW, k]
        for i in range(trial.size):
            trial[i] += g * change[i]
        failure = project_state(work, t1, trial, project, system, loops)
        if failure != at.RUNNING:
            reject(work, t1, h, 1, 0.1, failure)
        elif complete_step(work, t1, rhs, project, watch, system, loops):
            if step_control.turns_are_certain(work, t1, accepted, system, loops):
                accept(work, t1, k, here, below, lower)
            else:
                reject(work, t1, h, k, step_control.STEP_FOR_TURNS, at.STEP_FLOOR)
    elif error <= step_control.LARGEST:
        record_failure(work, error, h, work.failure_count != 0)
        work.failure_count += 1
        factor = SLOWEST
        if work.failure_count > PATIENCE:
            factor = max(0.1, min(SLOWEST, math.sqrt(PLANNED / here)))
        order = k - 1 if lower else k
        reject(work, t1, h, 1 if work.failure_count >= PATIENCE else order, factor, at.STEP_FLOOR)
    else:
        reject(work, t1, h, 1, 0.1, at.NOT_FINITE)


@compiled
def error_of(work: AdamsState, t1: float, h: float, k: int, size: float) -> float:
    """Error of a step to t1 whose Phi_k has a scaled size; up to 1.0 it is good enough."""
    table, change, rates = work.table, work.state[at.SCRATCH], work.scaled[ROWS - 1]
    weight = h * abs(table[G_ROW, k - 1] - table[G_ROW, k])
    error = weight * size
    if 1.0 < error <= step_control.LARGEST and h * SLOWEST < step_control.step_floor(work):
        y, trial, f0 = work.state[at.Y], work.state[at.TRIAL], work.differences[0]
        doubt = step_control.EPSILON * max(abs(work.t), abs(t1))
        found = scaled_beyond(
            change, y, trial, f0, rates, doubt, work.error_size, work.rtol, work.tolerance
        )
        error = min(error, error * (found / size))
    of_work = step_control.work_error(work, h, weight * change[change.size - 1])
    return where(of_work > error, of_work, error)


@compiled
def complete_step(
    work: AdamsState, t1: float, rhs: Function, project: Function, watch: Function, system: Any,
    loops: Any,
) -> bool:  # fmt: skip
    """The rates at the trial state; False where they are not finite, or it lies across a switch."""
    rates = work.scaled[ROWS - 1]
    trial, total, watched = work.state[at.TRIAL], work.state[at.SCRATCH], work.switch_count != 0
    for i in range(trial.size):
        total[i] = rates[i] - total[i]  # the sum of Phi*_j again
    if watched:  # before f, as of runge_kutta/step.py
        evaluate(work, t1, trial, at.FOUND, watch, system, loops)
    if watched or t1 < work.times[-1] or work.times[work.next_report] < t1:
        work.rhs_count += 1
        rhs(t1, trial, rates, system, loops)
        if not all_finite(rates):
            work.t_stop, work.status = t1, at.NOT_FINITE
            return False
    return not (watched and end_is_across(work, t1, rates, project, watch, system, loops))


@compiled
def accept(work: AdamsState, t1: float, k: int, here: float, below: float, lower: bool) -> None:
    """Make the trial state the state; its differences; order and length of what comes."""
    star, f = work.scaled, work.differences
    y, trial, total, rates = (
        work.state[at.Y],
        work.state[at.TRIAL],
        work.state[at.SCRATCH],
        star[ROWS - 1],
    )
    h = t1 - work.t
    for i in range(y.size):
        y[i] = trial[i]
        difference = rates[i] - total[i]
        f[k, i], f[k + 1, i] = difference, difference - star[k, i]
    for j in range(k - 1, -1, -1):
        for i in range(y.size):
            f[j, i] = f[j + 1, i] + star[j, i]
    for j in range(1, k + 2):
        work.table[PSI, j] = work.table[PSI_NEXT, j]
    work.table[PSI, 0] = 0.0
    work.t = t1
    work.step_count += 1
    work.equal_steps += 1
    work.failure_count, work.last_order = 0, k
    work.uncut_step = max(h, KEPT * work.uncut_step)
    plan(work, h, k, here, below, lower)
    update_switches_after_step(work, h, h, t1)


@compiled
def plan(work: AdamsState, h: float, k: int, here: float, below: float, lower: bool) -> None:
    """Order and length of the next step (Shampine, Gordon, chapter 7; their code STEP, block 4)."""
    f = work.differences
    if lower or k == HIGHEST:
        work.is_starting = 0
    order, error = k, here
    if work.is_starting != 0:
        order, error = k + 1, 0.0
    elif lower:
        order, error = k - 1, below
    elif work.equal_steps > k:
        y = work.state[at.Y]
        highest = work.state[at.OTHER]
        for i in range(y.size):
            highest[i] = h * f[k + 1, i]
        size = work.error_size
        above = work.table[CONSTANT, k + 1] * scaled_largest(
            work.state[at.SCRATCH], highest, y, y, size, work.rtol, work.tolerance, h
        )
        if k > 1 and below <= min(here, above):
            order, error = k - 1, below
        elif k < HIGHEST and above < (here if k > 1 else 0.5 * here):
            order, error = k + 1, above
    work.next_order = order
    factor = 2.0
    if error * 2.0 ** (order + 1) > PLANNED:
        factor = 1.0
        if error > PLANNED:
            factor = max(SLOWEST, min(STEADY, (PLANNED / error) ** (1.0 / (order + 1))))
    work.h = max(h * factor, step_control.step_floor(work))


@compiled
def reject(work: AdamsState, t1: float, h: float, order: int, factor: float, cause: int) -> None:
    """Try a shorter step again, of another order perhaps; at the floor, stop for ``cause``."""
    work.is_starting, work.equal_steps, work.next_order = 0, 0, order
    step_control.reject(work, t1, h * factor, cause)


class AdamsIntegration(Integration):
    """An initial value problem, integrated by Adams methods of order 1 to 12.

    Parameters
    ----------
    args, options
        As for ``Integration``; steps near singular states are not placed.
    step
        Must be None: order and step are chosen together.

    Raises
    ------
    ValueError
        For a fixed step; for times, sizes or tolerances that make no sense.
    """

    name = "adams"
    state_class = AdamsState
    takes_programs = True
    keeps_step = False
    loop = staticmethod(advance_adams)

    def __init__(self, *args: Any, step: float | None = None, **options: Any) -> None:
        if step is not None:
            raise ValueError(
                f"adams chooses order and step together and takes no step ({step}); "
                "leave step out, or take rk4, dopri5 or dop853"
            )
        super().__init__(*args, **options)
        self.work.order = 2  # a first step of order 1

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``."""
        return {
            "differences": np.zeros((ROWS, size)),
            "scaled": np.zeros((ROWS, size)),
            "table": make_table(),
        }

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``; here the table holds the times of past rates."""
        return [*super().state_arrays(), self.work.table]

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Integration.restored``."""
        if name == "table":
            return restored(name, array, found, (CONSTANT,))
        return super().restored(name, array, found)

    def allowed_integers(self, found: Mapping[str, int]) -> dict[str, Container[int]]:
        """As ``Integration.allowed_integers``."""
        return super().allowed_integers(found) | {
            "next_order": range(1 if found["first_stage_valid"] else 0, HIGHEST + 1),
            "last_order": range(HIGHEST + 1),
            "is_starting": (0, 1),
        }

    def state_within(self, t: float) -> Floats | None:
        """As ``Integration.state_within``."""
        if self.work.first_stage_valid == 0 or self.work.step_count == 0:
            return None
        return self._interpolated(state_at, t)

    @property
    def dy_dt(self) -> Floats | None:
        """(n,) dy/dt at ``t``, a copy; None where it is not known."""
        if self.work.first_stage_valid == 0:
            return None
        return self.work.differences[0].copy()
