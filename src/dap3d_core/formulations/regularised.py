"""Accelerations where rows may depend on each other, by rows of finite weight (lsq.py)."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import EVEN, Floats, System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.common.constraints import (
    PART,
    acceleration_residual,
    solve_equations,
    solve_rows,
)
from dap3d_core.formulations.common.friction import has_friction
from dap3d_core.kernels.runtime.cache import compiled

#: How often the rows are solved.
SOLVES = 3
#: The same, at most, where masses differ much; and how much less of a residual a pass is to leave.
MORE_SOLVES, FALLING = 12, 0.5
#: Passes at most that find what D^T does not see of the multipliers, and what each is to leave of
#: the change of the one before: more would gather rounding.
LEAST_SOLVES, LEFT = 6, 0.5


@compiled
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled ``acceleration`` and ``multipliers``; returns the power of forces and drivers."""
    return solve_equations(t, y, system, loops, PART, solve)


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``.

    Each pass starts from the accelerations of the one before, so that it solves for what is left;
    ``total`` is the sum of the passes. Where masses differ much a row may weigh more than the
    bodies that it joins: passes continue while each leaves much less of the rows.
    """
    zero(system.total)
    for _ in range(SOLVES):
        add_pass(system)
    left, before = np.inf, np.inf
    for _ in range(MORE_SOLVES if system.settings[EVEN] != 0.0 else 0):
        before, left = left, acceleration_residual(system)
        if not left < FALLING * before:
            break
        add_pass(system)
    for k in range(system.total.shape[0]):
        system.multipliers[k] = system.total[k]
    if has_friction(system):
        least_weighted_multipliers(system)


@compiled
def least_weighted_multipliers(system: System) -> None:
    """Replace ``multipliers`` by those with the same D^T lambda of least lambda . E lambda.

    So forces read numbers that are free of rounding, and that units of the scene do not change.
    n -> (D^ D^^T + E)^-1 E n keeps what D^T does not see, and takes away the rest.
    """
    n, x, E = system.right_side, system.multipliers, system.compliance
    before = np.inf
    for k in range(n.shape[0]):
        n[k] = system.total[k]
    for _ in range(LEAST_SOLVES):
        for k in range(n.shape[0]):
            x[k] = E[k] * n[k]
        zero(system.change)
        solve_rows(system, system.change)
        change = 0.0
        for k in range(n.shape[0]):
            x[k] = -x[k] if E[k] != 0.0 else 0.0  # else a hub's place
            change = max(change, abs(x[k] - n[k]))
            n[k] = x[k]
        if not change < LEFT * before:
            break
        before = change
    for k in range(n.shape[0]):
        x[k] = system.total[k] - n[k]


@compiled
def add_pass(system: System) -> None:
    """Solve for what the accelerations leave of the rows; ``total`` takes the change of -lambda."""
    multipliers, total = system.multipliers, system.total
    for k in range(total.shape[0]):
        multipliers[k] = system.gamma[k]
    solve_rows(system, system.acceleration)
    for k in range(total.shape[0]):
        total[k] += multipliers[k]
