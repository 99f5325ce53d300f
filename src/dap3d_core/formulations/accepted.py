"""What is asked of a state besides its rate: turns of angles are counted, switches evaluated."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.evaluate import call_kinds, place
from dap3d_core.assembly.system import ANGLE, SCRATCH, SWITCH, Floats, System
from dap3d_core.kernels.cache import compiled


@compiled
def accepted(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Count the turns of angles at an accepted state; ``out`` is left as it is."""
    unused = system.settings[SCRATCH : SCRATCH + 1]
    place(t, y, system, loops)
    call_kinds(ANGLE, ANGLE, t, system, loops, unused, unused, unused)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The values of all switches at a state into ``out``, by groups and instances."""
    place_of_next = system.settings[SCRATCH : SCRATCH + 1]
    place(t, y, system, loops)
    place_of_next[0] = 0.0
    call_kinds(SWITCH, SWITCH, t, system, loops, out, place_of_next, place_of_next)
