"""Dense output of a Radau step.

With three stages the collocation polynomial is of order 3 only, while end points of steps are of
order 5. So dense output is the polynomial of degree 5 with the values and slopes of three of them:
both ends of the step, and the start of the step before. Slopes of positions follow from the
velocities. Those of velocities are the collocation polynomial's, moved onto D v_dot = gamma, since
the multipliers of the stages are of order 3.

With more stages, and in a first step or behind a short one, it is the collocation polynomial, whose
rates are off by a multiple of (x - c_1) ... (x - c_s) and higher terms; that multiple is known at
the start of the step, where the rates are known, and its integral is taken away. What is left is
what the error of steps with more stages is held to (integration.py).
"""

from dap3d_core.assembly.arrays import VALUE, Floats, states_offset, velocity_offset
from dap3d_core.assembly.evaluate import call_kinds, copy, place_state, rates, zero
from dap3d_core.assembly.metric import scaled
from dap3d_core.formulations.common import constraints
from dap3d_core.integrators.radau.newton import method_index
from dap3d_core.integrators.radau.state import OLD, OLD_SLOPE, SLOPE, TRIAL_SLOPE, Given, RadauState
from dap3d_core.integrators.radau.tableau import FEWEST
from dap3d_core.integrators.stepping.integration_state import ABSOLUTE, TRIAL, Y
from dap3d_core.kernels.runtime.cache import compiled

#: A step before that was shorter than this part of the present one says nothing: rounding of it and
#: of its rates, divided by the square, would be seen.
NEGLIGIBLE = 1e-2
#: A component whose polynomial strays from the inner stages by more than this many of its changes
#: in the step has a stiff part that has not died away: its slope says nothing beyond some instants,
#: and it keeps the collocation polynomial.
STRAY = 5.0


@compiled
def find_slope(t: float, h: float, work: RadauState, given: Given) -> float:
    """dy/dt at the trial state, at t + h, into TRIAL_SLOPE."""
    system, loops, _tangent, _matrix = given
    t1 = t + h
    y, out = work.state[TRIAL], work.state[TRIAL_SLOPE]
    inverse = work.method.inverse[method_index(work.stages), work.stages - 1]
    metric, force = system.metric, system.force
    n = metric.shape[0] - 1
    place_state(y, system)
    if system.row.shape[0] > 0:
        call_kinds(VALUE, VALUE, t1, system, loops, force, force, force)
        constraints.linearise(t1, system, loops)
        scale_slopes(inverse, h, work, metric, system.acceleration)
        constraints.acceleration_residual(system)
        constraints.factorise(system, constraints.PART)
        constraints.correct(system)
    else:
        zero(system.change)
    rates(y, metric, system.change, out)
    last = y.shape[0] - 1
    zero(out[states_offset(n) : last])
    for k in range(velocity_offset(1, n), last):
        out[k] += end_rate(inverse, h, work, k)
    out[last] = work.F[work.stages - 1, last]
    return 0.0


@compiled
def end_rate(inverse: Floats, h: float, work: RadauState, k: int) -> float:
    """Rate of component k of the collocation polynomial at the end of the step."""
    rate = 0.0
    for i in range(work.stages):
        rate += inverse[i] * work.Z[i, k]
    return rate / h


@compiled
def scale_slopes(inverse: Floats, h: float, work: RadauState, metric: Floats,
                 force: Floats) -> None:  # fmt: skip
    """The collocation polynomial's accelerations at the end of the step, scaled, into force."""
    n = metric.shape[0] - 1
    for b in range(1, n + 1):
        f, o, k = velocity_offset(b, n), 6 * b, metric[b]
        for c in range(6):
            force[o + c] = end_rate(inverse, h, work, f + c)
        for c in range(3):
            force[o + c] /= k[0]
        turn = scaled(k, force[o + 3], force[o + 4], force[o + 5])
        force[o + 3], force[o + 4], force[o + 5] = turn


@compiled
def prepare_dense(h: float, work: RadauState) -> None:
    """Terms of dense output from t to the trial state, for ``dense_state``."""
    work.t_dense, work.h_dense = work.t, h
    if work.stages > FEWEST or work.has_last_step == 0 or work.accepted_step < NEGLIGIBLE * h:
        of_collocation(h, work)
    else:
        of_three_ends(h, work)


@compiled
def of_collocation(h: float, work: RadauState) -> None:
    """The collocation polynomial with the rates at the start of the step as well."""
    stages, m = work.stages, method_index(work.stages)
    terms, nodes = work.terms, work.nodes
    c, e, bulge = work.method.c[m], work.method.e[m], work.method.bulge[m]
    work.dense_degree, leading, gamma = stages + 1, 1.0 / (stages + 1), work.method.poles[m, 0]
    nodes[0] = 0.0
    for i in range(stages):
        nodes[1 + i] = c[i]
        leading /= -c[i]
    for k in range(terms.shape[1]):
        off, size = h * work.state[SLOPE, k], max(abs(work.state[Y, k]), abs(work.state[TRIAL, k]))
        for i in range(stages):
            off += e[i] * work.Z[i, k]
        if not abs(off) <= gamma * (work.tolerance[ABSOLUTE, k] + work.rtol * size):
            off = 0.0  # not the error of the step: a stiff part, whose rates say nothing
        terms[0, k], terms[stages + 1, k] = 0.0, off * leading
        for i in range(stages):
            terms[1 + i, k] = work.Z[i, k] + off * bulge[i]
        for order in range(1, stages + 1):  # differences, divided
            for i in range(stages, order - 1, -1):
                gap = nodes[i] - nodes[i - order]
                terms[i, k] = (terms[i, k] - terms[i - 1, k]) / gap
        terms[0, k] = work.state[Y, k]


@compiled
def of_three_ends(h: float, work: RadauState) -> None:
    """The polynomial through both ends of the step, and the start of the step before."""
    state, terms, stages = work.state, work.terms, work.Z
    c, nodes = work.method.c[method_index(FEWEST)], work.nodes
    work.dense_degree = 5
    for k in range(6):
        nodes[k] = float(k % 2)
    q = work.accepted_step / h
    for k in range(state.shape[1]):
        y, rise = state[Y, k], state[TRIAL, k] - state[Y, k]
        terms[0, k], terms[1, k] = y, rise
        terms[4, k] = terms[5, k] = 0.0
        a = (stages[0, k] / c[0] - rise) / (1.0 - c[0])
        b = (stages[1, k] / c[1] - rise) / (1.0 - c[1])
        slope3 = (b - a) / (c[1] - c[0])
        terms[2, k], terms[3, k] = c[0] * slope3 - a, -slope3
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
            terms[2, k], terms[3, k], terms[4, k], terms[5, k] = -r2, -r3, r4, r5


@compiled
def dense_state(work: RadauState, t: float, y: Floats) -> None:
    """The state at an instant of the last step, by Newton's form of its dense output."""
    terms, nodes, theta = work.terms, work.nodes, (t - work.t_dense) / work.h_dense
    copy(y, terms[work.dense_degree])
    for row in range(work.dense_degree - 1, -1, -1):
        factor = theta - nodes[row]
        for i in range(y.shape[0]):
            y[i] = terms[row, i] + factor * y[i]
