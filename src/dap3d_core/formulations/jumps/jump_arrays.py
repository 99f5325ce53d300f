"""The elements of a model by which velocities jump, or whose states do, as arrays of the law."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.loop_source import JUMP_KINDS, row_count, stride
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix, Scalar, Tensor
from dap3d_core.model import Group

#: Columns of ``rows``: place of the change among the numbers of the loops, of the first entry of
#: the row, and from slot to slot; slots and the first of their bodies; element, and row of it; 1
#: where it pushes; first switch and their number; the switch of the row itself, -1 where it has
#: none.
(
    CHANGE, ENTRY, STEP, SLOTS, BODY, ELEMENT, ROW, PUSHES, SWITCH, SWITCHES, OWN, ROW_WIDTH
) = range(12)  # fmt: skip
#: Columns of ``kicks``, impulses that are given: place, slots, first body, element, switches.
KICK, KICK_SLOTS, KICK_BODY, KICK_ELEMENT, KICK_SWITCH, KICK_SWITCHES, KICK_WIDTH = range(7)
#: Columns of ``resets``: element, switches, first state and their number.
RESET_ELEMENT, RESET_SWITCH, RESET_SWITCHES, RESET_STATE, RESET_STATES, RESET_WIDTH = range(6)
#: Rows of ``switches``: values; side of each, +1, -1 or 0; where one has just come to a side, that.
VALUE, SIDE, CROSSING = range(3)
#: Rows of ``v``, (6 n,): at present, before, the largest magnitude so far, scratch.
NOW, BEFORE, FASTEST, OLD = range(4)


@attrs.define(eq=False, kw_only=True, slots=False)
class JumpArrays(Arrays):
    """Elements that jump, and scratch of the law; m rows at the most, 6 n + 6 velocities."""

    soon = Scalar[float]("real")  # s, what closes within it is closed
    work = Scalar[float]("real")  # of all impulses, J
    exchanged = Scalar[float]("real")  # sum of the magnitudes of its parts, J

    most_rounds = Scalar[int]("integer")
    given_count = Scalar[int]("integer")  # rows of the first round besides those of elements
    follows = Scalar[int]("integer")  # velocities follow the joints with states that have been set
    has_sides = Scalar[int]("integer")  # sides are given
    rounds = Scalar[int]("integer")
    row_count = Scalar[int]("integer")  # of the present round
    missed = Scalar[int]("integer")  # element whose row joints hold; -1: none, -2: a given row

    real: Floats
    integer: Integers
    rows: IntegerMatrix
    kicks: IntegerMatrix
    resets: IntegerMatrix
    bodies: Integers  # of slots
    of_switch: Integers  # switches of elements
    order: Integers  # switch of each number that the loops of impulses read; the same of resets
    reset_order: Integers
    jumps: Integers  # (switches,) 1 where velocities may jump as it changes its sign
    switches: Matrix
    v: Matrix
    given: Matrix  # rows, global axes, and behind each its change
    numbers: Floats  # that the loops write, of impulses or states
    counts: Floats  # scratch of the loops
    of_loop: Floats
    y: Floats  # the state in coordinates of bodies
    which: Integers  # (m,) row of each row of the round: in ``rows``; -1 of one that is given
    pushes: Integers  # (m,)
    acts: Integers
    G: Matrix  # (m, 6 n + 6) rows of the round, global axes; behind each its change
    scaled: Matrix  # (m, 6 n + 6) of unit length in the metric of the masses
    x: Matrix  # (m, 6 n + 6) changes of scaled velocities by unit impulses of them
    held: Matrix  # (m, rows) impulses of the joints then
    A: Matrix
    Lam: Matrix  # (4, m) changes, impulses, scratch
    space: Tensor
    length: Floats
    P: Floats  # (6 n + 6,)
    solution: Floats  # (6 n + 6 + rows,)
    residual: Floats
    nu: Floats
    acting: Integers  # (elements,) 1 where it has acted
    touched: Matrix  # rows that push and have taken part
    is_touched: Integers


class JumpElements:
    """The elements of a model by which velocities jump, or whose states do.

    Attributes:
        names: of each, "force NAME" or "joint NAME".
        is_jump: (switches,) velocities may jump where this switch changes its sign.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model."""
        switches, model = evaluator.switches, evaluator.model
        self.is_jump: Any = np.array([s.jumps for s in switches], dtype=bool)
        self.names: list[str] = []
        self._tables: dict[str, list[Any]] = {
            name: []
            for name in ("rows", "kicks", "resets", "bodies", "of_switch", "order", "reset_order")
        }
        self._numbers = 0
        of_group: dict[int, list[int]] = {}
        for k, switch in enumerate(switches):
            if switch.jumps:
                of_group.setdefault(id(switch.group), []).append(k)
        for q, (kind, group) in enumerate(evaluator.loop_groups):
            if kind not in JUMP_KINDS:
                continue
            own = np.array(of_group[id(group)], dtype=np.int64).reshape(group.count, -1)
            first, type_kind = len(self.names), group.type_info.type.kind
            names = model.joint_names if type_kind == "joint" else model.force_names
            self.names += [f"{type_kind} {names[int(m)]}" for m in group.members]
            if kind == "reset":
                self._add_resets(evaluator, q, first, own)
            else:
                self._add_impulses(group, first, own)

    def _switches(self, own: Integers, order: str) -> tuple[int, int]:
        """First place and number of the switches of an element, which are added."""
        place = len(self._tables["of_switch"])
        self._tables["of_switch"] += own.tolist()
        self._tables[order] += own.tolist()
        return place, len(own)

    def _add_resets(self, evaluator: Evaluator, q: int, first: int, own: Integers) -> None:
        """Add the elements of loop q, whose states are reset."""
        info, system = evaluator.loop_groups[q][1].type_info, evaluator.system
        starts = system.idx[system.groups[q, 0] + info.layout.integers - 1 :: stride(info)]
        count = info.layout.state_width
        for k, switches in enumerate(own):
            start = int(starts[k]) if count else 0
            row = [first + k, *self._switches(switches, "reset_order"), start, count]
            self._tables["resets"].append(row)

    def _add_impulses(self, group: Group, first: int, own: Integers) -> None:
        info, tables = group.type_info, self._tables
        type_: Any = info.type
        slots = len(info.layout.slots)
        rows = row_count(info.outputs, slots) if info.type.kind == "force" else 0
        count = len(info.outputs["impulse"])
        for k in range(group.count):
            switch = self._switches(own[k], "order")
            body, place = len(tables["bodies"]), self._numbers
            tables["bodies"] += group.bodies[k].tolist()
            for r in range(rows):
                pushes = int(r in type_.unilateral)
                one = int(own[k, r]) if own.shape[1] == rows else -1
                tables["rows"].append([place + r, place + count + 6 * r, 6 * rows, slots, body,
                                       first + k, r, pushes, *switch, one])  # fmt: skip
            if not rows:
                tables["kicks"].append([place, slots, body, first + k, *switch])
            self._numbers += count + 6 * slots * rows

    def arrays(self, evaluator: Evaluator, held: Evaluator, given: int, rounds: int) -> JumpArrays:
        """Arrays of the law, for so many rows that are given at the most, and so many rounds."""
        tables = {k: np.array(v, dtype=np.int64) for k, v in self._tables.items()}
        for name, width in (("rows", ROW_WIDTH), ("kicks", KICK_WIDTH), ("resets", RESET_WIDTH)):
            tables[name] = tables[name].reshape(-1, width)
        R, size = len(tables["rows"]), 6 * (evaluator.model.body_count + 1)
        m, states = R + given, len(evaluator.states)
        rows = len(held.system.gamma) if held.model.row_count else 0

        def whole(*shape: int) -> Integers:
            return np.zeros(shape, dtype=np.int64)

        found = JumpArrays(
            real=np.zeros(len(JumpArrays.indices("real"))),
            integer=whole(len(JumpArrays.indices("integer"))),
            **tables,
            jumps=self.is_jump.astype(np.int64),
            switches=np.zeros((3, len(evaluator.switches))),
            v=np.zeros((4, size - 6)),
            given=np.zeros((given, size + 1)),
            numbers=np.zeros(max(self._numbers, states, 1)),
            counts=np.zeros(2),
            of_loop=np.zeros(max(len(tables["order"]), len(tables["reset_order"]), 1)),
            y=np.zeros(13 * evaluator.model.body_count + states + 1),
            which=whole(m), pushes=whole(m), acts=whole(m),
            G=np.zeros((m, size + 1)), scaled=np.zeros((m, size)), x=np.zeros((m, size)),
            held=np.zeros((m, rows)), A=np.zeros((m, m)), Lam=np.zeros((4, m)),
            space=np.zeros((2, m, m)), length=np.zeros(m), P=np.zeros(size),
            solution=np.zeros(size + rows), residual=np.zeros(rows), nu=np.zeros(rows),
            acting=whole(len(self.names)), touched=np.zeros((R, size)), is_touched=whole(R),
        )  # fmt: skip
        found.most_rounds = rounds
        return found
