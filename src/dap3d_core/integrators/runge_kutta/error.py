"""Error of a step of a Runge-Kutta method, by its one or two estimates."""

from typing import Any

from dap3d_core.integrators.runge_kutta.sums import combine
from dap3d_core.integrators.stepping.integration_state import OTHER, SCRATCH, TRIAL, Y
from dap3d_core.integrators.stepping.step_control import EPSILON, combined_error, work_error
from dap3d_core.integrators.stepping.vector_ops import scaled_beyond, scaled_largest
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where


@compiled
def error_norm(work: Any, h: float) -> float:
    """Largest scaled error of the first components; 1 is just good enough.

    The largest, as in the manual's ode45, and not HNW's root mean square: in a scene of many bodies
    the mean would hide the error of the one that moves. Two estimates are combined as in HNW II.5:
    |e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2).
    """
    size, rtol, tolerance = work.error_size, work.rtol, work.tolerance
    y, trial, error = work.state[Y], work.state[TRIAL], work.state[SCRATCH]
    ratios = work.state[OTHER]
    k, table, first = work.k, work.table, work.k.shape[0]
    combine(error, 0.0, y, h, table, first, k)
    main = scaled_largest(ratios, error, y, trial, size, rtol, tolerance, h)
    of_work = work_error(work, h, error[error.size - 1])
    if work.estimate_count == 1:
        return where(of_work > main, of_work, main)
    combine(error, 0.0, y, h, table, first + 1, k)
    other = scaled_largest(ratios, error, y, trial, size, rtol, tolerance, h)
    main = combined_error(main, other)
    of_work = combined_error(of_work, work_error(work, h, error[error.size - 1]))
    return where(of_work > main, of_work, main)


@compiled
def error_beyond_rounding(work: Any, h: float) -> float:
    """As ``error_norm``, of what exceeds the rounding of time in the rates."""
    size, rtol, tolerance = work.error_size, work.rtol, work.tolerance
    y, trial, error = work.state[Y], work.state[TRIAL], work.state[SCRATCH]
    k, first, last = work.k, work.k.shape[0], work.k[work.stage_count - 1]
    main, rounding = 0.0, EPSILON * max(abs(work.t), abs(work.t + h))
    for e in range(work.estimate_count):
        combine(error, 0.0, y, h, work.table, first + e, k)
        found = scaled_beyond(error, y, trial, k[0], last, rounding, size, rtol, tolerance)
        main = found if e == 0 else combined_error(main, found)
    return main
