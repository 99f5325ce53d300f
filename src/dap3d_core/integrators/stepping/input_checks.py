"""Checks of the arguments of an integration: states, times, tolerances and steps."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.integrators.stepping.step_control import FLOOR
from dap3d_core.kernels.array_types import Floats


def check_state_and_times(y: Floats, times: Floats) -> None:
    """ValueError for states and times that make no sense."""
    if y.ndim != 1 or not np.isfinite(y).all():
        raise ValueError("y0 must be one vector of finite numbers")
    if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all():
        raise ValueError("times must be one vector of finite numbers, t0 first")
    if not (times[1:] > times[:-1]).all():
        raise ValueError("reporting times must increase")


def check_sizes(error_size: int, size: int, buffer_rows: int) -> None:
    """ValueError for more components that steer the step than there are, or no room for a row."""
    if not 0 <= error_size <= size:
        raise ValueError(f"error_size is {error_size}, but y has {size} components")
    if buffer_rows < 1:
        raise ValueError(f"buffer_rows is {buffer_rows}; at least one row must fit")


def check_control(
    integrator: Any,
    rtol: float,
    atol: ArrayLike,
    times: Floats,
    *,
    step: float | None,
    first_step: float | None,
) -> None:
    """ValueError for tolerances and steps that make no sense."""
    least = FLOOR * max(abs(times[0]), abs(times[-1]), times[-1] - times[0])
    for name, value in (("step", step), ("first_step", first_step)):
        if value is not None and not least < value < np.inf:
            raise ValueError(
                f"{name} is {value}; it must be finite and above {least:.1e}, the rounding of time"
            )
    if step is None and not integrator.adaptive:
        raise ValueError(
            f"{integrator.name} does not choose its step: give step, or take an adaptive method"
        )
    least_atol, most_atol = float(np.min(atol)), float(np.max(atol))
    good = 0.0 <= rtol < np.inf and 0.0 <= least_atol <= most_atol < np.inf
    if step is None and not (good and rtol + most_atol > 0.0):
        raise ValueError(
            f"rtol is {rtol} and atol {least_atol}: finite, not negative, not both zero"
        )
