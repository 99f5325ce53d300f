"""Evaluated at accepted states: revolution counters and switching functions."""

from typing import Any

from dap3d_core.assembly import turns
from dap3d_core.assembly.arrays import ANGLE, DOUBTFUL, KNOT, SCRATCH, SWITCH, Floats, System
from dap3d_core.assembly.evaluate import call_kinds, place, place_state
from dap3d_core.kernels.runtime.cache import compiled, compiled_into


@compiled
def accepted(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Count turns up to the end of a step, or judge whether that can be done.

    out[0]: on entry positive where the state y is accepted (integrators/stepping/step_control.py);
    else the number of angles whose turns are not certain is returned there, nothing is counted.
    """
    has_own = counts_own_angles(system)
    if has_own:
        place(t, y, system, loops)
        count(t, y, y[:0], out, system, loops)
    elif turns.needs_places(system):
        if out[0] <= 0.0 or not turns.has_measured(t, system):
            place_state(y, system)
        count(t, y, y[:0], out, system, loops)
    else:
        count(t, y, y, out, system, loops)


@compiled
def count(t: float, y: Floats, unplaced: Floats, out: Floats, system: System, loops: Any) -> None:
    """As ``accepted``; unplaced: the state where bodies are not placed, else empty."""
    doubtful = system.settings[DOUBTFUL : DOUBTFUL + 1]
    doubtful[0] = 0.0
    if counts_own_angles(system):
        call_kinds(ANGLE, ANGLE, t, system, loops, doubtful, out, out)
    if out[0] <= 0.0:
        out[0] = doubtful[0] + turns.doubtful_angles(t, unplaced, system, out[0] < 0.0)
        return
    if not turns.has_measured(t, system):
        turns.measure_all(t, unplaced, system)
    turns.keep_turns(t, y, system, out[0] > 1.0)


@compiled_into
def counts_own_angles(system: System) -> bool:
    """True if elements have angles of their own."""
    return system.kinds[ANGLE + 1] > system.kinds[ANGLE]


@compiled
def watch(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Switches at a state into ``out``."""
    place(t, y, system, loops)
    read_switches(t, out, system, loops)


@compiled_into
def read_switches(t: float, out: Floats, system: System, loops: Any) -> None:
    """Switches at the bodies as placed, by groups and instances; then distances from knots.

    Closed contacts read ``multipliers``.
    """
    place_of_next = system.settings[SCRATCH : SCRATCH + 1]
    place_of_next[0] = 0.0
    call_kinds(SWITCH, KNOT, t, system, loops, out, place_of_next, system.multipliers)
