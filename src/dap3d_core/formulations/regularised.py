"""Accelerations where rows may depend on each other, by rows of finite weight (lsq.py)."""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.evaluate import zero
from dap3d_core.assembly.system import Floats, System
from dap3d_core.formulations.constraints import PART, solve_equations, solve_rows
from dap3d_core.kernels.cache import compiled_inside

#: How often the rows are solved.
SOLVES = 3


@compiled_inside
def accelerate(t: float, y: Floats, system: System, loops: Any) -> float:
    """Scaled accelerations into ``force``, -lambda into ``x``; power of forces and drivers."""
    return solve_equations(t, y, system, loops, PART, solve)


@compiled_inside
def solve(system: System) -> None:
    """Scaled accelerations from the scaled forces in ``force``, -lambda into ``x``.

    Each pass starts from the accelerations of the one before, so that it solves for what is left.
    C holds the sum of the passes.
    """
    x, C = system.x, system.C
    zero(C)
    for _ in range(SOLVES):
        for k in range(x.shape[0]):
            x[k] = system.gamma[k]
        solve_rows(system)
        for k in range(x.shape[0]):
            C[k] += x[k]
    for k in range(x.shape[0]):
        x[k] = C[k]
