"""Impulses that the elements of a model ask for at a state, and states that they reset."""

import attrs
import numpy as np

from dap3d_core.assembly.arrays import IMPULSE, KNOT, RESET, SWITCH, Floats, Integers
from dap3d_core.assembly.evaluate import call_kinds
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.interface.codegen.jump_source import JUMP_KINDS, row_count
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.model import Group
from dap3d_core.model.state_layout import velocities_of

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@attrs.frozen(eq=False)
class JumpRows:
    """Rows of elements whose rates J v jump, of m rows in all.

    Attributes:
        G: (m, 6 n + 6) rows, global axes, ground first; change: (m,) the change of G v.
        pushes: (m,) the impulse cannot be negative.
        element, row: (m,) index of the element in ``JumpElements.names``, and of the row in it.
    """

    G: Floats
    change: Floats
    pushes: Mask
    element: Integers
    row: Integers

    def __add__(self, other: "JumpRows") -> "JumpRows":
        columns = zip(*(attrs.astuple(rows, recurse=False) for rows in (self, other)), strict=True)
        return JumpRows(*map(np.concatenate, columns))


def no_rows(size: int) -> JumpRows:
    """No rows, of so many columns."""
    none = np.zeros(0, dtype=np.int64)
    return JumpRows(np.zeros((0, size)), np.zeros(0), none.astype(bool), none, none)


@attrs.frozen(eq=False)
class _JumpGroup:
    """A group of elements with impulses.

    Attributes:
        group: the group.
        first: index of its first element.
        switches: (count, m) index of each switch among those of the model.
        impulse_count: numbers that ``impulse`` returns; rows: of ``J``, 0 without.
        places: (count, m) places of its states among those of the model.
    """

    group: Group
    first: int
    switches: Integers
    impulse_count: int = 0
    rows: int = 0
    places: Integers = attrs.field(factory=lambda: np.zeros((0, 0), dtype=np.int64))

    @property
    def slots(self) -> int:
        return len(self.group.type_info.layout.slots)

    @property
    def width(self) -> int:
        return self.impulse_count + 6 * self.slots * self.rows


class JumpElements:
    """The elements of a model by which velocities jump, or whose states do.

    Attributes:
        names: of each, "force NAME" or "joint NAME".
        is_jump: (switches,) velocities may jump where this switch changes its sign.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        self._evaluator = evaluator
        switches, model = evaluator.switches, evaluator.model
        self.is_jump: Mask = np.array([s.jumps for s in switches], dtype=bool)
        self.names: list[str] = []
        self._groups: list[_JumpGroup] = []
        self._resets: list[_JumpGroup] = []
        of_group: dict[int, list[int]] = {}
        for k, switch in enumerate(switches):
            if switch.jumps:
                of_group.setdefault(id(switch.group), []).append(k)
        for q, (kind, group) in enumerate(evaluator.loop_groups):
            if kind not in JUMP_KINDS:
                continue
            info, type_kind = group.type_info, group.type_info.type.kind
            indices = np.array(of_group[id(group)], dtype=np.int64).reshape(group.count, -1)
            slots, first = len(info.layout.slots), len(self.names)
            names = model.joint_names if type_kind == "joint" else model.force_names
            self.names += [f"{type_kind} {names[int(m)]}" for m in group.members]
            if kind == "reset":
                places = _state_places(evaluator, q, group)
                self._resets.append(_JumpGroup(group, first, indices, places=places))
                continue
            rows = row_count(info.outputs, slots) if type_kind == "force" else 0
            count = len(info.outputs["impulse"])
            self._groups.append(_JumpGroup(group, first, indices, count, rows))
        self._size = sum(g.group.count * g.width for g in self._groups)
        self._order, self._reset_order = (
            np.concatenate([np.zeros(0, np.int64), *(g.switches.ravel() for g in groups)])
            for groups in (self._groups, self._resets)
        )

    @IGNORE_FLOAT_ERRORS
    def switch_values(self, t: float, u: Floats) -> Floats:
        """(switches,) values of all switches of the model at a state u (13 n,)."""
        evaluator = self._evaluator
        values, place = np.zeros(len(evaluator.switches)), np.zeros(2)
        evaluator.place(t, u)
        call_kinds(SWITCH, KNOT, t, evaluator.system, evaluator.loops, values, place, place)
        return values

    @IGNORE_FLOAT_ERRORS
    def impulses(
        self, t: float, u: Floats, values: Floats, crossing: Floats, closed: Mask, soon: float
    ) -> tuple[Floats, Integers, JumpRows]:
        """Impulses on the bodies (6 n + 6,), the elements they are of, and the rows that jump.

        Args:
            t, u: time, and state (13 n,).
            values: (switches,) of the switches.
            crossing: (switches,) +1 or -1 of one that has just changed its sign to that side.
            closed: (switches,) rows take part for them, even where they do not cross.
            soon: s, what closes within it is closed.
        """
        evaluator, out, counts = self._evaluator, np.zeros(self._size), np.zeros(2)
        evaluator.place(t, u)
        of_elements = crossing[self._order]
        call_kinds(IMPULSE, IMPULSE, t, evaluator.system, evaluator.loops, out, counts, of_elements)
        body_size = 6 * (evaluator.model.body_count + 1)
        P, acting, rows, first = np.zeros(body_size), [], no_rows(body_size), 0
        v = np.concatenate([np.zeros(6), velocities_of(u)]).reshape(-1, 6)
        takes_part = (crossing != 0.0) | closed
        for g in self._groups:
            numbers = out[first : first + g.group.count * g.width].reshape(g.group.count, -1)
            first += numbers.size
            if g.rows:
                near = takes_part[g.switches], values[g.switches]
                rows += _rows_of(g, numbers, *near, v, soon)
                continue
            acts = (crossing[g.switches] != 0.0).any(axis=1) & numbers.any(axis=1)
            pairs = numbers[acts].reshape(-1, g.slots, 6)
            np.add.at(P.reshape(-1, 6), g.group.bodies[acts], pairs)
            acting.append(g.first + np.flatnonzero(acts))
        P[:6] = 0.0
        return P, np.concatenate([np.zeros(0, np.int64), *acting]), rows

    @IGNORE_FLOAT_ERRORS
    def resets(self, t: float, u: Floats, crossing: Floats) -> tuple[Floats, Integers]:
        """(states,) states of elements with those of elements that cross as they reset them.

        And these elements. Arguments as of ``impulses``.
        """
        evaluator, states = self._evaluator, self._evaluator.states
        crosses = [(crossing[g.switches] != 0.0).any(axis=1) for g in self._resets]
        if not any(c.any() for c in crosses):
            return states, np.zeros(0, dtype=np.int64)
        out, counts, of_elements = states.copy(), np.zeros(2), crossing[self._reset_order]
        evaluator.place(t, u)
        call_kinds(RESET, RESET, t, evaluator.system, evaluator.loops, out, counts, of_elements)
        new = states.copy()
        for g, which in zip(self._resets, crosses, strict=True):
            places = g.places[which].ravel()
            new[places] = out[places]
        elements = [g.first + np.flatnonzero(c) for g, c in zip(self._resets, crosses, strict=True)]
        return new, np.concatenate(elements)


def _state_places(evaluator: Evaluator, q: int, group: Group) -> Integers:
    """(count, m) places of the states of the elements of loop q."""
    layout, system = group.type_info.layout, evaluator.system
    width = stride(group.type_info)
    first = system.idx[system.groups[q, 0] + layout.integers - 1 :: width][: group.count]
    places: Integers = first[:, None] + np.arange(layout.state_width)
    return places


def _rows_of(
    g: _JumpGroup, numbers: Floats, takes_part: Mask, values: Floats, v: Floats, soon: float
) -> JumpRows:
    """Rows of a group that take part, and are asked to change."""
    count, rows = g.group.count, g.rows
    change = numbers[:, :rows]
    blocks = numbers[:, rows:].reshape(count, g.slots, rows, 6)
    if takes_part.shape[1] == rows:  # row k is that of switch k
        takes_part = takes_part | (
            values <= -soon * np.einsum("qsrc,qsc->qr", blocks, v[g.group.bodies])
        )
    else:
        takes_part = np.broadcast_to(takes_part.any(axis=1, keepdims=True), change.shape)
    which, row = np.nonzero(takes_part & (change != 0.0))
    G = np.zeros((len(which), *v.shape))
    for slot in range(g.slots):
        bodies = g.group.bodies[which, slot]
        np.add.at(G, (np.arange(len(which)), bodies), blocks[which, slot, row])
    G[:, 0] = 0.0
    pushes = np.isin(row, g.group.type_info.type.unilateral)  # type: ignore[attr-defined]
    G = G.reshape(len(which), v.size)
    return JumpRows(G, change[which, row], pushes, g.first + which, row)
