"""An integration by an explicit Runge-Kutta method."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.step import advance
from dap3d_core.integrators.runge_kutta.sums import combinations
from dap3d_core.integrators.runge_kutta.tableau import Tableau
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.singular_poses import ROWS
from dap3d_core.kernels.runtime.cache import jit_is_on, prepared


class RungeKutta(Integration):
    """An initial value problem that is integrated by an explicit Runge-Kutta method.

    Parameters
    ----------
    method
        One of ``TABLEAUS``.
    args, options
        As for ``Integration``.
    stop_when_stiff
        Whether to stop, with status STIFF, where the scene turns out stiff for the method.
    """

    state_class = RungeKuttaState
    takes_programs = True
    loop = staticmethod(advance)

    def __init__(
        self, method: Tableau, *args: Any, stop_when_stiff: bool = False, **options: Any
    ) -> None:
        self.method, self.name, self.adaptive = method, method.name, method.adaptive
        super().__init__(*args, **options)
        for name, value in _facts(method).items():
            setattr(self.work, name, value)
        self.work.last_error, self.work.t_stiff = 1e-4, np.inf
        self.work.stops_when_stiff = stop_when_stiff

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``."""
        method = self.method
        return {
            "k": np.zeros((len(method.a), size)),
            "terms": np.zeros((4 + len(method.d), size)),
            "table": combinations(method),
            "lengths": np.full((ROWS, length_count), np.nan),
        }

    def prepared(self) -> Callable[[int], Any]:
        """As ``Integration.prepared``; types and addresses of arguments are looked up once."""
        return prepared(advance, *self.loop_arguments) if jit_is_on() else self.advance


@cache
def _facts(method: Tableau) -> dict[str, float]:
    """Scalars of a method, computed once: small runs take microseconds."""
    same = ("order", "exponent", "beta", "factor_min", "factor_max", "safety")
    return {name: getattr(method, name) for name in same} | {
        "widest_gap_abscissa": method.widest_gap_abscissa,
        "stage_count": method.stages,
        "estimate_count": len(method.e),
        "has_dense_output": method.dense,
        "error_uses_last_stage": method.error_uses_last_stage,
        "stiffness_stage": method.stiffness_stage,
    }
