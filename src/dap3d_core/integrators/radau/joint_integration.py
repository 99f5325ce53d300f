"""An integration by Radau IIA in joint coordinates."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import STEP
from dap3d_core.integrators.radau.integration import RadauIntegration
from dap3d_core.integrators.radau.rates import (
    RateTangent,
    estimate_rate_error,
    factorise_rates,
    find_rate_slope,
    find_rate_stages,
    find_rate_tangent,
    find_rate_work,
    measure_rate_noise,
)
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.kernels.compiler.types import Table
from dap3d_core.linear.lu.plan import StateNode, make_lu_plan


class JointRadauIntegration(RadauIntegration):
    """As ``RadauIntegration``, of an evaluator by method joint.

    Its matrix is dense: factors take the third power of the number of coordinates.
    """

    tangent_kinds = (RateTangent.type_of(), Table(STEP))
    parts = (
        find_rate_tangent, factorise_rates, find_rate_stages, estimate_rate_error, find_rate_slope,
        measure_rate_noise, find_rate_work,
    )  # fmt: skip

    @property
    def _accepts_redundant(self) -> bool:
        return False  # there are no rows

    def make_tangent(self) -> tuple[int, int, tuple[int, int, int]]:
        """As of ``RadauIntegration``."""
        coordinates: Any = self.evaluator.coordinates
        layout, size = coordinates.nodes.layout, coordinates.size
        self.lu_plan = make_lu_plan(0, (), (), [StateNode(size, ())])
        lu = self.lu_plan
        self.tangent = RateTangent(
            nodes=lu.nodes, columns=lu.columns, updates=lu.updates, bends=np.zeros(1),
            J=np.zeros((size, size)),
        )  # fmt: skip
        rates, states = layout["angle_rates"].start, layout["states"].start
        return 0, 1, (rates, states - rates, size - states)

    @property
    def loop_arguments(self) -> tuple[Any, ...]:
        """As ``Integration.loop_arguments``."""
        evaluator = self.evaluator
        return (self.work, evaluator.functions, *self._parts, evaluator.system, evaluator.loops,
                self.tangent, evaluator.functions)  # fmt: skip

    def state_arrays(self) -> list[Any]:
        """As ``Integration.state_arrays``."""
        return Integration.state_arrays(self)

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Integration.all_arrays``."""
        yield from Integration.all_arrays(self)
        yield from self.tangent.walk("tangent.")

    @property
    def multipliers(self) -> tuple[Any, Any]:
        """There are none."""
        return np.zeros(0), np.zeros(0)
