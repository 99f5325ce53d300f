"""Compiled start of a run in joint coordinates, and its states in those of bodies."""

from typing import Any

from dap3d_core.assembly.arrays import VALUE, Floats, System
from dap3d_core.assembly.evaluate import call_kinds
from dap3d_core.formulations.joint.equations import body_state
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.study.batch.initial_state import count_from_here


@compiled
def begin_tree(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Begin a run; ``out`` is not used."""
    place_tree(y, system)
    call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)
    count_from_here(t, y, system, loops)


@compiled
def state_of_bodies(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The state y in coordinates of bodies into ``out``."""
    body_state(y, out, system)
