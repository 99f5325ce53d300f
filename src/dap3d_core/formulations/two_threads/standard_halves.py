"""The standard formulation of a large scene, in two halves (rhs_halves.py); else as standard.py."""

from typing import Any

from dap3d_core.assembly.arrays import EVEN, Floats, System
from dap3d_core.formulations.standard import project, report_accelerations, settle_rows
from dap3d_core.formulations.two_threads.rhs_halves import RATES, accelerate, do_both, rates_of_part
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ordering.bisection import TOP


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    power = accelerate(t, y, out, system, loops)
    if system.settings[EVEN] != 0.0:
        power += settle_rows(system, out)
    rates_of_part(TOP, y, out, system)
    do_both(RATES, t, y, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    accelerate(t, y, out, system, loops)
    report_accelerations(t, y, out, system, loops)


__all__ = ["project", "report", "rhs"]
