"""The tangent of elements with states of their own, by differentiated loops as in jacobian.py.

With z the states of an element, x and v as there:

    rate by z, by x and v        of z_dot = rate(...)
    force by z                   of force + D^T lambda
    rows by z                    of C and D v - nu, of joints

All of them are blocks of the matrix of a stage, in which the states of an element are a node
(linear/lu.py).
"""

from typing import Any

from dap3d_core.assembly.arrays import Integers, System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.assembly.metric import in_body_axes, scaled_moment
from dap3d_core.formulations.stabilized_index2.jacobian import (
    C_BY_STATE,
    COUNT,
    FORCE_BY_STATE,
    JOINT_ELEMENT,
    KIND,
    LOOP,
    NU_BY_STATE,
    POSITION_ELEMENT,
    RATE_BY_BODY,
    RATE_BY_STATE,
    RATE_ELEMENT,
    ROWS,
    ROWS_OF,
    SLOT_COUNT,
    SLOTS_OF,
    STRIDE,
    VELOCITY,
    WIDTH,
    Tangent,
    call_element,
    clear,
    scale_columns,
    seed_positions,
    seed_velocities,
)
from dap3d_core.kernels.runtime.cache import compiled

#: Columns of ``StageMatrix.state_nodes``: first state, first unknown, place of the diagonal block;
#: of the block (joint, states): place, rows of the joint's node, of these the first of the joint,
#: and that in row vectors; number of states.
FIRST, UNKNOWN, DIAGONAL, JOINT_BLOCK, NODE_ROWS, ROW_SHIFT, FIRST_ROW, WIDTH_OF = range(8)


@compiled
def differentiate_states(t: float, system: System, loops: Any, tangent: Tangent) -> None:
    """Derivatives by and of all states, at the state that ``differentiate`` took.

    Args:
        t: time, s.
        system: of the evaluator.
        loops: with the differentiated ones.
        tangent: ``tangent.states.values`` are overwritten.
    """
    zero(tangent.states.values)
    for e in range(tangent.elements.shape[0]):
        row = tangent.elements[e]
        for q in range(system.groups[row[LOOP], 2] if tangent.states.at[e] >= 0 else 0):
            differentiate_by_states(t, e, q, system, loops, tangent)
            if row[KIND] == RATE_ELEMENT:
                differentiate_rate(t, e, q, system, loops, tangent)
    scale_state_tangent(system, tangent)


@compiled
def differentiate_by_states(
    t: float, e: int, q: int, system: System, loops: Any, tangent: Tangent
) -> None:
    """Add the derivatives of what an element returns by its own states, unscaled."""
    row, own, z = tangent.elements[e], tangent.states, tangent.wide.states
    first = system.idx[system.groups[row[LOOP], 0] + q * row[STRIDE] + own.at[e]]
    record = own.records[own.record[first]]
    m, size = record[COUNT], 6 * row[SLOT_COUNT]
    for k in range(m):
        z[WIDTH * (first + k) + 1] = 1.0
        call_element(t, e, q, system, loops, tangent)
        z[WIDTH * (first + k) + 1] = 0.0
        if row[KIND] == RATE_ELEMENT:
            add_column(0, m, record[RATE_BY_STATE] + k, m, tangent)
        elif row[KIND] == POSITION_ELEMENT:
            add_column(0, row[ROWS], record[C_BY_STATE] + k, m, tangent)
        else:
            add_column(0, size, record[FORCE_BY_STATE] + k, m, tangent)
            rows = row[ROWS] if row[KIND] == JOINT_ELEMENT else 0
            add_column(size, rows, record[NU_BY_STATE] + k, m, tangent)


@compiled
def add_column(first: int, count: int, place: int, stride: int, tangent: Tangent) -> None:
    """Add slopes of ``count`` outputs of an element to every stride-th value from a place on."""
    for c in range(count):
        tangent.states.values[place + stride * c] += tangent.out[WIDTH * (first + c) + 1]


@compiled
def differentiate_rate(
    t: float, e: int, q: int, system: System, loops: Any, tangent: Tangent
) -> None:
    """Derivatives of the rates of an element by the coordinates of its bodies, unscaled."""
    row, own, wide = tangent.elements[e], tangent.states, tangent.wide
    i0 = system.groups[row[LOOP], 0] + q * row[STRIDE]
    record = own.records[own.record[system.idx[i0 + own.at[e]]]]
    m = record[COUNT]
    for n in range(row[SLOT_COUNT]):
        b, o = system.idx[i0 + n], record[RATE_BY_BODY] + 12 * m * n
        if b == 0:
            continue
        seed_positions(wide.body[b], system.body[b])
        for level in range(1 + row[VELOCITY]):
            if level == 1:
                seed_velocities(wide.body[b], system.body[b])
            call_element(t, e, q, system, loops, tangent)
            for k in range(m):
                for c in range(6):
                    own.values[o + 12 * k + 6 * level + c] = tangent.out[WIDTH * k + 1 + c]
        clear(wide.body[b])


@compiled
def scale_state_tangent(system: System, tangent: Tangent) -> None:
    """Derivatives into the bodies' scaled coordinates."""
    own, v = tangent.states, tangent.states.values
    for e in range(tangent.elements.shape[0]):
        row = tangent.elements[e]
        for q in range(system.groups[row[LOOP], 2] if row[KIND] == RATE_ELEMENT else 0):
            i0 = system.groups[row[LOOP], 0] + q * row[STRIDE]
            record = own.records[own.record[system.idx[i0 + tangent.states.at[e]]]]
            m = record[COUNT]
            for n in range(row[SLOT_COUNT]):
                b = system.idx[i0 + n]
                s, k = system.body[b], system.metric[b]
                o = record[RATE_BY_BODY] + 12 * m * n
                for c in range(m if b > 0 else 0):
                    scale_columns(v, o + 12 * c, k, s)
                    scale_columns(v, o + 12 * c + 6, k, s)
                o = record[FORCE_BY_STATE] + 6 * m * n
                for c in range(o, o + m if b > 0 else o):
                    f0, f1, f2 = in_body_axes(s, v[c], v[c + m], v[c + 2 * m])
                    v[c], v[c + m], v[c + 2 * m] = k[0] * f0, k[0] * f1, k[0] * f2
                    c3, c4, c5 = c + 3 * m, c + 4 * m, c + 5 * m
                    v[c3], v[c4], v[c5] = scaled_moment(k, v[c3], v[c4], v[c5])


@compiled
def fill_states(s: Any, K: Any, nodes: Integers, places: Integers, held: Integers,
                tangent: Tangent) -> None:  # fmt: skip
    """The blocks of states in s - J, for real or complex s in 1/s.

    Args:
        s, K: as of ``fill_matrix``.
        nodes: (elements, 8) FIRST, UNKNOWN, ... of each element with states.
        places: (elements, 2 slots) of each slot the places of the blocks (states, body) and
            (body, states); -1 for ground.
        held: (row_size,) 1 where a row has a position level.
        tangent: with the derivatives.
    """
    v = tangent.states.values
    for e in range(nodes.shape[0]):
        record = tangent.states.records[e]
        m, d = record[COUNT], nodes[e, DIAGONAL]
        for c in range(m):
            K[d + (m + 1) * c] = s
            for k in range(m):
                K[d + m * c + k] -= v[record[RATE_BY_STATE] + m * c + k]
        for n in range(record[SLOTS_OF]):
            if places[e, 2 * n] >= 0:
                o = record[RATE_BY_BODY] + 12 * m * n
                for k in range(12 * m):
                    K[places[e, 2 * n] + k] = -v[o + k]
                o = record[FORCE_BY_STATE] + 6 * m * n
                for k in range(6 * m):
                    K[places[e, 2 * n + 1] + 6 * m + k] = -v[o + k]
        for r in range(record[ROWS_OF]):
            d, count = nodes[e, JOINT_BLOCK], nodes[e, NODE_ROWS]
            o, at = m * r, m * (nodes[e, ROW_SHIFT] + r)
            for k in range(m):
                if held[nodes[e, FIRST_ROW] + r] != 0:
                    K[d + at + k] = -v[record[C_BY_STATE] + o + k]
                K[d + m * count + at + k] = -v[record[NU_BY_STATE] + o + k]
