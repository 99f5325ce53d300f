"""Rounding of the rates as a Radau step propagates it: what Newton's iteration makes of it.

A change of the residuals of a stage by delta changes the stage by (gamma / h - J)^-1 delta. Where
a direction is soft that is h / gamma times delta, as in an explicit method; in a stiff one it is
J^-1 delta, of the size of the last digits of the state that made it, however long the step. In the
estimate of the error the stages have weights e of 12 in all for three, 66 for seven (newton.py).
"""

from typing import Any

from dap3d_core.assembly.arrays import System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.stabilized_index2.jacobian import Tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import (
    StageMatrix,
    evaluate_stage,
    keep_frames,
)
from dap3d_core.integrators.radau.newton import method_index, solve_first
from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.integrators.stepping.integration_state import NOISE, SCRATCH, Function, Y
from dap3d_core.integrators.stepping.rounding import (
    ROUNDINGS,
    SAMPLES,
    change_digits,
    find_rate_noise,
    judge_noise,
)
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def measure_stage_noise(
    t: float,
    h: float,
    work: RadauState,
    system: System,
    loops: Any,
    tangent: Tangent,
    matrix: StageMatrix,
) -> float:
    """Uncertainty of dy/dt at (t, y) in a step h, the factors of which are known."""
    y, argument, noise = work.state[Y], work.state[SCRATCH], work.tolerance[NOISE]
    now, changed = work.last_multipliers[work.last_stages - 1], work.multipliers[0]
    e, size = work.method.e[method_index(work.stages)], 0.0
    for i in range(work.stages):
        size += ROUNDINGS * abs(e[i]) / h
    zero(noise)
    zero(now[0])
    zero(changed[0])
    work.rhs_count += SAMPLES + 1
    evaluate_stage(t, y, now, matrix.held, work.R[1], work.G[1], system, loops)
    for sample in range(SAMPLES):
        change_digits(y, sample, argument)
        change_digits(now[1], sample, changed[1])
        evaluate_stage(t, argument, changed, matrix.held, work.R[0], work.G[0], system, loops)
        keep_frames(system.body, work.frames[0])
        for k in range(y.shape[0]):
            work.R[0, k] -= work.R[1, k]
        for r in range(2):
            for k in range(work.G.shape[2]):
                work.G[0, r, k] -= work.G[1, r, k]
        solve_first(h, work, system, tangent, matrix)
        for k in range(y.shape[0]):
            noise[k] = max(noise[k], size * abs(work.R[0, k]))
    return 0.0


@compiled
def bound_stage_noise(h: float, work: RadauState, rhs: Function, system: Any, loops: Any) -> None:
    """Bound what was measured by the rounding of the rates themselves, and judge it.

    Near a singular pose the factors of a step make more of rounding than there is of it.
    """
    noise, own = work.tolerance[NOISE], work.R[0]
    work.rhs_count += SAMPLES + 1
    find_rate_noise(work, own, rhs, system, loops)
    for k in range(noise.shape[0]):
        noise[k] = min(noise[k], own[k])
    judge_noise(work, h)
