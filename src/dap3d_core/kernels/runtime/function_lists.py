"""Tables of function addresses, by which the driver calls loops compiled after it."""

from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.compiler.types import FLOAT, INT, Array, Signature, Table
from dap3d_core.kernels.runtime.array_struct import VECTOR, Arrays, Matrix, pointer
from dap3d_core.kernels.runtime.cache import compiled, table_of


@attrs.frozen(eq=False, kw_only=True, slots=False)
class LoopArrays(Arrays):
    """Arrays that every group loop reads; the driver's system begins with them."""

    body: Matrix  # (n+1, BODY_WIDTH) state and constants of each body (loop_support.py)
    F: Matrix  # (functions+1, 5) functions of time, at t and (the last column) at 0
    idx: Integers  # integers of all instances
    par: Floats  # numbers of all instances
    states: Floats = attrs.field(factory=lambda: np.zeros(0))  # of elements that have some
    #: Of these.
    rates: Floats = attrs.Factory(lambda self: np.zeros(len(self.states)), takes_self=True)


_OUT = Array(FLOAT, 0)
#: Signature of every group loop (loop_modules.py).
LOOP = Signature((FLOAT, LoopArrays.type_of(), INT, INT, INT, _OUT, _OUT, _OUT))
LOOP_LIST = Table(LOOP)


def step_signature(system: Any) -> Signature:
    """Signature of a formulation's functions: (t, y, out, system, loops)."""
    return Signature((FLOAT, VECTOR, VECTOR, system, LOOP_LIST))


def loop_list(loops: Sequence[Callable[..., Any]]) -> Any:
    """Group loops as a table, an argument of the driver."""
    return table_of(LOOP, loops)


@compiled
def call_loop(
    loops: Any, q: int, t: float, arrays: Any, group: Any, out1: Any, out2: Any, out3: Any
) -> None:
    """Call one group loop, with arrays and a group (i0, p0, count) of the caller's."""
    loop = loops[q]
    loop(t, arrays, group[0], group[1], group[2], pointer(out1), pointer(out2), pointer(out3))
