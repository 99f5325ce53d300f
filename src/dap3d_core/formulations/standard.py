"""Standard formulation: accelerations and multipliers from the saddle-point equations.

Manual: analysis_s.

    [M  D^T] (v_dot  )   (g    )
    [D   0 ] (-lambda) = (gamma)

solved by the block LDL^T of linear/ldlt/factor.py. Needs independent rows.
"""

from typing import Any

from dap3d_core.assembly.arrays import EVEN, LENGTH, SINGULAR, Floats, System
from dap3d_core.assembly.evaluate import copy, global_accelerations, rates, state_rates
from dap3d_core.formulations import regularised
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where
from dap3d_core.linear.ldlt.factor import have_pivots

#: What is left of the rows, as a part of the largest acceleration, from which on it is solved for.
ROUGH = 1e-12


@compiled_into
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``."""
    copy(system.multipliers, system.gamma)
    constraints.solve_rows(system, system.acceleration)


@compiled_into
def settle_rows(system: System) -> float:
    """Solve once more for what the accelerations leave of the rows.

    ``multipliers`` becomes the change of -lambda, of which the power of drivers is returned.
    """
    constraints.acceleration_residual(system)
    constraints.correct(system)
    for k in range(system.change.shape[0]):
        system.acceleration[k] += system.change[k]
    return constraints.power_of_drivers(system)


@compiled_into
def refine(system: System, out: Floats) -> None:
    """Solve once more for what accelerations and multipliers leave of the rows, where that is much.

    Where reactions exceed by far the accelerations that they leave, or masses differ, rounding
    of the solution shows in the rows. Those in out are replaced.
    """
    n, length = system.metric.shape[0] - 1, system.settings[LENGTH]
    size = length
    for k in range(6 * n):
        part = abs(out[k]) * (1.0 if k % 6 < 3 else length)
        size = where(part > size, part, size)
    if not constraints.acceleration_residual(system) > ROUGH * size:
        return
    settle_rows(system)
    for k in range(system.row.shape[0]):
        out[6 * n + k] -= system.multipliers[system.row[k]]
    global_accelerations(system.metric, system.acceleration, out)


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last.

    Where masses differ much, a light body between heavy ones has reactions whose last digits are
    no rounding of its acceleration any more, but noise that no step can follow.
    """
    power = constraints.solve_equations(t, y, system, loops, None, solve)
    state_rates(t, out, system, loops)
    if system.settings[EVEN] != 0.0:
        power += settle_rows(system)
    rates(y, system.metric, system.acceleration, out)
    out[out.shape[0] - 1] = power


@compiled_into
def report_accelerations(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """As ``report``, of ``acceleration`` and ``multipliers``.

    Where a pivot is zero they are computed anew; where they leave much of the rows, refined.
    """
    if not have_pivots(system.nodes, system.K):
        regularised.accelerate(t, y, system, loops)
        system.settings[SINGULAR] += 1.0
    global_accelerations(system.metric, system.acceleration, out)
    constraints.report_multipliers(system, out)
    refine(system, out)
    constraints.report_levels(t, y, out, system, loops)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto its constraints; out as in ``project_onto``."""
    project_onto(t, y, out, system, loops, constraints, None, False, True)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    constraints.solve_equations(t, y, system, loops, None, solve)
    report_accelerations(t, y, out, system, loops)
