"""The error estimate of a Radau step, and the work done in it.

Source: as of newton.py.
"""

from typing import Any

from dap3d_core.assembly.evaluate import zero
from dap3d_core.integrators.radau.newton import (
    evaluate_bodies,
    evaluate_stages,
    method_index,
    solve_first,
)
from dap3d_core.integrators.radau.state import Given, RadauState
from dap3d_core.integrators.stepping import rounding
from dap3d_core.integrators.stepping.integration_state import NOISE, SCRATCH, TRIAL, Function, Y
from dap3d_core.integrators.stepping.vector_ops import scaled_largest
from dap3d_core.kernels.runtime.cache import compiled, compiled_into


@compiled
def estimate_error(t: float, h: float, work: RadauState, given: Given) -> float:
    """``filter_error`` on the equations of bodies.

    The multipliers steer no step: what a run reports of them comes from the reported state. They
    are those at the end of the last step: an error of theirs acts along D^T, which the matrix takes
    away only as far as its own D is that of the state.
    """
    zero(work.last_multipliers[work.last_stages - 1, 0])
    return filter_error(t, h, work, given, evaluate_bodies, solve_first)


@compiled_into
def filter_error(
    t: float, h: float, work: RadauState, given: Given, evaluate: Any, solve: Any
) -> float:
    """Norm of the error estimate (HW IV.8, (8.19), (8.20)); 1 is just good enough.

    evaluate, solve: ``evaluate_bodies``, ``solve_first``, or those of other coordinates.
    """
    last = work.last_multipliers[work.last_stages - 1]
    again = work.has_last_step == 0 or work.last_rejected != 0
    y, argument, e = work.state[Y], work.state[SCRATCH], work.method.e[method_index(work.stages)]
    error = 0.0
    for attempt in range(2 if again else 1):
        for k in range(y.shape[0]):
            argument[k] = y[k] + (work.R[0, k] if attempt == 1 else 0.0)
        evaluate(t, argument, last, 0, work.R[0], work, given)
        for r in range(2):
            zero(work.G[0, r])
        work.rhs_count += 1
        for i in range(work.stages):
            for k in range(y.shape[0]):
                work.R[0, k] += e[i] * work.Z[i, k] / h
        solve(h, work, given)
        error = scaled_largest(argument, work.R[0], y, work.state[TRIAL], work.error_size,
                               work.rtol, work.tolerance, h)  # fmt: skip
        if not error >= 1.0:
            return error
    return error


@compiled
def find_work(t: float, h: float, work: RadauState, given: Given) -> float:
    """Work done up to each stage, into Z, and up to the end of the step, into the trial state.

    The iteration leaves the rates of stages at their last but one values. No error control sees the
    work, so its powers are evaluated once more, at the stages as found.
    """
    evaluate_stages(t, h, work, given, evaluate_bodies)
    sum_work(h, work)
    return 0.0


@compiled
def sum_work(h: float, work: RadauState) -> None:
    """Integrals of the powers in F."""
    last, A = work.state.shape[1] - 1, work.method.A[method_index(work.stages)]
    for i in range(work.stages):
        work.Z[i, last] = 0.0
        for j in range(work.stages):
            work.Z[i, last] += h * A[i, j] * work.F[j, last]
    work.state[TRIAL, last] = work.state[Y, last] + work.Z[work.stages - 1, last]


@compiled
def measure_stage_noise(t: float, h: float, work: RadauState, given: Given) -> float:
    """``measure_noise`` on the equations of bodies."""
    return measure_noise(t, h, work, given, evaluate_bodies, solve_first)


@compiled_into
def measure_noise(
    t: float, h: float, work: RadauState, given: Given, evaluate: Any, solve: Any
) -> float:
    """Uncertainty of dy/dt at (t, y) in a step h, the factors of which are known.

    evaluate, solve: as of ``filter_error``.
    """
    y, argument, noise = work.state[Y], work.state[SCRATCH], work.tolerance[NOISE]
    now, changed = work.last_multipliers[work.last_stages - 1], work.multipliers[0]
    e, size = work.method.e[method_index(work.stages)], 0.0
    for i in range(work.stages):
        size += rounding.ROUNDINGS * abs(e[i]) / h
    zero(noise)
    zero(now[0])
    zero(changed[0])
    work.rhs_count += rounding.SAMPLES + 1
    evaluate(t, y, now, 1, work.R[1], work, given)
    for sample in range(rounding.SAMPLES):
        rounding.change_digits(y, sample, argument)
        rounding.change_digits(now[1], sample, changed[1])
        evaluate(t, argument, changed, 0, work.R[0], work, given)
        for k in range(y.shape[0]):
            work.R[0, k] -= work.R[1, k]
        for r in range(2):
            for k in range(work.G.shape[2]):
                work.G[0, r, k] -= work.G[1, r, k]
        solve(h, work, given)
        for k in range(y.shape[0]):
            noise[k] = max(noise[k], size * abs(work.R[0, k]))
    return 0.0


@compiled
def bound_stage_noise(h: float, work: RadauState, rhs: Function, system: Any, loops: Any) -> None:
    """Bound what was measured by the rounding of the rates themselves, and judge it.

    Near a singular pose the factors of a step make more of rounding than there is of it.
    """
    noise, own = work.tolerance[NOISE], work.R[0]
    work.rhs_count += rounding.SAMPLES + 1
    rounding.find_rate_noise(work, own, rhs, system, loops)
    for k in range(noise.shape[0]):
        noise[k] = min(noise[k], own[k])
    rounding.judge_noise(work, h)
