"""Evaluated at accepted states: revolution counters and switching functions."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import ANGLE, DOUBTFUL, KNOT, SCRATCH, SWITCH, Floats, System
from dap3d_core.assembly.evaluate import call_kinds, place
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def accepted(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Count the turns of angles at an accepted state; ``out`` is left as it is."""
    doubtful = system.settings[DOUBTFUL : DOUBTFUL + 1]
    place(t, y, system, loops)
    call_kinds(ANGLE, ANGLE, t, system, loops, doubtful, doubtful, doubtful)


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``, by groups and instances; then distances from knots."""
    place_of_next = system.settings[SCRATCH : SCRATCH + 1]
    place(t, y, system, loops)
    place_of_next[0] = 0.0
    call_kinds(SWITCH, KNOT, t, system, loops, out, place_of_next, place_of_next)
