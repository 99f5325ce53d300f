"""Errors of a step that are rounding: no shorter step has less of them per unit of time.

The rates of a state are known no better than they change with its last digits. Where a body is thin
or far away, or a spring stiff, that is more than a tolerance asks for: a torque that is known to
1e-16 N m spins a wire of 1e-12 kg m^2 up at 1e-4 rad/s^2. A step that was made shorter and has no
less error per length is a sign of that: then the change is measured, and what of an error is h
times that is not counted. Where it is far below the tolerances nothing changes.

It is measured as the method propagates it (docs/decisions/0071): an implicit one damps the
rounding of a stiff direction (radau/error.py), and an explicit one takes no step in which
changes grow. A step may never be off by more than 1e-6 of the largest component of a kind for that.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.evaluate import zero
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration_state import Function
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: Least scale of an error: at atol = 0 a component that is exactly zero is not divided by zero.
SMALLEST_ATOL = 1e-290
#: A change of the last digit, how often some are tried, how many digits a projection moves.
DIGIT, SAMPLES, DIGITS_MOVED = 2.220446049250313e-16, 5, 100.0
#: Rounding errors in the estimate of an error, in those of one right-hand side: a sum over stages
#: whose weights add up to five or so in magnitude, each with several roundings.
ROUNDINGS = 6.0
#: Error per length that is left in a shorter step where it is rounding, at least.
SAME = 0.5
#: Rounding above this part of a tolerance counts.
COUNTS = 0.1
#: What is not counted of an error, as part of the largest component of its kind (r, p, v or w); the
#: rest may be as much again, so that a step is never off by more than 1e-6 for rounding.
LARGEST_EXCUSE = 5e-7
#: Steps after which it is measured again, and without a reason: control that has settled in the
#: noise gives none.
EVERY, PROBE = 8, 96


def tolerance_of(size: int, atol: ArrayLike, kinds: ArrayLike) -> Floats:
    """(TOLERANCES, n) the absolute tolerance of each component; nothing known of its rounding."""
    tolerance = np.zeros((at.TOLERANCES, size))
    tolerance[at.ABSOLUTE] = np.maximum(atol, SMALLEST_ATOL)
    first = np.asarray(kinds, dtype=np.int64)
    tolerance[at.KIND] = np.append(first, np.arange(len(first), size))
    return tolerance


@compiled_into
def update_rounding(
    work: Any, first: Floats, h: float, rejected: int, rhs: Function, system: Any, loops: Any
) -> None:
    """Measure the rounding of the rates where the last step, of length h, gives a reason to.

    first: the rates that the next step starts with. rejected: how many steps had failed before
    that one.
    """
    due = (
        work.step_count % PROBE == 0 and work.fixed_step == 0.0 and work.rejected_count == rejected
    )
    if not (work.rounding_state != 0 or (due and work.step_count != 0)):
        return
    if not can_measure(work, rejected):
        return
    work.rhs_count += SAMPLES + 2
    measure_noise(work, first, h, rhs, system, loops)
    judge_noise(work, h)


@compiled
def can_measure(work: Any, rejected: int) -> bool:
    """True if the rounding of rates can be measured, and was not in one of the last steps."""
    if work.status != at.RUNNING or work.first_stage_valid == 0:
        return False
    fails = work.rounding_state != 2 or work.rejected_count != rejected
    return fails or work.step_count % EVERY == 0


@compiled
def judge_noise(work: Any, h: float) -> None:
    """Bound what was measured in a step h; forget it where it is far below the tolerances."""
    y, tolerance, size = work.state[at.Y], work.tolerance, work.state[at.SCRATCH]
    zero(size)
    for i in range(y.size):
        first = int(tolerance[at.KIND, i])
        size[first] = max(size[first], abs(y[i]))
    work.rounding_state = 0
    for i in range(work.error_size):
        scale = tolerance[at.ABSOLUTE, i] + work.rtol * abs(y[i])
        if h * tolerance[at.NOISE, i] > COUNTS * scale:
            work.rounding_state = 2
    for i in range(y.size):
        tolerance[at.MOST, i] = LARGEST_EXCUSE * size[int(tolerance[at.KIND, i])]
        if work.rounding_state == 0:
            tolerance[at.NOISE, i] = 0.0


@compiled
def record_failure(work: Any, error: float, h: float, again: bool) -> None:
    """Record a step of length h that failed; again: the one before it had failed, too."""
    before, work.failed_error_rate = work.failed_error_rate, error / h
    if again and error / h > SAME * before:
        work.rounding_state = max(work.rounding_state, 1)


@compiled
def change_digits(y: Floats, sample: int, argument: Floats) -> None:
    """The state y with the last digit of each component up or down, into ``argument``.

    Without order, so that what cancels at y does not cancel here: a moment about a thin axis is the
    rounding of a sum that is zero, one of few values, and often the same as at y.
    """
    for i in range(y.size):
        up = (i * i + 3 * i * sample + 2 * sample + i) % 5 < 3
        argument[i] = y[i] * (1.0 + DIGIT) if up else y[i] * (1.0 - DIGIT)


@compiled
def find_rate_noise(work: Any, noise: Floats, rhs: Function, system: Any, loops: Any) -> None:
    """Changes of dy/dt at the state by the last digits of y; dy/dt itself into TRIAL."""
    y, argument, out, f = (
        work.state[at.Y],
        work.state[at.SCRATCH],
        work.state[at.OTHER],
        work.state[at.TRIAL],
    )
    rhs(work.t, y, f, system, loops)
    zero(noise)
    for sample in range(SAMPLES):
        change_digits(y, sample, argument)
        rhs(work.t, argument, out, system, loops)
        for i in range(y.size):
            noise[i] = max(noise[i], ROUNDINGS * abs(out[i] - f[i]))


@compiled
def measure_noise(
    work: Any, first: Floats, h: float, rhs: Function, system: Any, loops: Any
) -> None:
    """Uncertainty of dy/dt at the state in an explicit step h, into ``tolerance``.

    By the last digits of y, and by what these make of y itself in the step. Where that would grow
    in the step the step is longer than the method is stable for: it counts as if it did not.

    The rates that the next step starts with are those before the projection. They differ by what
    that moves: by last digits, which is rounding as well, or by a tolerance, which is none.
    """
    y, tolerance, noise = work.state[at.Y], work.tolerance, work.tolerance[at.NOISE]
    argument, out, f = work.state[at.SCRATCH], work.state[at.OTHER], work.state[at.TRIAL]
    find_rate_noise(work, noise, rhs, system, loops)
    for i in range(y.size):
        moved = ROUNDINGS * abs(first[i] - f[i])
        if noise[i] < moved <= DIGITS_MOVED * noise[i]:
            noise[i] = moved
    change_digits(y, SAMPLES, argument)
    for i in range(y.size):
        argument[i] += h * noise[i]
    rhs(work.t, argument, out, system, loops)
    before = after = 0.0
    for i in range(work.error_size):
        scale = tolerance[at.ABSOLUTE, i] + work.rtol * abs(y[i])
        before, after = max(before, noise[i] / scale), max(after, abs(out[i] - f[i]) / scale)
    growth = after / before if after > before > 0.0 else 1.0
    for i in range(y.size):
        noise[i] = max(noise[i], abs(out[i] - f[i]) / growth)
