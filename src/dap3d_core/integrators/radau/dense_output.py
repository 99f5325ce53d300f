"""Dense output of a Radau step: as exact as its end points, not as its inner stages.

The collocation polynomial through the stages is of order 3 only. The end points of steps are of
order 5, so dense output is the polynomial of degree 5 with the values and slopes of three of them:
both ends of the step, and the start of the step before. The first step has its collocation
polynomial. Slopes of positions follow from the velocities. Those of velocities are the collocation
polynomial's, moved onto D v_dot = gamma, since the multipliers of the stages are of order 3.
"""

# An element of an array is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

from dap3d_core.assembly.arrays import VALUE, Floats, System
from dap3d_core.assembly.evaluate import call_kinds, place_state, rates, zero
from dap3d_core.assembly.offsets import states_offset, velocity_offset
from dap3d_core.formulations.common.constraints import (
    PART,
    acceleration_residual,
    correct,
    factorise,
    linearise,
)
from dap3d_core.formulations.stabilized_index2.jacobian import Tangent
from dap3d_core.formulations.stabilized_index2.stage_equations import StageMatrix
from dap3d_core.integrators.radau.state import OLD, OLD_SLOPE, SLOPE, TRIAL_SLOPE, RadauState
from dap3d_core.integrators.stepping.integration_state import TRIAL, Y
from dap3d_core.kernels.runtime.cache import compiled

#: A step before that was shorter than this part of the present one says nothing: rounding, divided
#: by the square, would be seen.
NEGLIGIBLE = 1e-4
#: A component whose polynomial strays from the inner stages by more than this many of its changes
#: in the step has a stiff part that has not died away: its slope says nothing beyond some instants,
#: and it keeps the collocation polynomial.
STRAY = 5.0


@compiled
def find_slope(
    t: float,
    h: float,
    work: RadauState,
    system: System,
    loops: Any,
    tangent: Tangent,
    matrix: StageMatrix,
) -> float:
    """dy/dt at the trial state, at t + h, into TRIAL_SLOPE."""
    t1 = t + h
    y, out = work.state[TRIAL], work.state[TRIAL_SLOPE]
    inverse, stages = work.method.inverse, work.Z
    metric, force = system.metric, system.force
    n = metric.shape[0] - 1
    place_state(y, system)
    if system.row.shape[0] > 0:
        call_kinds(VALUE, VALUE, t1, system, loops, force, force, force)
        linearise(t1, system, loops)
        scale_slopes(inverse, stages, h, metric, system.acceleration)
        acceleration_residual(system)
        factorise(system, PART)
        correct(system)
    else:
        zero(system.change)
    rates(y, metric, system.change, out)
    last = y.shape[0] - 1
    for k in range(states_offset(n), last):
        out[k] = 0.0
    for k in range(velocity_offset(1, n), last):
        out[k] += (inverse[2, 0] * stages[0, k] + inverse[2, 1] * stages[1, k]
                   + inverse[2, 2] * stages[2, k]) / h  # fmt: skip
    out[last] = work.F[2, last]
    return 0.0


@compiled
def scale_slopes(inverse: Floats, stages: Floats, h: float, metric: Floats, force: Floats) -> None:
    """The collocation polynomial's accelerations at the end of the step, scaled, into force."""
    n = metric.shape[0] - 1
    for b in range(1, n + 1):
        f, o, k = velocity_offset(b, n), 6 * b, metric[b]
        for c in range(6):
            force[o + c] = (inverse[2, 0] * stages[0, f + c] + inverse[2, 1] * stages[1, f + c]
                            + inverse[2, 2] * stages[2, f + c]) / h  # fmt: skip
        for c in range(3):
            force[o + c] /= k[0]
        z2 = force[o + 5] / k[6]
        z1 = (force[o + 4] - k[5] * z2) / k[4]
        force[o + 3] = (force[o + 3] - k[2] * z1 - k[3] * z2) / k[1]
        force[o + 4], force[o + 5] = z1, z2


@compiled
def prepare_dense(h: float, work: RadauState) -> None:
    """Terms of dense output from t to the trial state, for combination.interpolate."""
    state, terms, stages, c = work.state, work.terms, work.Z, work.method.c
    work.t_dense, work.h_dense = work.t, h
    q = work.accepted_step / h
    first = work.has_last_step == 0 or q < NEGLIGIBLE
    for k in range(state.shape[1]):
        y, rise = state[Y, k], state[TRIAL, k] - state[Y, k]
        terms[0, k], terms[1, k] = y, rise
        terms[4, k] = terms[5, k] = 0.0
        a = (stages[0, k] / c[0] - rise) / (1.0 - c[0])
        b = (stages[1, k] / c[1] - rise) / (1.0 - c[1])
        terms[3, k] = (b - a) / (c[1] - c[0])
        terms[2, k] = a - c[0] * terms[3, k]
        if first:
            continue
        r2 = h * state[SLOPE, k] - rise
        r3 = rise - h * state[TRIAL_SLOPE, k] - r2
        square = q * (1.0 + q) * (q * (1.0 + q))
        # the cubic through both ends, and its slope, at the start of the step before
        value = y - q * (rise + (1.0 + q) * (r2 - q * r3))
        slope = rise + (1.0 + 2.0 * q) * r2 - (2.0 + 3.0 * q) * q * r3
        at = (state[OLD, k] - value) / square
        bend = h * state[OLD_SLOPE, k] - slope + 2.0 * q * (1.0 + q) * (1.0 + 2.0 * q) * at
        r5 = bend / square
        r4 = at + q * r5
        off = max(
            abs(r2 + c[0] * (r3 + (1.0 - c[0]) * (r4 + c[0] * r5)) - a),
            abs(r2 + c[1] * (r3 + (1.0 - c[1]) * (r4 + c[1] * r5)) - b),
        )
        if off <= STRAY * max(abs(stages[0, k]), max(abs(stages[1, k]), abs(rise))):
            terms[2, k], terms[3, k], terms[4, k], terms[5, k] = r2, r3, r4, r5
