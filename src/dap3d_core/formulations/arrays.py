"""From a model and its elimination plan to the driver's arrays and group loops."""

from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import EVEN, KINDS, LENGTH, WEAK, Floats, Integers, System
from dap3d_core.assembly.metric import METRIC_WIDTH
from dap3d_core.assembly.turns import (
    BODY_I,
    BODY_J,
    COLUMNS,
    CONSTANT_WIDTH,
    CONSTANTS,
    ROTATION,
    STATE,
    STATE_WIDTH,
)
from dap3d_core.formulations.common.friction import memory_size
from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.interface.codegen.loop_source import computes_rate, stride
from dap3d_core.kernels.runtime.function_lists import loop_list
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, P
from dap3d_core.linear.ldlt.plan import Plan
from dap3d_core.model import Group, Model
from dap3d_core.model.scales import moments_of

#: Usual alpha, Omega (1/s), mu of the penalty formulation.
PENALTY = (1e7, 10.0, 1.0)


#: Members of ``System`` that begin as zeros: six numbers of each body; one of each row.
BODY_VECTORS = ("force", "acceleration", "velocity", "change")
ROW_VECTORS = ("gamma", "nu", "residual", "multipliers", "right_side", "total", "compliance",
               "smallest")  # fmt: skip

#: Ratio of masses from which on a pivot falls by as much when a light body turns round a heavy one
#: as it does near a singular pose.
UNEVEN = 1e3
#: Ratio of masses, and of moments of inertia by the size of the parts, from which on passes of
#: regularised rows may leave some of them (formulations/regularised.py).
VERY_UNEVEN = 1e5


def build_loops(
    model: Model, kinds: tuple[str, ...], announce: Callable[[str], None] | None = None
) -> Any:
    """The compiled group loops of a model, only of the requested kinds, and their groups.

    Returns:
        (table of loops, [(kind, group)] in the order of the list).

    Raises:
        PluginError: the kernels of a type cannot be compiled.
    """
    loops, what = [], []
    for kind in KINDS:
        if kind not in kinds:
            continue
        groups = (*model.functions, *model.forces, *model.joints)
        if kind == "friction":
            groups = (*model.friction, *model.forces, *model.contacts)
        for group in groups:
            if kind == "rate" and computes_rate(group.type_info):
                continue
            loop = compiled_loop(group.type_info, kind, announce)
            if loop is not None:
                loops.append(loop)
                what.append((kind, group))
    return loop_list(loops), what


def build_system(model: Model, plan: Plan, what: list[tuple[str, Group]]) -> System:
    """Allocate and fill the driver's arrays.

    Args:
        model: the model.
        plan: its elimination program.
        what: the loops as ``build_loops`` returns them.
    """
    n = model.body_count
    body = np.zeros((n + 1, BODY_WIDTH))
    body[0, A : A + 9 : 4] = body[0, P] = 1.0
    metric = np.zeros((n + 1, METRIC_WIDTH))
    _set_masses(body, metric, model)
    idx, par, groups, starts = _tables(model, plan, what)
    turns, counted = turn_tables(model, len(par))
    even, weak = mass_flags(model.mass, moments_of(model.Jp), model.part_size)
    return System(
        body=body,
        metric=metric,
        F=np.zeros((model.function_count + 1, 5)),
        par=np.concatenate([par, counted]),
        states=model.initial_states.copy(),
        **{name: np.zeros(6 * (n + 1)) for name in BODY_VECTORS},
        **{name: np.zeros(plan.row_size) for name in ROW_VECTORS},
        D=np.zeros(plan.block_size),
        K=np.zeros(plan.matrix_size),
        weight=np.ones(plan.row_size),
        settings=np.array(
            [
                *(1e-15, 1e-15, 0.0, 0.0, *PENALTY, 0.0, model.length, even, 0.0),
                *(float(any(group.read for group in model.forces)), weak),
            ]
        ),
        friction=np.zeros(_friction_size(model, plan)),
        contacts=_contacts_of(model, plan, what, groups),
        watched=np.full(
            (1 + 2 * model.integrated_layout["work"].stop) * bool(model.contacts), np.nan
        ),
        idx=idx,
        groups=groups,
        kinds=starts,
        row=rows_of(model, plan),
        blocks=plan.blocks,
        targets=plan.targets,
        contributions=plan.contributions,
        nodes=plan.nodes,
        columns=plan.columns,
        updates=plan.updates,
        hubs=plan.hubs,
        turns=turns,
    )


def _friction_size(model: Model, plan: Plan) -> int:
    """Size of ``System.friction``."""
    if not model.iterated_forces:
        return 0
    size = memory_size(model.body_count + 1, plan.row_size, plan.matrix_size)
    if model.contacts:
        from dap3d_core.formulations.contacts import equations

        size += equations.memory_size(model.body_count + 1, plan.row_size, model.contact_count)
    return size


def _contacts_of(
    model: Model, plan: Plan, what: list[tuple[str, Group]], groups: Integers
) -> Integers:
    """``System.contacts``."""
    if not model.contacts:
        return np.zeros((0, 0), dtype=np.int64)
    from dap3d_core.formulations.contacts import equations

    first = len(model.joint_names) - model.contact_count
    table = np.zeros((model.contact_count, equations.COLUMNS), dtype=np.int64)
    for q, (kind, group) in enumerate(what):
        if kind != "friction" or not group.type_info.type.is_contact:
            continue
        integers, k = _integers_of(group, plan, model), np.arange(group.count)
        slots, layout = len(group.type_info.layout.slots), group.type_info.layout
        rows = table[group.members - first]
        rows[:, equations.LOOP] = q
        rows[:, equations.INTEGERS] = groups[q, 0] + k * integers.shape[1]
        rows[:, equations.NUMBERS] = groups[q, 1] + k * layout.par_width
        rows[:, equations.ROW] = integers[:, layout.integers]
        rows[:, equations.BODY_I : equations.BODY_I + slots] = integers[:, :slots]
        rows[:, equations.STATE] = integers[:, layout.integers - 1]
        type_: Any = group.type_info.type
        rows[:, equations.LOADED] = type_.along is not None and not type_.load
        rows[:, equations.UNDER] = group.members - first
        if group.loaded is not None and type_.resists:
            rows[:, equations.UNDER] = group.loaded - first
        elif group.loaded is not None:
            rows[:, equations.LOAD] = plan.joint_row[group.loaded] + type_.load[0]
            rows[:, equations.LOADS] = len(type_.load)
            rows[:, equations.PUSHES] = type_.pushes
        table[group.members - first] = rows
    return table


def turn_tables(model: Model, first: int) -> tuple[Integers, Floats]:
    """``System.turns``, and the numbers of angles of joints that are behind others in ``par``.

    first: index of the first of these numbers: their states, then their constants.
    """
    angles = model.joint_angles
    count = model.joint_angle_count
    table = np.full((count, COLUMNS), -1, dtype=np.int64)
    states = STATE_WIDTH * count
    if not angles:
        return table, np.zeros(0)
    table[:, BODY_I : BODY_J + 1], table[:, ROTATION] = angles.bodies, angles.rotations
    table[:, STATE] = first + STATE_WIDTH * np.arange(count)
    table[:, CONSTANTS] = first + states + CONSTANT_WIDTH * np.arange(count)
    return table, np.concatenate([np.zeros(states), angles.constants.ravel()])


def load_numbers(
    system: System, model: Model, other: Model, what: list[tuple[str, Group]]
) -> list[tuple[str, Group]]:
    """Put the numbers of another model of the same structure into a model's arrays.

    Args:
        system: made from ``model`` by ``build_system``.
        model, other: the model that the loops were made for; the one whose numbers are wanted.
        what: the loops as ``build_loops`` returned them.

    Returns:
        the same as ``what`` for the other model.

    Raises:
        ValueError: the structure is another: elements, bodies, functions or sizes of tables.
    """
    groups = regrouped(model, other, what)
    parts: dict[int, Floats] = {}
    p0 = 0
    for _, group in groups:
        if id(group) not in parts:
            parts[id(group)] = group.packed_numbers(p0)
            p0 += parts[id(group)].size
    turns, counted = turn_tables(other, p0)
    sizes = p0 + counted.size, len(other.mass)
    has_same_turns = np.array_equal(turns[:, BODY_I:], system.turns[:, BODY_I:])
    if sizes != (system.par.size, len(model.mass)) or not has_same_turns:
        raise ValueError("models of different structure")
    system.par[:] = np.concatenate([np.zeros(0), *parts.values(), counted])
    _set_masses(system.body, system.metric, other)
    system.settings[LENGTH] = other.length
    flags = mass_flags(other.mass, moments_of(other.Jp), other.part_size)
    system.settings[[EVEN, WEAK]] = flags
    return groups


def _set_masses(body: Floats, metric: Floats, model: Model) -> None:
    """Put the masses and inertias of a model into its bodies, and what follows from them."""
    body[1:, MASS] = model.mass
    body[1:, JP : JP + 9] = model.Jp.reshape(-1, 9)
    set_metric(metric, model.mass, model.Jp)


def regrouped(model: Model, other: Model, what: list[tuple[str, Group]]) -> list[tuple[str, Group]]:
    """The groups of another model that loops made for a model serve; arguments, errors as above."""
    twins = {}
    for mine, theirs in zip(_all_groups(model), _all_groups(other), strict=True):
        same = (
            mine.type_info.type is theirs.type_info.type
            and mine.numbers.shape == theirs.numbers.shape
            and all(
                np.array_equal(getattr(mine, name), getattr(theirs, name))
                for name in ("members", "bodies", "functions")
            )
        )
        if not same:
            raise ValueError("models of different structure")
        twins[id(mine)] = theirs
    return [(kind, twins[id(group)]) for kind, group in what]


def _all_groups(model: Model) -> tuple[Group, ...]:
    return (*model.functions, *model.forces, *model.joints, *model.friction)


def mass_flags(mass: Floats, moments: Floats, size: Floats | float) -> Floats:
    """(..., 2) EVEN and WEAK of masses (..., n) and moments of inertia (..., n, 3), 1.0 or 0.0.

    EVEN: a pivot would tell of the masses and not of the pose (UNEVEN); WEAK: masses and moments of
    inertia, over the square of ``size`` (...) of the largest part, m, may make rows weak
    (VERY_UNEVEN).
    """
    moments = moments / np.square(size)[..., None, None]
    mass = np.broadcast_to(mass, moments.shape[:-1])
    every = np.concatenate([mass[..., None], moments], axis=-1)
    every = every.reshape(*every.shape[:-2], every.shape[-2] * every.shape[-1])
    of_masses, of_all = (
        np.max(of, axis=-1, initial=0.0) > limit * np.min(of, axis=-1, initial=np.inf)
        for of, limit in ((mass, UNEVEN), (every, VERY_UNEVEN))
    )
    return np.stack([of_masses, of_all], axis=-1).astype(np.float64)


def set_metric(metric: Floats, mass: Floats, Jp: Floats) -> None:
    """Fill the metric's constants: 1/sqrt(m), and U = L^-T with J' = L L^T (ground: zero)."""
    if not len(mass):
        return
    metric[1:, 0] = 1.0 / np.sqrt(mass)
    U = np.linalg.inv(np.linalg.cholesky(Jp)).transpose(0, 2, 1)
    metric[1:, 1:7] = U[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def rows_of(model: Model, plan: Plan) -> Integers:
    """(rows,) place of each constraint row of the model in the row vectors."""
    first = np.repeat(plan.joint_row, model.joint_rows)
    return first + np.arange(model.row_count) - np.repeat(model.joint_start[:-1], model.joint_rows)


def rows_read(model: Model, what: list[tuple[str, Group]]) -> Floats:
    """(rows,) 1.0 for each constraint row of the model that forces read, 0.0 for others."""
    read = np.zeros(len(model.joint_names))
    for kind, group in what:
        if kind == "friction":
            joints = [of_force.members for of_force in group.read]
            own = group.members if group.joints is None else group.joints
            for places in joints or [own]:
                read[places] = 1.0
    return np.repeat(read, model.joint_rows)


def _tables(model: Model, plan: Plan, what: list[tuple[str, Group]]) -> tuple[Any, Any, Any, Any]:
    """Integers and numbers of all instances; a group that serves two loops is stored once."""
    idx: list[Integers] = []
    par: list[Floats] = []
    at: dict[int, tuple[int, int]] = {}
    i0 = p0 = 0
    rows = []
    for _, group in what:
        if id(group) not in at:
            table = _integers_of(group, plan, model)
            at[id(group)] = (i0, p0)
            numbers = group.packed_numbers(p0)
            idx.append(table.ravel())
            par.append(numbers)
            i0, p0 = i0 + table.size, p0 + numbers.size
        rows.append((*at[id(group)], group.count))
    kinds = [kind for kind, _ in what]
    starts = [sum(KINDS.index(k) < n for k in kinds) for n in range(len(KINDS) + 1)]
    return (
        np.concatenate([np.zeros(0, dtype=np.int64), *idx]),
        np.concatenate([np.zeros(0), *par]),
        np.array(rows, dtype=np.int64).reshape(-1, 3),
        np.array(starts, dtype=np.int64),
    )


def _shares_of(model: Model, contacts: Integers) -> Integers:
    """(m,) index of the first state of the share of each contact."""
    first = {s.element: s.first for s in model.element_states
             if s.kind == "joint" and s.name == "near"}  # fmt: skip
    return np.array([first[model.joint_names[k]] for k in contacts.tolist()], dtype=np.int64)


def _integers_of(group: Group, plan: Plan, model: Model) -> Integers:
    """The rows of ``idx`` of a group, as interface/codegen/loop_source.py lays them out."""
    kind = group.type_info.type.kind
    parts = [group.bodies, group.functions]
    if group.type_info.layout.states:
        from dap3d_core.model.element_states import first_states

        parts.append(first_states(model.acting, group)[:, None])
    if kind == "joint":
        joints = group.members if group.joints is None else group.joints
        parts.append(plan.joint_row[joints][:, None])
        parts.append(np.array([plan.joint_block[m] for m in joints], dtype=np.int64))
        if group.loaded is not None:
            parts.append(plan.joint_row[group.loaded][:, None])
            if group.type_info.type.resists:  # type: ignore[attr-defined]
                parts.append(_shares_of(model, group.loaded)[:, None])
    elif kind == "function":
        parts.append(1 + group.members[:, None])
    for read in group.read:
        unused = np.zeros((read.count, int(bool(read.type_info.layout.states))), dtype=np.int64)
        parts += [read.bodies, read.functions, unused, plan.joint_row[read.members][:, None]]
    table = np.ascontiguousarray(np.hstack(parts), dtype=np.int64)
    assert table.shape[1] == stride(group.type_info)
    return table
