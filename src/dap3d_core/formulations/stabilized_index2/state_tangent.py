"""Tables of the tangent (jacobian.py), and the tangent of elements with states of their own.

Tables hold the bodies that each element couples, and the places of its derivatives. With z the
states of an element, x and v as in jacobian.py, differentiated loops give

    rate by z, by x and v        of z_dot = rate(...)
    force by z                   of force + D^T lambda
    rows by z                    of C and D v - nu, of joints

All of them are blocks of the matrix of a stage, in which the states of an element are a node
(linear/lu.py).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Integers, System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.stabilized_index2 import jacobian
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.interface.codegen.kernel_arguments import in_order, parameters
from dap3d_core.interface.codegen.loop_source import computes_rate, stride
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.function_lists import LoopArrays, loop_list
from dap3d_core.kernels.runtime.loop_modules import build_differentiated
from dap3d_core.model import Group, Model

_KINDS = {
    "wrench": jacobian.WRENCH_ELEMENT,
    "acceleration": jacobian.JOINT_ELEMENT,
    "friction": jacobian.FRICTION_ELEMENT,
}
#: The same of types with states of their own, as their derivatives by states need them.
_WITH_STATES = {"rate": jacobian.RATE_ELEMENT, "position": jacobian.POSITION_ELEMENT}
#: Members of ``Tangent`` that differentiated loops write, and what is made of it.
OF_LOOPS = ("D", "gamma", "nu", "minus_lambda", "force", "out", "kept", "ahead")
#: Numbers of a block of ``coupling``.
_BLOCK = 72


def make_tangent(evaluator: Evaluator) -> tuple[jacobian.Tangent, Any]:
    """Tables and arrays of the tangent of an evaluator's model; all loops, with those it calls."""
    system, plan, model = evaluator.system, evaluator.plan, evaluator.model
    n = model.body_count
    place = {(b, b): _BLOCK * (b - 1) for b in range(1, n + 1)}
    elements: list[tuple[int, ...]] = []
    at: list[int] = []
    pairs: list[Integers] = []
    readings: list[tuple[int, ...]] = []
    loops: list[Any] = list(evaluator.loops)
    count = widest = size = 0
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        layout = group.type_info.layout
        kinds = _KINDS | _WITH_STATES if layout.states else _KINDS
        if kind not in kinds:
            continue
        codes = [kinds[kind]]
        if kind == "wrench" and computes_rate(group.type_info):
            codes.append(jacobian.RATE_ELEMENT)
        slots = len(group.type_info.layout.slots)
        rows = group.type_info.row_count
        read = _joints_read(group) if kind == "friction" else []
        elements += [(loop, len(loops), code, stride(group.type_info), layout.par_width, slots,
                      layout.integers, rows, count, int(_sees_velocity(kind, group)),
                      len(readings), len(read)) for code in codes]  # fmt: skip
        if source := write(group.type_info, kind):
            loops.append(build_differentiated(source, jacobian.WIDTH))
        at += [layout.integers - 1 if layout.states else -1 for _ in codes]
        for q, bodies in enumerate(group.bodies.tolist()):
            for joints in read:
                first, mine = int(plan.joint_row[joints[q]]), int(model.joint_rows[joints[q]])
                for b in bodies:
                    readings.append((size if b else -1, b, first, mine))
                    size += 6 * mine if b else 0
        pairs.append(_pairs(group.bodies, place))
        count += pairs[-1].size
        widest = max(widest, 6 * slots + rows, layout.state_width)
    blocks = [(where, a, b) for (a, b), where in place.items()]
    sizes = (plan.block_size, *(3 * [plan.row_size]), system.force.size, *(3 * [widest]))
    tangent = jacobian.Tangent(
        elements=np.array(elements, dtype=np.int64).reshape(-1, jacobian.ELEMENT_WIDTH),
        pairs=np.concatenate([np.zeros(0, dtype=np.int64), *pairs]),
        blocks=np.array(blocks, dtype=np.int64).reshape(-1, 3),
        coupling=np.zeros(_BLOCK * len(place)),
        turning=np.zeros(plan.block_size),
        readings=np.array(readings, dtype=np.int64).reshape(-1, 4),
        force_by_lambda=np.zeros(size),
        bends=np.zeros(1),
        states=_state_tangent(evaluator.model, at),
        wide=_wide(system),
        **{
            name: np.zeros(jacobian.WIDTH * numbers)
            for name, numbers in zip(OF_LOOPS, sizes, strict=True)
        },
    )
    return tangent, loop_list(loops)


def _wide(system: Any) -> LoopArrays:
    """Arrays of differentiated loops: ``WIDTH`` numbers for each of a system's."""
    arrays = {name: getattr(system, name) for name in ("body", "F", "par", "states")}
    wide = {
        name: np.zeros((*x.shape[:-1], jacobian.WIDTH * x.shape[-1])) for name, x in arrays.items()
    }
    return LoopArrays(idx=system.idx, **wide)


def _state_tangent(model: Model, at: Sequence[int]) -> jacobian.StateTangent:
    """Tables and arrays of the derivatives by and of states; at: as of ``StateTangent``."""
    records: list[tuple[int, ...]] = []
    record = np.zeros(model.state_count, dtype=np.int64)
    start = size = 0
    for group in model.acting:
        layout, rows = group.type_info.layout, int(getattr(group.type_info.type, "rows", 0))
        m, slots = layout.state_width, len(layout.slots)
        for _ in range(group.count if m else 0):
            record[start] = len(records)
            places = np.cumsum([size, m * m, 12 * m * slots, 6 * m * slots, rows * m, rows * m])
            records.append((m, *places[:-1].tolist(), slots, rows))
            start, size = start + m, int(places[-1])
    return jacobian.StateTangent(
        at=np.array(at, dtype=np.int64),
        records=np.array(records, dtype=np.int64).reshape(-1, 8),
        record=record,
        values=np.zeros(size),
    )


def _joints_read(group: Group) -> list[Integers]:
    """The joints, or contacts, whose multipliers the instances of a group read, (m,) each."""
    if group.type_info.type.is_contact:
        return [group.members] if group.loaded is None else [group.members, group.loaded]
    return [read.members for read in group.read] if group.joints is None else [group.joints]


def _pairs(bodies: Integers, place: dict[tuple[int, int], int]) -> Integers:
    """(m slots^2,) place of the block of each pair of an element's slots; new ones are added.

    A pair with ground, or with a slot whose body an earlier slot has, has none: -1.
    """
    found: list[int] = []
    for slots in bodies.tolist():
        there = [b if b and b not in slots[:n] else 0 for n, b in enumerate(slots)]
        for a in there:
            found += [
                place.setdefault((a, b), _BLOCK * len(place)) if a and b else -1 for b in there
            ]
    return np.array(found, dtype=np.int64)


def _sees_velocity(kind: str, group: Group) -> bool:
    """True if the force kernel of a group names a quantity of the velocity level.

    The rate D v - nu of a joint is linear in the velocities: its derivative is D.
    """
    if kind in ("acceleration", "position"):
        return False
    kernels = group.type_info.kernels
    wanted: Sequence[Any] = parameters(kernels[kind])
    if kind == "wrench" and "rate" in kernels:
        wanted = [*wanted, *parameters(kernels["rate"])]
    return any(q.velocity for q in in_order(group.type_info.names, wanted))


#: Columns of ``StageMatrix.state_nodes``: first state, first unknown, place of the diagonal block;
#: of the block (joint, states): place, rows of the joint's node, of these the first of the joint,
#: and that in row vectors; number of states.
FIRST, UNKNOWN, DIAGONAL, JOINT_BLOCK, NODE_ROWS, ROW_SHIFT, FIRST_ROW, WIDTH_OF = range(8)


@compiled
def differentiate_states(t: float, system: System, loops: Any, tangent: jacobian.Tangent) -> None:
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
        for q in range(system.groups[row[jacobian.LOOP], 2] if tangent.states.at[e] >= 0 else 0):
            differentiate_by_states(t, e, q, system, loops, tangent)
            if row[jacobian.KIND] == jacobian.RATE_ELEMENT:
                differentiate_rate(t, e, q, system, loops, tangent)
    scale_state_tangent(system, tangent)


@compiled
def differentiate_by_states(
    t: float, e: int, q: int, system: System, loops: Any, tangent: jacobian.Tangent
) -> None:
    """Add the derivatives of what an element returns by its own states, unscaled."""
    row, own, z = tangent.elements[e], tangent.states, tangent.wide.states
    first = system.idx[system.groups[row[jacobian.LOOP], 0] + q * row[jacobian.STRIDE] + own.at[e]]
    record = own.records[own.record[first]]
    m, size = record[jacobian.COUNT], 6 * row[jacobian.SLOT_COUNT]
    for k in range(m):
        z[jacobian.WIDTH * (first + k) + 1] = 1.0
        jacobian.call_element(t, e, q, system, loops, tangent)
        z[jacobian.WIDTH * (first + k) + 1] = 0.0
        if row[jacobian.KIND] == jacobian.RATE_ELEMENT:
            add_column(0, m, record[jacobian.RATE_BY_STATE] + k, m, tangent)
        elif row[jacobian.KIND] == jacobian.POSITION_ELEMENT:
            add_column(0, row[jacobian.ROWS], record[jacobian.C_BY_STATE] + k, m, tangent)
        else:
            add_column(0, size, record[jacobian.FORCE_BY_STATE] + k, m, tangent)
            rows = row[jacobian.ROWS] if row[jacobian.KIND] == jacobian.JOINT_ELEMENT else 0
            add_column(size, rows, record[jacobian.NU_BY_STATE] + k, m, tangent)


@compiled
def add_column(first: int, count: int, place: int, stride: int, tangent: jacobian.Tangent) -> None:
    """Add slopes of ``count`` outputs of an element to every stride-th value from a place on."""
    for c in range(count):
        tangent.states.values[place + stride * c] += tangent.out[jacobian.WIDTH * (first + c) + 1]


@compiled
def differentiate_rate(
    t: float, e: int, q: int, system: System, loops: Any, tangent: jacobian.Tangent
) -> None:
    """Derivatives of the rates of an element by the coordinates of its bodies, unscaled."""
    row, own, wide = tangent.elements[e], tangent.states, tangent.wide
    i0 = system.groups[row[jacobian.LOOP], 0] + q * row[jacobian.STRIDE]
    record = own.records[own.record[system.idx[i0 + own.at[e]]]]
    m = record[jacobian.COUNT]
    for n in range(row[jacobian.SLOT_COUNT]):
        b, o = system.idx[i0 + n], record[jacobian.RATE_BY_BODY] + 12 * m * n
        if b == 0:
            continue
        jacobian.seed_positions(wide.body[b], system.body[b])
        for level in range(1 + row[jacobian.VELOCITY]):
            if level == 1:
                jacobian.seed_velocities(wide.body[b], system.body[b])
            jacobian.call_element(t, e, q, system, loops, tangent)
            for k in range(m):
                for c in range(6):
                    own.values[o + 12 * k + 6 * level + c] = tangent.out[jacobian.WIDTH * k + 1 + c]
        jacobian.clear(wide.body[b])


@compiled
def scale_state_tangent(system: System, tangent: jacobian.Tangent) -> None:
    """Derivatives into the bodies' scaled coordinates."""
    own, v = tangent.states, tangent.states.values
    for e in range(tangent.elements.shape[0]):
        row = tangent.elements[e]
        is_rate = row[jacobian.KIND] == jacobian.RATE_ELEMENT
        for q in range(system.groups[row[jacobian.LOOP], 2] if is_rate else 0):
            i0 = system.groups[row[jacobian.LOOP], 0] + q * row[jacobian.STRIDE]
            record = own.records[own.record[system.idx[i0 + tangent.states.at[e]]]]
            m = record[jacobian.COUNT]
            for n in range(row[jacobian.SLOT_COUNT]):
                b = system.idx[i0 + n]
                s, k = system.body[b], system.metric[b]
                o = record[jacobian.RATE_BY_BODY] + 12 * m * n
                for c in range(m if b > 0 else 0):
                    jacobian.scale_columns(v, o + 12 * c, k, s)
                    jacobian.scale_columns(v, o + 12 * c + 6, k, s)
                o = record[jacobian.FORCE_BY_STATE] + 6 * m * n
                for c in range(o, o + m if b > 0 else o):
                    jacobian.scale_column(v, c, m, k, s)


@compiled
def fill_states(s: Any, K: Any, nodes: Integers, places: Integers, held: Integers,
                tangent: jacobian.Tangent) -> None:  # fmt: skip
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
        m, d = record[jacobian.COUNT], nodes[e, DIAGONAL]
        for c in range(m):
            K[d + (m + 1) * c] = s
            for k in range(m):
                K[d + m * c + k] -= v[record[jacobian.RATE_BY_STATE] + m * c + k]
        for n in range(record[jacobian.SLOTS_OF]):
            if places[e, 2 * n] >= 0:
                o = record[jacobian.RATE_BY_BODY] + 12 * m * n
                for k in range(12 * m):
                    K[places[e, 2 * n] + k] = -v[o + k]
                o = record[jacobian.FORCE_BY_STATE] + 6 * m * n
                for k in range(6 * m):
                    K[places[e, 2 * n + 1] + 6 * m + k] = -v[o + k]
        for r in range(record[jacobian.ROWS_OF]):
            d, count = nodes[e, JOINT_BLOCK], nodes[e, NODE_ROWS]
            o, at = m * r, m * (nodes[e, ROW_SHIFT] + r)
            for k in range(m):
                if held[nodes[e, FIRST_ROW] + r] != 0:
                    K[d + at + k] = -v[record[jacobian.C_BY_STATE] + o + k]
                K[d + m * count + at + k] = -v[record[jacobian.NU_BY_STATE] + o + k]
