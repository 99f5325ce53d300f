"""The right-hand side of trees for several sets of numbers at once (kernels/runtime/lanes.py).

For trees that are too large for a program of their own (formulations/programs).
"""

from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.formulations import RHS
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint.equations import apply_forces
from dap3d_core.formulations.joint.half_angles import LARGEST, largest_angle, small_half_angles
from dap3d_core.formulations.joint.place import place_nodes
from dap3d_core.formulations.joint.reduce import reduce_tree
from dap3d_core.formulations.joint.spread import spread_tree
from dap3d_core.formulations.wide_rates import SIGNATURE, Rates, WideRates
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.lanes import wide_function
from dap3d_core.kernels.runtime.loop_modules import build_wide

#: Kinds of group loops that it calls, and the arrays of a system that it reads and writes.
LOOPS = ("value", "wrench")
ARRAYS = (
    "body", "F", "par", "force",
    *(f"tree.{name}" for name in ("places", "constants", "work", "half_angles", "scratch")),
)  # fmt: skip


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


def tree_rates(evaluator: Evaluator, count: int) -> WideRates:
    """The right-hand side of ``count`` sets of numbers of a tree without states of elements.

    Raises:
        CompileError: kernels of the scene decide by a number.
    """
    loops = _wide_loops(evaluator, count)
    functions = {RHS: wide_function(rhs, SIGNATURE.arguments, count)}
    return WideRates(evaluator, evaluator.coordinates.size + 1, count, ARRAYS, functions, loops)


def _wide_loops(evaluator: Evaluator, count: int) -> list[Entry]:
    """The group loops that a right-hand side calls; of others those of one scene.

    Raises:
        CompileError: one of them decides by a number; names it.
    """
    loops = list(evaluator.loops.entries)
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        loop = write(group.type_info, kind) if kind in LOOPS else None
        if loop is not None:
            try:
                loops[q] = build_wide(loop, count)
            except CompileError as error:
                raise CompileError(f"{loop.name} {error}") from error
    return loops
