"""Rates and projections of several sets of numbers of one scene at once, one in each lane."""

from collections.abc import Collection, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations import OUTCOMES
from dap3d_core.kernels.compiler.types import Signature
from dap3d_core.kernels.compiler.units import Entry, Functions
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.function_lists import LOOP, LOOP_LIST
from dap3d_core.kernels.runtime.lanes import WideArrays


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Rates(Arrays):
    """Arguments of a right-hand side and a projection for one set of numbers, of n components."""

    t: Floats  # (1,)
    y: Floats  # (n,) also the projected state
    out: Floats  # (n,) dy/dt
    bound: Floats  # (1,) below 1.0 where the results are those of one set alone
    outcome: Floats  # what a projection gives besides (integrators/runge_kutta/step.py)

    @classmethod
    def of(cls, time: float, y: Floats, length_count: int) -> "Rates":
        """Arguments at a time and a state, of a formulation whose projection gives lengths."""
        outcome = np.zeros(OUTCOMES + length_count)
        return cls(
            t=np.array([time]), y=y, out=np.zeros(y.size), bound=np.zeros(1), outcome=outcome
        )


SIGNATURE = Signature((Rates.type_of(), System.type_of(), LOOP_LIST))


class WideRates:
    """Right-hand side and projection for ``count`` sets of numbers, and their arguments.

    Attributes:
        call: a table of the functions, and their arguments, for compiled code.
        lanes: member of ``Rates`` -> (size, count) array.
        units: the code of the functions.
        has_projection: whether the second function is a projection.
    """

    def __init__(
        self,
        evaluator: Any,
        size: int,
        count: int,
        names: Collection[str],
        functions: Sequence[Entry],
        loops: Sequence[Entry],
    ) -> None:
        """Args:
        evaluator: of the scene.
        size: of its state.
        count: sets of numbers.
        names: arrays of the system that each set has for itself.
        functions: right-hand side and, where there is one, projection, of ``SIGNATURE``.
        loops: the group loops that they call.
        """
        rates = Rates.of(0.0, np.zeros(size), evaluator.length_count)
        self._system = WideArrays(evaluator.system, count, names)
        wide = WideArrays(rates, count, tuple(name for name, _ in rates.walk()))
        self.lanes = {name: wide.matrix(array) for name, array in rates.walk()}
        self.units = [entry.unit for entry in functions]
        self.has_projection = len(functions) > 1
        table = Functions(SIGNATURE, [functions[0], functions[-1]])
        self.call = table, wide, self._system, Functions(LOOP, list(loops))
        self.matrix, self.spread = self._system.matrix, self._system.spread
