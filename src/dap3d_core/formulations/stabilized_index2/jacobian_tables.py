"""Tables of the bodies that each element couples, and of the places of its derivatives."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Integers
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.stabilized_index2.jacobian import (
    ELEMENT_WIDTH,
    FRICTION_ELEMENT,
    JOINT_ELEMENT,
    POSITION_ELEMENT,
    RATE_ELEMENT,
    WIDTH,
    WRENCH_ELEMENT,
    StateTangent,
    Tangent,
)
from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.interface.codegen.kernel_arguments import in_order, parameters
from dap3d_core.interface.codegen.loop_source import computes_rate, stride
from dap3d_core.kernels.runtime.function_lists import LoopArrays, loop_list
from dap3d_core.kernels.runtime.loop_modules import build_differentiated
from dap3d_core.model import Group, Model

_KINDS = {"wrench": WRENCH_ELEMENT, "acceleration": JOINT_ELEMENT, "friction": FRICTION_ELEMENT}
#: The same of types with states of their own, as their derivatives by states need them.
_WITH_STATES = {"rate": RATE_ELEMENT, "position": POSITION_ELEMENT}
#: Members of ``Tangent`` that differentiated loops write, and what is made of it.
OF_LOOPS = ("D", "gamma", "nu", "minus_lambda", "force", "out", "kept", "ahead")
#: Numbers of a block of ``coupling``.
_BLOCK = 72


def make_tangent(evaluator: Evaluator) -> tuple[Tangent, Any]:
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
            codes.append(RATE_ELEMENT)
        slots = len(group.type_info.layout.slots)
        rows = group.type_info.row_count
        read = _joints_read(group) if kind == "friction" else []
        elements += [(loop, len(loops), code, stride(group.type_info), layout.par_width, slots,
                      layout.integers, rows, count, int(_sees_velocity(kind, group)),
                      len(readings), len(read)) for code in codes]  # fmt: skip
        if source := write(group.type_info, kind):
            loops.append(build_differentiated(source, WIDTH))
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
    tangent = Tangent(
        elements=np.array(elements, dtype=np.int64).reshape(-1, ELEMENT_WIDTH),
        pairs=np.concatenate([np.zeros(0, dtype=np.int64), *pairs]),
        blocks=np.array(blocks, dtype=np.int64).reshape(-1, 3),
        coupling=np.zeros(_BLOCK * len(place)),
        turning=np.zeros(plan.block_size),
        readings=np.array(readings, dtype=np.int64).reshape(-1, 4),
        force_by_lambda=np.zeros(size),
        bends=np.zeros(1),
        states=_state_tangent(evaluator.model, at),
        wide=_wide(system),
        **{name: np.zeros(WIDTH * numbers) for name, numbers in zip(OF_LOOPS, sizes, strict=True)},
    )
    return tangent, loop_list(loops)


def _wide(system: Any) -> LoopArrays:
    """Arrays of differentiated loops: ``WIDTH`` numbers for each of a system's."""
    arrays = {name: getattr(system, name) for name in ("body", "F", "par", "states")}
    wide = {name: np.zeros((*x.shape[:-1], WIDTH * x.shape[-1])) for name, x in arrays.items()}
    return LoopArrays(idx=system.idx, **wide)


def _state_tangent(model: Model, at: Sequence[int]) -> StateTangent:
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
    return StateTangent(
        at=np.array(at, dtype=np.int64),
        records=np.array(records, dtype=np.int64).reshape(-1, 8),
        record=record,
        values=np.zeros(size),
    )


def coupled_bodies(tangent: Tangent) -> list[tuple[int, int]]:
    """Pairs of different bodies that an element couples."""
    return [(int(a), int(b)) for _, a, b in tangent.blocks if a != b]


def _joints_read(group: Group) -> list[Integers]:
    """The joints whose multipliers the instances of a group read, (m,) each."""
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
