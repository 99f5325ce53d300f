"""Unconstrained formulation: M v_dot = g, for scenes without joints (manual: analysis_uc)."""

from typing import Any

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import (
    evaluate_forces,
    global_accelerations,
    put_rates,
    report_energy,
)
from dap3d_core.assembly.state_update import normalise
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of the forces last."""
    put_rates(t, y, evaluate_forces(t, y, system, loops), out, system, loops)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Nothing but unit Euler parameters."""
    out[0] = out[1] = out[2] = out[3] = 0.0
    normalise(y, system)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), angles, potential energy, zeros for the levels of constraints."""
    last = out.shape[0] - 4
    evaluate_forces(t, y, system, loops)
    global_accelerations(system.metric, system.acceleration, out)
    report_energy(t, out, system, loops)
    out[last + 1] = out[last + 2] = out[last + 3] = 0.0
