"""What happens at accepted steps alone: turns of angles are counted, switches are looked at."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.evaluate import call_kinds, place
from dap3d_core.assembly.system import ANGLE, SCRATCH, SWITCH, Floats, System
from dap3d_core.kernels.cache import compiled


@compiled
def accepted(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Count turns at a state; out[0] = the lowest switch, negative where the run is to end."""
    value = system.settings[SCRATCH : SCRATCH + 1]
    place(t, y, system, loops)
    value[0] = 1.0
    call_kinds(ANGLE, SWITCH, t, system, loops, value, value, value)
    out[0] = value[0]
