"""Least-squares formulation: the saddle-point equations where rows may depend on each other.

    [I   D^^T] (a      )   (g                  )
    [D^  -E  ] (-lambda) = (gamma + E lambda_0 ),        e_i = part |D^_i|^2,

in the bodies' scaled coordinates, with lambda_0 the multipliers of the pass before: the proximal
method (method of multipliers). A pass divides what is left of a row's residual by 1 + s / part,
where s is the squared singular value of the scaled rows, so a few passes stand at rounding.
Weights that follow the length of their rows make the motion independent of how rows are scaled.

Accelerations are unique, multipliers are not: reported are those of least |lambda|, what
numpy.linalg.lstsq or pinv give. Where forces depend on multipliers accelerations are not unique
either: such forces read those of least lambda . w lambda (decision 0074), which are then reported.
In scenes that are not of ordinary size rows are first scaled to lengths (``System.weight``), as one
weight e does not serve those of squares of millimetres and those of directions together.
"""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import global_accelerations, largest, put_rates, zero
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.friction import has_friction
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.formulations.regularised import accelerate
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ldlt.factor import weigh_rows

#: For the least multipliers: e as part of the longest row's square, and passes at most. More of
#: them than it takes would gather rounding.
LEAST_PART, LEAST_SOLVES = 1e-5, 50
#: What is taken away may change D^T lambda by this part; rows that hold only weakly, like those of
#: a door that hinges jam, need a smaller e for that, by so much at a time, down to a least one.
TAKEN, SMALLER, SMALLEST = 1e-9, 1e-2, 1e-12


@compiled
def minimum_norm_multipliers(system: System) -> None:
    """Replace ``multipliers`` by the least ones that give the same D^T lambda.

    With one weight e for all rows, n -> e (D^ D^^T + e)^-1 n keeps what D^T does not see, and
    takes away the rest: n, in ``right_side``, is then subtracted from ``total``. What D^T sees of
    n in the end, e times the ``change`` of the last pass, says whether e was small enough.
    """
    total, n, weight = system.total, system.right_side, system.weight
    weigh_rows(system.blocks, system.D, 1.0, system.compliance)
    longest = size = 0.0
    for k in range(n.shape[0]):
        longest = max(longest, system.compliance[k] * weight[k] * weight[k])
        if system.compliance[k] == 0.0:  # a hub's place, or a row that does nothing
            total[k] = 0.0
        n[k] = total[k]
        size = max(size, abs(total[k]) / weight[k])
    e, seen = LEAST_PART * longest, np.inf
    while seen > TAKEN * np.sqrt(longest) * size and e > SMALLEST * longest:
        seen = null_space_component(system, n, e)
        e *= SMALLER
    for k in range(n.shape[0]):
        system.multipliers[k] = total[k] - n[k]


@compiled
def null_space_component(system: System, n: Floats, e: float) -> float:
    """Take from n what D^T sees, as far as a weight e does; the largest seen of the rest."""
    x, weight, before = system.multipliers, system.weight, np.inf
    for k in range(x.shape[0]):
        system.compliance[k] = e / (weight[k] * weight[k])
    constraints.factorise_regularised(system)
    for _ in range(LEAST_SOLVES):
        for k in range(x.shape[0]):
            x[k] = n[k] / (weight[k] * weight[k])
        zero(system.change)
        constraints.solve_rows(system, system.change)
        change = 0.0
        for q in range(system.hubs.shape[0]):
            for c in range(system.hubs[q, 1], system.hubs[q, 1] + 6):
                x[c] = 0.0
        for k in range(x.shape[0]):
            x[k] *= -e
            change = max(change, abs(x[k] - n[k]) / weight[k])
            n[k] = x[k]
        if not change < 0.5 * before:
            break
        before = change
    return e * largest(system.change)


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    put_rates(t, y, accelerate(t, y, system, loops), out, system, loops)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto its constraints; out as in ``project_onto``."""
    project_onto(t, y, out, system, loops, constraints, constraints.PART, True, True)


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals."""
    accelerate(t, y, system, loops)
    global_accelerations(system.metric, system.acceleration, out)
    constraints.report_levels(t, y, out, system, loops)
    if not has_friction(system):  # else they are those that forces have read
        minimum_norm_multipliers(system)
    constraints.report_multipliers(system, out)
