"""The control of the step: its first length, its error, what follows from acceptance and rejection.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (HNW), II.4 and II.5, and
their codes DOPRI5 and DOP853.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math
from typing import Any

from dap3d_core.integrators.runge_kutta.tableau import Floats, Integers
from dap3d_core.integrators.stepping.integration_state import (
    BETA,
    DENSE,
    ERROR_OLD,
    ERROR_SIZE,
    ERRORS,
    EXPONENT,
    FACTOR_MAX,
    FACTOR_MIN,
    GAP_START,
    GAP_STEP,
    GAP_STEPS,
    LAST_REJECTED,
    LONGEST,
    NEXT,
    ORDER,
    REJECTED,
    RHS,
    RTOL,
    SAFETY,
    SCRATCH,
    STAGES,
    STATUS,
    STEP,
    STEPS,
    T_STOP,
    TRIAL,
    Function,
    H,
    T,
    Y,
)
from dap3d_core.integrators.stepping.vector_ops import combine, scaled_beyond, scaled_largest
from dap3d_core.kernels.runtime.cache import compiled_inside

#: A step is never shorter than this part of the time or of the whole span, sixteen roundings.
EPSILON = 2.220446049250313e-16
FLOOR = 16.0 * EPSILON
LARGEST = 1.7976931348623157e308
#: The last step is stretched by at most this factor, to end at t_end.
STRETCH = 1.01


@compiled_inside
def first_step(
    real: Floats,
    integer: Integers,
    times: Floats,
    y: Floats,
    k: Floats,
    y1: Floats,
    tolerance: Floats,
    rhs: Function,
    system: Any,
    loops: Any,
) -> float:
    """Starting step of HNW II.4: an Euler step guesses the second derivative. One call of rhs."""
    size, rtol = integer[ERROR_SIZE], real[RTOL]
    f, f1, floor = k[0], k[1], step_floor(real, times)
    t, t_end = real[T], times[-1]
    d0 = scaled_largest(y, y, y, size, rtol, tolerance, 0.0)
    d1 = scaled_largest(f, y, y, size, rtol, tolerance, 0.0)
    h = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    h = max(min(h, t_end - t), floor)
    for i in range(y.size):
        y1[i] = y[i] + h * f[i]
    integer[RHS] += 1
    rhs(min(t + h, t_end), y1, f1, system, loops)
    for i in range(y.size):
        f1[i] -= f[i]
    d2 = scaled_largest(f1, y, y, size, rtol, tolerance, 0.0) / h
    if not d2 <= LARGEST:
        return h
    largest = max(d1, d2)
    h1 = max(1e-6, h * 1e-3)
    if largest > 1e-15:
        h1 = (0.01 / largest) ** (1.0 / integer[ORDER])
    return max(min(100.0 * h, h1, t_end - t), floor)


@compiled_inside
def step_floor(real: Floats, times: Floats) -> float:
    """The shortest step at t."""
    return FLOOR * max(abs(real[T]), times[-1] - times[0])


@compiled_inside
def end_of_step(real: Floats, integer: Integers, times: Floats) -> float:
    """The time at which the step that comes next ends."""
    t, t_end, fixed = real[T], times[-1], real[STEP]
    if fixed == 0.0:
        h = min(real[H], real[LONGEST])
        return t_end if t + STRETCH * h >= t_end else t + h
    target = t_end if integer[DENSE] != 0 else times[integer[NEXT]]
    if integer[GAP_STEP] == integer[GAP_STEPS]:
        real[GAP_START] = t
        integer[GAP_STEP] = 0
        # a whole number of steps stays whole though its last digit is rounded
        integer[GAP_STEPS] = max(1, math.ceil((target - t) / fixed - 1e-9))
    done = integer[GAP_STEP] + 1
    if done == integer[GAP_STEPS]:
        return target
    start = real[GAP_START]
    return start + (target - start) * (done / integer[GAP_STEPS])


@compiled_inside
def error_norm(
    real: Floats,
    integer: Integers,
    state: Floats,
    k: Floats,
    table: Floats,
    tolerance: Floats,
    h: float,
) -> float:
    """Largest scaled error of the first components; 1 is just good enough.

    The largest, as in the manual's ode45, and not HNW's root mean square: in a scene of many bodies
    the mean would hide the error of the one that moves. Two estimates are combined as in HNW II.5:
    |e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2).
    """
    size, rtol = integer[ERROR_SIZE], real[RTOL]
    y, trial, error = state[Y], state[TRIAL], state[SCRATCH]
    first = k.shape[0]
    combine(error, 0.0, y, h, table, first, k)
    main = scaled_largest(error, y, trial, size, rtol, tolerance, h)
    if integer[ERRORS] == 1:
        return main
    combine(error, 0.0, y, h, table, first + 1, k)
    return joined(main, scaled_largest(error, y, trial, size, rtol, tolerance, h))


@compiled_inside
def beyond_rounding(
    real: Floats, integer: Integers, state: Floats, k: Floats, table: Floats, tolerance: Floats,
    h: float,
) -> float:  # fmt: skip
    """As ``error_norm``, of what is more than the rounding of time makes of the rates."""
    size, rtol, first = integer[ERROR_SIZE], real[RTOL], k.shape[0]
    y, trial, error, last = state[Y], state[TRIAL], state[SCRATCH], k[integer[STAGES] - 1]
    main, rounding = 0.0, EPSILON * max(abs(real[T]), abs(real[T] + h))
    for e in range(integer[ERRORS]):
        combine(error, 0.0, y, h, table, first + e, k)
        found = scaled_beyond(error, y, trial, k[0], last, rounding, size, rtol, tolerance)
        main = found if e == 0 else joined(main, found)
    return main


@compiled_inside
def joined(main: float, other: float) -> float:
    """One error from the estimates of order 5 and 3."""
    total = main * main + 0.01 * other * other
    if total == 0.0:
        return 0.0
    return main * main / math.sqrt(total)


@compiled_inside
def shrinkage(real: Floats, error: float) -> float:
    """The factor on a step whose error was too large."""
    return max(real[FACTOR_MIN], real[SAFETY] / error ** real[EXPONENT])


@compiled_inside
def accept(
    real: Floats,
    integer: Integers,
    times: Floats,
    state: Floats,
    k: Floats,
    t1: float,
    error: float,
) -> None:
    """Make the trial state the state, and choose the next step (PI controller of HNW's codes)."""
    h, result = t1 - real[T], integer[STAGES]
    real[T] = t1
    for i in range(state.shape[1]):
        state[Y, i] = state[TRIAL, i]
        k[0, i] = k[result, i]
    integer[STEPS] += 1
    if real[STEP] != 0.0:
        integer[GAP_STEP] += 1
        return
    divisor = error ** real[EXPONENT] / real[ERROR_OLD] ** real[BETA] / real[SAFETY]
    factor = min(real[FACTOR_MAX], max(real[FACTOR_MIN], 1.0 / max(divisor, 1e-30)))
    if integer[LAST_REJECTED] != 0:
        factor = min(factor, 1.0)
    integer[LAST_REJECTED] = 0
    real[ERROR_OLD] = max(error, 1e-4)
    real[H] = max(h * factor, step_floor(real, times))


@compiled_inside
def reject(
    real: Floats, integer: Integers, times: Floats, t1: float, shorter: float, cause: int
) -> None:
    """Try a shorter step again; at the floor, or where the step is fixed, stop for ``cause``."""
    integer[REJECTED] += 1
    integer[LAST_REJECTED] = 1
    real[H] = shorter
    if real[STEP] != 0.0 or shorter < step_floor(real, times):
        real[T_STOP], integer[STATUS] = t1, cause
