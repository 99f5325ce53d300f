"""Impulses with the joints held: [M D^T; D 0] (dv; -Lambda) = (P; change of D v).

In the scaled coordinates of the bodies (docs/decisions/0006), by the block factors of the
formulation. Compiled for scenes whose velocities jump, at the first jump.
"""

from typing import Any

from dap3d_core.assembly.arrays import Floats, System, step_functions
from dap3d_core.assembly.evaluate import copy, place
from dap3d_core.formulations.common import constraints
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: Corrections of one solution. The first solves; the others are refinement and, with regularised
#: factors, passes of the proximal method, each of which leaves a small part (regularised.py).
CORRECTIONS = 6
#: Places in the table of functions.
FACTOR, SOLVE = 0, 1


@compiled_into
def factor_rows(t: float, y: Floats, system: System, loops: Any, part: float | None) -> None:
    """D^ and its factors at a state, and D v - nu into ``residual``."""
    place(t, y, system, loops)
    constraints.linearise(t, system, loops)
    constraints.velocity_residuals(system)
    constraints.factorise_anyway(system, part)


@compiled
def factor_independent(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """``factor_rows`` of rows that are independent."""
    factor_rows(t, y, system, loops, None)


@compiled
def factor_regularised(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """``factor_rows`` of rows that may depend on each other."""
    factor_rows(t, y, system, loops, constraints.PART)


@compiled
def place_alone(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The same where there are no rows."""
    place(t, y, system, loops)


@compiled
def solve_held(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Scaled impulses (6 n + 6) and changes of D v (rows) in out become scaled dv and -Lambda."""
    x, gamma, multipliers = system.acceleration, system.gamma, system.multipliers
    size, rows = x.shape[0], gamma.shape[0]
    copy(x, out[:size])
    for k in range(rows):
        gamma[k], out[size + k] = out[size + k], 0.0
    for _ in range(CORRECTIONS):
        constraints.acceleration_residual(system)
        constraints.correct(system)
        for k in range(size):
            x[k] += system.change[k]
        for k in range(rows):
            out[size + k] += multipliers[k]
    copy(out[:size], x)


@compiled
def solve_free(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """The same where there are no rows: scaled impulses are changes of scaled velocities."""


def held_functions(has_rows: bool, accepts_redundant: bool) -> Any:
    """The table of functions of a model whose joints have rows, which may depend on each other."""
    if not has_rows:
        return step_functions(place_alone, solve_free)
    factor = factor_regularised if accepts_redundant else factor_independent
    return step_functions(factor, solve_held)
