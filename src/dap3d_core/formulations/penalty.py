"""Penalty formulation: constraints as stiff, damped springs on the accelerations.

Manual: analysis_p. With gamma' = gamma - 2 mu Omega (D v - nu) - Omega^2 C,

    (M + alpha D^T D) v_dot = g + alpha D^T gamma'        lambda = -alpha (D v_dot - gamma')

which is [I D^^T; D^ -I/alpha] (v_dot; -lambda) = (g; gamma') in the bodies' scaled coordinates,
solved by the block LDL^T of linear/ldlt/factor.py: no product alpha D^T D is formed, of which the
masses' digits would be lost. Rows may depend on each other. C is zero on rows that have none.
"""

from typing import Any

from dap3d_core.assembly.arrays import ALPHA, MU, OMEGA, WRENCH, Floats, System
from dap3d_core.assembly.evaluate import (
    call_kinds,
    copy,
    global_accelerations,
    place,
    put_rates,
    scale_forces,
    zero,
)
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.friction import solve_with_friction
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from scaled forces, gamma' in ``right_side``."""
    copy(system.multipliers, system.right_side)
    constraints.solve_rows(system, system.acceleration)


@compiled
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled ``acceleration`` and ``multipliers``; returns the power of forces and drivers."""
    force, right_side, residual = system.force, system.right_side, system.residual
    settings = system.settings
    place(t, y, system, loops)
    constraints.linearise(t, system, loops)
    constraints.residuals(t, system, loops)
    stiffness, damping = settings[OMEGA] * settings[OMEGA], 2.0 * settings[MU] * settings[OMEGA]
    for k in range(right_side.shape[0]):
        right_side[k] = system.gamma[k] - stiffness * residual[k]
    constraints.velocity_residuals(system)
    for k in range(right_side.shape[0]):
        right_side[k] -= damping * residual[k]
        system.compliance[k] = 1.0 / settings[ALPHA]
    zero(force)
    call_kinds(WRENCH, WRENCH, t, system, loops, force, force, force)
    power = scale_forces(system.body, system.metric, force, system.acceleration)
    constraints.factorise_regularised(system)
    power += solve_with_friction(t, system, loops, solve)
    return power + constraints.power_of_drivers(system)


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    put_rates(t, y, accelerate(t, y, system, loops), out, system, loops)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto its constraints; out as in ``project_onto``."""
    project_onto(t, y, out, system, loops, constraints, constraints.PART, True, False)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    accelerate(t, y, system, loops)
    global_accelerations(system.metric, system.acceleration, out)
    constraints.report_multipliers(system, out)
    constraints.report_levels(t, y, out, system, loops)
