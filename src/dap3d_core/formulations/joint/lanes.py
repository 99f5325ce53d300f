"""The right-hand side of trees for several scenes of one structure at once (runtime/lanes.py)."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import attrs

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations.joint.equations import apply_forces
from dap3d_core.formulations.joint.half_angles import LARGEST, largest_angle, small_half_angles
from dap3d_core.formulations.joint.place import place_nodes
from dap3d_core.formulations.joint.reduce import reduce_tree
from dap3d_core.formulations.joint.spread import spread_tree
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.cache import compiled

#: Kinds of group loops that it calls, and the arrays of a system that it reads and writes.
LOOPS = ("value", "wrench")
ARRAYS = (
    "body", "F", "par", "force",
    *(f"tree.{name}" for name in ("places", "constants", "work", "half_angles", "scratch")),
)  # fmt: skip


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Rates(Arrays):
    """Arguments of ``rhs`` for one scene, of n components."""

    t: Floats  # (1,)
    y: Floats  # (n,)
    out: Floats  # (n,) dy/dt
    bound: Floats  # (1,) below 1.0 where out is that of ``equations.rhs``


@compiled
def rhs(rates: Rates, system: System, loops: Any) -> None:
    """dy/dt as ``equations.rhs``, for trees without friction and states of elements."""
    t, y, out = rates.t[0], rates.y, rates.out
    sines = system.tree.half_angles[0]
    rates.bound[0] = largest_angle(y, sines.shape[0]) / (2.0 * LARGEST)
    small_half_angles(y, sines, system.tree.half_angles[1])
    place_nodes(y, system)
    apply_forces(t, system, loops)
    power = reduce_tree(system, system.force)
    spread_tree(y, out, system)
    out[out.shape[0] - 1] = power
