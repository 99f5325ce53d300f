"""Errors of a step that are rounding: no shorter step has less of them per unit of time.

The rates of a state are known no better than they change with its last digits. Where a body is thin
or far away, or a spring stiff, that is more than a tolerance asks for: a torque that is known to
1e-16 N m spins a wire of 1e-12 kg m^2 up at 1e-4 rad/s^2. A step that was made shorter and has no
less error per length is a sign of that: then the change is measured, and what of an error is h
times that is not counted. Where it is far below the tolerances nothing changes.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.integrators.stepping.integration_state import (
    ABSOLUTE,
    NOISE,
    OTHER,
    RUNNING,
    SCRATCH,
    TOLERANCES,
    Function,
    Y,
)
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: Least scale of an error: at atol = 0 a component that is exactly zero is not divided by zero.
SMALLEST_ATOL = 1e-290
#: A change of the last digit, and how often one is tried.
DIGIT, SAMPLES = 2.220446049250313e-16, 3
#: Rounding errors in the estimate of an error, in those of one right-hand side: a sum over stages
#: whose weights add up to five or so in magnitude, each with several roundings.
ROUNDINGS = 6.0
#: Error per length that is left in a shorter step where it is rounding, at least.
SAME = 0.5
#: Rounding above this part of a tolerance counts.
COUNTS = 0.1
#: Steps after which it is measured again, and without a reason: control that has settled in the
#: noise gives none.
EVERY, PROBE = 8, 96


def tolerance_of(size: int, atol: ArrayLike) -> Floats:
    """(TOLERANCES, n) the absolute tolerance of each component; nothing known of its rounding."""
    tolerance = np.zeros((TOLERANCES, size))
    tolerance[ABSOLUTE] = np.maximum(atol, SMALLEST_ATOL)
    return tolerance


@compiled_into
def update_rounding(
    work: Any, f: Floats, h: float, rejected: int, rhs: Function, system: Any, loops: Any
) -> None:
    """Measure the rounding of the rates where the last step, of length h, gives a reason to.

    f: dy/dt at the state. rejected: how many steps had failed before that one.
    """
    due = (
        work.step_count % PROBE == 0 and work.fixed_step == 0.0 and work.rejected_count == rejected
    )
    if not (work.rounding_state != 0 or (due and work.step_count != 0)):
        return
    if work.status != RUNNING or work.first_stage_valid == 0:
        return
    if (
        work.rounding_state == 2
        and work.rejected_count == rejected
        and work.step_count % EVERY != 0
    ):
        return
    tolerance, argument, out = work.tolerance, work.state[SCRATCH], work.state[OTHER]
    work.rhs_count += SAMPLES + 1
    measure_noise(work.t, work.state[Y], f, h, tolerance, argument, out, rhs, system, loops)
    work.rounding_state = 0
    for i in range(work.error_size):
        scale = tolerance[ABSOLUTE, i] + work.rtol * abs(work.state[Y, i])
        if h * tolerance[NOISE, i] > COUNTS * scale:
            work.rounding_state = 2
    if work.rounding_state == 0:
        for i in range(argument.size):
            tolerance[NOISE, i] = 0.0


@compiled
def record_failure(work: Any, error: float, h: float, again: bool) -> None:
    """Record a step of length h that failed; again: the one before it had failed, too."""
    before, work.failed_error_rate = work.failed_error_rate, error / h
    if again and error / h > SAME * before:
        work.rounding_state = max(work.rounding_state, 1)


@compiled
def measure_noise(
    t: float,
    y: Floats,
    f: Floats,
    h: float,
    tolerance: Floats,
    argument: Floats,
    out: Floats,
    rhs: Function,
    system: Any,
    loops: Any,
) -> None:
    """Uncertainty of dy/dt at (t, y), which is f, in a step h, into ``tolerance``.

    By the last digits of y, and by what these make of y itself in the step. argument, out: scratch.
    """
    noise = tolerance[NOISE]
    for i in range(y.size):
        noise[i] = 0.0
    for sample in range(SAMPLES + 1):
        for i in range(y.size):
            up = (i // (1 + sample % SAMPLES)) % 2 == 0
            argument[i] = y[i] * (1.0 + DIGIT) if up else y[i] * (1.0 - DIGIT)
            if sample == SAMPLES:
                argument[i] += h * noise[i]
        rhs(t, argument, out, system, loops)
        part = ROUNDINGS if sample < SAMPLES else 1.0
        for i in range(y.size):
            noise[i] = max(noise[i], part * abs(out[i] - f[i]))
