"""Rates, projections and switches of several sets of numbers of a scene, one in each lane."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations import OUTCOMES, PROJECT, RHS, WATCH
from dap3d_core.kernels.compiler.types import Signature
from dap3d_core.kernels.compiler.units import Entry, Functions
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.function_lists import LOOP, LOOP_LIST
from dap3d_core.kernels.runtime.lanes import WideArrays


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Rates(Arrays):
    """Arguments of a formulation's functions for one set of numbers, of n components."""

    t: Floats  # (1,)
    y: Floats  # (n,) also the projected state
    out: Floats  # (n,) dy/dt
    bound: Floats  # (1,) below 1.0 where the results are those of one set alone
    outcome: Floats  # what a projection gives besides (integrators/runge_kutta/step.py)
    switches: Floats  # their values

    @classmethod
    def of(cls, time: float, y: Floats, evaluator: Any) -> "Rates":
        """Arguments at a time and a state of an evaluator's scene."""
        outcome = np.zeros(OUTCOMES + evaluator.length_count)
        return cls(t=np.array([time]), y=y, out=np.zeros(y.size), bound=np.zeros(1),
                   outcome=outcome, switches=np.zeros(len(evaluator.switches)))  # fmt: skip


#: Indices of the functions in a formulation's list, in the order of the table.
ORDER = RHS, PROJECT, WATCH
SIGNATURE = Signature((Rates.type_of(), System.type_of(), LOOP_LIST))


class WideRates:
    """Functions of a formulation for ``count`` sets of numbers, and their arguments.

    Attributes:
        call: a table of the functions, in the order of ``ORDER``, and their arguments, for
            compiled code.
        lanes: member of ``Rates`` -> (size, count) array.
        units: the code of the functions.
        has: (functions,) 1 for those that there are.
    """

    def __init__(
        self,
        evaluator: Any,
        size: int,
        count: int,
        names: Collection[str] | None,
        functions: Mapping[int, Entry],
        loops: Sequence[Entry],
    ) -> None:
        """Args:
        evaluator: of the scene.
        size: of its state.
        count: sets of numbers.
        names: arrays of the system that each set has for itself; None: all.
        functions: right-hand side and, where there are some, projection and switches, of
            ``SIGNATURE``, by their indices.
        loops: the group loops that they call.
        """
        rates = Rates.of(0.0, np.zeros(size), evaluator)
        self._system = WideArrays(evaluator.system, count, names)
        wide = WideArrays(rates, count, None)
        self.lanes = {name: wide.matrix(array) for name, array in rates.walk()}
        self.units = [entry.unit for entry in functions.values()]
        self.has = np.array([int(k in functions) for k in ORDER], dtype=np.int64)
        table = Functions(SIGNATURE, [functions.get(k, functions[RHS]) for k in ORDER])
        self.call = table, wide, self._system, Functions(LOOP, list(loops))
        self.matrix, self.spread = self._system.matrix, self._system.spread
