"""Accelerations where rows may depend on each other, by rows of finite weight (lsq.py)."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import EVEN, Floats, System
from dap3d_core.assembly.evaluate import largest_weighted, zero
from dap3d_core.formulations.common.constraints import PART, solve_equations, solve_rows
from dap3d_core.kernels.runtime.cache import compiled_inside
from dap3d_core.linear.ldlt.saddle_point import add_product

#: How often the rows are solved.
SOLVES = 3
#: The same, at most, where masses differ much; and how much less of a residual a pass is to leave.
MORE_SOLVES, FALLING = 12, 0.5


@compiled_inside
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled accelerations into ``force``, -lambda into ``x``; power of forces and drivers."""
    return solve_equations(t, y, system, loops, PART, solve)


@compiled_inside
def solve(system: System) -> None:
    """Scaled accelerations from the scaled forces in ``force``, -lambda into ``x``.

    Each pass starts from the accelerations of the one before, so that it solves for what is left.
    C holds the sum of the passes. Where masses differ much a row may weigh more than the bodies
    that it joins: passes go on while they leave much less of the rows.
    """
    x, C = system.x, system.C
    zero(C)
    for _ in range(SOLVES):
        add_pass(system)
    left, before = np.inf, np.inf
    for _ in range(MORE_SOLVES if system.settings[EVEN] != 0.0 else 0):
        before, left = left, rest(system)
        if not left < FALLING * before:
            break
        add_pass(system)
    for k in range(x.shape[0]):
        x[k] = C[k]


@compiled_inside
def add_pass(system: System) -> None:
    """Solve for what the accelerations leave of the rows; C takes the change of -lambda."""
    x, C = system.x, system.C
    for k in range(x.shape[0]):
        x[k] = system.gamma[k]
    solve_rows(system)
    for k in range(x.shape[0]):
        C[k] += x[k]


@compiled_inside
def rest(system: System) -> float:
    """What the accelerations leave of the rows, in m/s^2, by way of ``x``."""
    x = system.x
    for k in range(x.shape[0]):
        x[k] = -system.gamma[k]
    add_product(system.blocks, system.D, system.force, x)
    return largest_weighted(x, system.weight)
