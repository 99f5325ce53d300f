"""One stage of an implicit method on the stabilised equations of index 2, and its linear systems.

Gear, Gupta, Leimkuhler (J. Comp. Appl. Math. 12 & 13, 1985): position and velocity constraints both
hold, and mu, the multipliers of the position level, vanish in the solution:

    q_dot = v + M^-1 D^T mu        M v_dot = g + D^T lambda        C = 0        D v - nu = 0

An implicit stage asks for s z - J z = r with the tangent J, and s real or complex. Unknowns are, in
the bodies' scaled coordinates, displacement x and velocity v of each body and mu, lambda of each
joint node. Each stage has them in the axes that its bodies have there, translations too: one
tangent for all stages would otherwise be wrong by stiffness times the rotation during a step. A
change of Euler parameters is 1/2 L^T theta' + p n, with n along p: n is eliminated in closed form,
so that a body has twelve unknowns.

A row without a position level has mu = 0 as its equation.
"""

from typing import Any

import attrs

from dap3d_core.assembly.arrays import (
    Floats,
    Integers,
    System,
    coordinate_offset,
    states_offset,
    velocity_offset,
)
from dap3d_core.assembly.evaluate import copy, evaluate_forces, put_rates, zero
from dap3d_core.assembly.metric import in_body_axes, scaled, scaled_moment, unscaled
from dap3d_core.assembly.state_update import add_displacement
from dap3d_core.formulations.common import constraints
from dap3d_core.formulations.common.friction import (
    apply_friction,
    has_friction,
    store_applied_forces,
)
from dap3d_core.formulations.stabilized_index2 import jacobian
from dap3d_core.formulations.stabilized_index2.jacobian import Tangent, turn_to_body
from dap3d_core.formulations.stabilized_index2.state_tangent import (
    FIRST,
    UNKNOWN,
    WIDTH_OF,
    fill_states,
)
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ldlt.factor import weigh_alike


@attrs.frozen(eq=False, kw_only=True, slots=False)
class StageMatrix(Arrays):
    """Layout of s - J, and data of the state that it belongs to."""

    nodes: IntegerMatrix  # of linear.lu.LuPlan, as the next two
    columns: IntegerMatrix
    updates: IntegerMatrix
    body_first: Integers  # (n + 1,) first unknown of each body
    body_place: Integers  # (n + 1,) its diagonal block
    pair_place: Integers  # (pairs,) block of each pair of Tangent.blocks
    block_place: IntegerMatrix  # (b, 3) of blocks of D: (joint, body), (body, joint), unknown
    joint_place: IntegerMatrix  # (joint nodes, 3) diagonal block, rows, first row
    read_place: IntegerMatrix  # (k, 3) of readings: block, rows of its joint node, first row
    state_nodes: IntegerMatrix  # as of ``fill_states``, as the next one
    state_places: IntegerMatrix
    held: Integers  # (row_size,) 1 where a row has a position level
    spin: Matrix  # (n + 1, 15): L^T [w' x] U / 2 by rows; L^T w'; U^T w'
    D: Floats  # (block_size,)
    compliance: Floats  # (row_size,) what regularises the rows


@compiled
def add_transposed(blocks: Integers, D: Floats, x: Floats, sign: float, g: Floats) -> None:
    """G += sign D^T x, in scaled coordinates."""
    for q in range(blocks.shape[0]):
        o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
        for r in range(blocks[q, 2]):
            s = sign * x[f + r]
            for c in range(6):
                g[b + c] += D[o + c] * s
            o += 6


@compiled
def evaluate_stage(
    t: float,
    y: Floats,
    multipliers: Floats,
    held: Integers,
    out: Floats,
    rows: Floats,
    system: System,
    loops: Any,
) -> None:
    """Right-hand sides of all equations.

    Args:
        t, y: time, state (13 n + 1,).
        multipliers: (2, row_size) mu, lambda.
        held: as in ``StageMatrix``.
        out: (13 n + 1,) rates of y, the power last.
        rows: (2, row_size) residuals of the position and the velocity level.
        system, loops: of the evaluator.
    """
    x, mu = system.multipliers, multipliers[0]
    for k in range(x.shape[0]):
        x[k] = -multipliers[1, k]
    power = evaluate_forces(t, y, system, loops)
    constraints.linearise(t, system, loops)
    if has_friction(system):
        store_applied_forces(system)
        power += apply_friction(t, system, loops)
    add_transposed(system.blocks, system.D, x, -1.0, system.acceleration)
    put_rates(t, y, power + constraints.power_of_drivers(system), out, system, loops)
    zero(system.change)
    add_transposed(system.blocks, system.D, mu, 1.0, system.change)
    add_displacement(y, system.metric, system.change, out)
    constraints.residuals(t, system, loops)
    for k in range(x.shape[0]):
        rows[0, k] = system.residual[k] if held[k] != 0 else mu[k]
    constraints.velocity_residuals(system)
    copy(rows[1], system.residual)


@compiled
def keep_state(system: System, matrix: StageMatrix, part: float) -> None:
    """Store what the matrix needs of the bodies as placed and of the current D^."""
    for q in range(system.blocks.shape[0]):
        s = system.body[system.blocks[q, 1]]
        for o in range(system.blocks[q, 0], system.blocks[q, 0] + 6 * system.blocks[q, 2], 6):
            copy(matrix.D[o : o + 6], system.D[o : o + 6])
            turn_to_body(matrix.D, o, s)
    zero(matrix.compliance)
    for q in range(system.blocks.shape[0] if part > 0.0 else 0):
        o, f = system.blocks[q, 0], system.blocks[q, 3]
        for r in range(system.blocks[q, 2]):
            for c in range(o, o + 6):
                matrix.compliance[f + r] += part * system.D[c] * system.D[c]
            o += 6
    if part > 0.0 and constraints.slide_sharing(system):
        weigh_alike(system.blocks, system.D, part, 0.0, matrix.compliance)
    for f in range(matrix.compliance.shape[0] if part > 0.0 else 0):
        if matrix.compliance[f] == 0.0:  # a row that is zero, as of an open contact
            matrix.compliance[f] = 1.0
    for b in range(1, system.body.shape[0]):
        s, k, z = system.body[b], system.metric[b], matrix.spin[b]
        w0, w1, w2 = in_body_axes(s, s[15], s[16], s[17])
        for c in range(3):
            u0, u1, u2 = unscaled(k, float(c == 0), float(c == 1), float(c == 2))
            a0, a1, a2 = w1 * u2 - w2 * u1, w2 * u0 - w0 * u2, w0 * u1 - w1 * u0
            a0, a1, a2 = scaled(k, a0, a1, a2)
            z[c], z[c + 3], z[c + 6] = 0.5 * a0, 0.5 * a1, 0.5 * a2
        z[9], z[10], z[11] = scaled(k, w0, w1, w2)
        z[12], z[13], z[14] = scaled_moment(k, w0, w1, w2)


@compiled
def fill_matrix(s: Any, K: Any, blocks: Integers, matrix: StageMatrix, tangent: Tangent) -> None:
    """K = s - J, for real or complex s in 1/s."""
    for k in range(K.shape[0]):
        K[k] = 0.0
    for b in range(1, matrix.body_place.shape[0]):
        d, z = matrix.body_place[b], matrix.spin[b]
        for c in range(6):
            K[d + 13 * c] = s
            K[d + 12 * c + 6 + c] = -1.0
            K[d + 13 * (6 + c)] = s
        for r in range(3):
            for c in range(3):
                K[d + 12 * (3 + r) + 3 + c] += z[3 * r + c] + 0.25 / s * (z[9 + r] * z[12 + c])
    for p in range(matrix.pair_place.shape[0]):
        o, d = tangent.blocks[p, 0], matrix.pair_place[p] + 72
        for c in range(72):
            K[d + c] -= tangent.coupling[o + c]
    for q in range(blocks.shape[0]):
        o, m, f = blocks[q, 0], blocks[q, 2], blocks[q, 3]
        below, right = matrix.block_place[q, 0], matrix.block_place[q, 1]
        for r in range(m):
            e = below + 12 * (m + r)
            for c in range(6):
                v = matrix.D[o + c]
                if matrix.held[f + r] != 0:
                    K[below + 12 * r + c] = -v
                    K[right + 2 * m * c + r] = -v
                K[e + c] = -tangent.turning[o + c]
                K[e + 6 + c] = -v
                K[right + 2 * m * (6 + c) + m + r] = -v
            o += 6
    for p in range(matrix.read_place.shape[0]):
        o, rows = tangent.readings[p, jacobian.PLACE], tangent.readings[p, jacobian.ROW_COUNT]
        right, m, first = matrix.read_place[p, 0], matrix.read_place[p, 1], matrix.read_place[p, 2]
        for r in range(rows if o >= 0 else 0):
            for c in range(6):
                K[right + 2 * m * (6 + c) + m + first + r] -= tangent.force_by_lambda[o + 6 * r + c]
    for j in range(matrix.joint_place.shape[0]):
        d, m, f = matrix.joint_place[j, 0], matrix.joint_place[j, 1], matrix.joint_place[j, 2]
        for r in range(m):
            given = matrix.compliance[f + r] / s
            K[d + r * (2 * m + 1)] = -given if matrix.held[f + r] != 0 else -1.0
            K[d + (m + r) * (2 * m + 1)] = -given
    fill_states(s, K, matrix.state_nodes, matrix.state_places, matrix.held, tangent)


@compiled
def keep_frames(body: Floats, frames: Floats) -> None:
    """The axes and Euler parameters of the bodies as placed."""
    for b in range(1, body.shape[0]):
        for c in range(9):
            frames[b, c] = body[b, 3 + c]
        for c in range(4):
            frames[b, 9 + c] = body[b, 18 + c]


@compiled
def scale_residual(
    R: Floats,
    rows: Floats,
    system: System,
    matrix: StageMatrix,
    frames: Floats,
    x: Floats,
    n: Floats,
) -> None:
    """Residuals of y (13 n + 1,) and of both levels (2, rows) as right-hand side x.

    n: (bodies + 1,) the parts along the Euler parameters.
    """
    blocks, metric = system.blocks, system.metric
    count = metric.shape[0] - 1
    for b in range(1, count + 1):
        c, f, o = coordinate_offset(b), velocity_offset(b, count), matrix.body_first[b]
        k, e = metric[b], frames[b]
        for d in range(3):
            x[o + d] = (e[d] * R[c] + e[3 + d] * R[c + 1] + e[6 + d] * R[c + 2]) / k[0]
            x[o + 6 + d] = (e[d] * R[f] + e[3 + d] * R[f + 1] + e[6 + d] * R[f + 2]) / k[0]
        p0, p1, p2, p3 = R[c + 3], R[c + 4], R[c + 5], R[c + 6]
        t0 = -e[10] * p0 + e[9] * p1 + e[12] * p2 - e[11] * p3
        t1 = -e[11] * p0 - e[12] * p1 + e[9] * p2 + e[10] * p3
        t2 = -e[12] * p0 + e[11] * p1 - e[10] * p2 + e[9] * p3
        n[b] = e[9] * p0 + e[10] * p1 + e[11] * p2 + e[12] * p3
        t0, t1, t2 = scaled(k, t0, t1, t2)
        x[o + 3], x[o + 4], x[o + 5] = 2.0 * t0, 2.0 * t1, 2.0 * t2
        x[o + 9], x[o + 10], x[o + 11] = scaled(k, R[f + 3], R[f + 4], R[f + 5])
    for q in range(blocks.shape[0]):
        m, f, o = blocks[q, 2], blocks[q, 3], matrix.block_place[q, 2]
        for r in range(m):
            x[o + r], x[o + m + r] = rows[0, f + r], rows[1, f + r]
    for s in range(matrix.state_nodes.shape[0]):
        z, o = states_offset(count) + matrix.state_nodes[s, FIRST], matrix.state_nodes[s, UNKNOWN]
        for d in range(matrix.state_nodes[s, WIDTH_OF]):
            x[o + d] = R[z + d]


@compiled
def couple_length(s: Any, x: Any, n: Any, matrix: StageMatrix) -> None:
    """Adds the eliminated part along p to the right-hand side."""
    for b in range(1, matrix.body_first.shape[0]):
        o, z = matrix.body_first[b] + 3, matrix.spin[b]
        for c in range(3):
            x[o + c] += z[9 + c] * n[b] / s


@compiled
def find_length(s: Any, x: Any, n: Any, matrix: StageMatrix) -> None:
    """The part along p from the solution x, into n."""
    for b in range(1, matrix.body_first.shape[0]):
        o, z = matrix.body_first[b] + 3, matrix.spin[b]
        along = z[12] * x[o] + z[13] * x[o + 1] + z[14] * x[o + 2]
        n[b] = (n[b] - 0.25 * along) / s


@compiled
def unscale_solution(
    x: Floats,
    n: Floats,
    system: System,
    matrix: StageMatrix,
    frames: Floats,
    out: Floats,
    rows: Floats,
) -> None:
    """A solution x as a change of y (13 n + 1,) and of the multipliers (2, rows)."""
    blocks, metric = system.blocks, system.metric
    count = metric.shape[0] - 1
    for b in range(1, count + 1):
        c, f, o = coordinate_offset(b), velocity_offset(b, count), matrix.body_first[b]
        k, e, along = metric[b], frames[b], n[b]
        for d in range(3):
            g = 3 * d
            out[c + d] = k[0] * (e[g] * x[o] + e[g + 1] * x[o + 1] + e[g + 2] * x[o + 2])
            out[f + d] = k[0] * (e[g] * x[o + 6] + e[g + 1] * x[o + 7] + e[g + 2] * x[o + 8])
        w0, w1, w2 = unscaled(k, x[o + 3], x[o + 4], x[o + 5])
        w0, w1, w2 = 0.5 * w0, 0.5 * w1, 0.5 * w2
        out[c + 3] = e[9] * along - e[10] * w0 - e[11] * w1 - e[12] * w2
        out[c + 4] = e[10] * along + e[9] * w0 - e[12] * w1 + e[11] * w2
        out[c + 5] = e[11] * along + e[12] * w0 + e[9] * w1 - e[10] * w2
        out[c + 6] = e[12] * along - e[11] * w0 + e[10] * w1 + e[9] * w2
        out[f + 3], out[f + 4], out[f + 5] = unscaled(k, x[o + 9], x[o + 10], x[o + 11])
    out[out.shape[0] - 1] = 0.0
    for s in range(matrix.state_nodes.shape[0]):
        z, o = states_offset(count) + matrix.state_nodes[s, FIRST], matrix.state_nodes[s, UNKNOWN]
        for d in range(matrix.state_nodes[s, WIDTH_OF]):
            out[z + d] = x[o + d]
    for q in range(blocks.shape[0]):
        m, f, o = blocks[q, 2], blocks[q, 3], matrix.block_place[q, 2]
        for r in range(m):
            rows[0, f + r], rows[1, f + r] = x[o + r], x[o + m + r]
