"""Joints and forces of an exported model: loops that its outputs call, and what these find.

As result/post/force_output.py, by the loops that these call.
"""

from functools import cache
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.codegen.compile_loops import compiled_loop
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.function_lists import LoopArrays, loop_list
from dap3d_core.model.groups import Group
from dap3d_core.native.run.prepared import PreparedRun
from dap3d_core.result.post.force_output import group_of


@attrs.define(eq=False, kw_only=True, slots=False)
class ElementArrays(Arrays):
    """What loops of elements write."""

    values: Floats  # -lambda in the order of the solver, scratch; then of all calls


@attrs.frozen(eq=False)
class Call:
    """A call of a loop for one element.

    Attributes:
        table, q: the table of the loop, and its place there.
        arrays: that it reads.
        group: first integer, first number.
        first, size: what it writes of the values.
        more: the other two outputs, as offsets in the values.
    """

    table: Any
    q: int
    arrays: Any
    group: tuple[int, int]
    first: int
    size: int
    more: tuple[int, int]


@attrs.frozen(eq=False)
class Element:
    """A joint or a force, and its numbers among the values: -1 where it has none.

    Attributes:
        group, index: the element.
        first: of the blocks of a joint, of the forces on all bodies, or of what a contact says.
        energy, tension: of a force.
        reads_loads: it is a force that reads multipliers.
    """

    group: Group
    index: int
    first: int
    energy: int = -1
    tension: int = -1
    reads_loads: bool = False

    def place(self, slot: str) -> int:
        """The index of a slot, "" for the first; ValueError for one that it has not."""
        return self.group.type_info.layout.slots.index(slot) if slot else 0

    def local(self, place: int) -> tuple[float, ...] | None:
        """The point of the element on the body of a slot, body axes; None where it has none."""
        layout = self.group.type_info.layout
        at, shape = layout.numbers.get(f"P_{layout.slots[place]}", (0, ()))
        return tuple(self.group.numbers[self.index, at : at + 3].tolist()) if shape else None


class Elements:
    """The elements that outputs of a model are of."""

    def __init__(self, prepared: PreparedRun) -> None:
        """Args: the run."""
        self._evaluator = prepared.evaluator
        self.calls: list[Call] = []
        #: A joint, None where the formulation has no loop of its rows; a force element; a point of
        #: a contact. Each is found once.
        self.joint, self.force = cache(self._joint), cache(self._force)
        self.contact = cache(self._contact)
        #: Offsets of -lambda, and of scratch.
        self.minus, self.counter = 0, prepared.evaluator.system.multipliers.size
        self._size = self.counter + 1
        #: Made by ``finish``.
        self.arrays = ElementArrays(values=np.zeros(1))

    def finish(self) -> list[Any]:
        """Arrays and tables that the calls need."""
        self.arrays = ElementArrays(values=np.zeros(self._size))
        parts = [part for call in self.calls for part in (call.table, call.arrays)]
        return [self.arrays, *parts] if self.calls else []

    def _take(self, size: int) -> int:
        self._size += size
        return self._size - size

    def _place(self, q: int, group: Group, index: int) -> tuple[int, int]:
        """First integer and number of an element of a loop."""
        i0, p0 = self._evaluator.system.groups[q, :2].tolist()
        info = group.type_info
        return i0 + index * stride(info), p0 + index * info.layout.par_width

    def _joint(self, name: str) -> Element | None:
        evaluator, s = self._evaluator, self._evaluator.system
        joint = evaluator.model.joint_names.index(name)
        for q, (kind, group) in enumerate(evaluator.loop_groups):
            places = np.flatnonzero(group.members == joint)
            if kind != "acceleration" or not places.size:
                continue
            index, rows = int(places[0]), int(evaluator.model.joint_rows[joint])
            slots, width = len(group.type_info.layout.slots), stride(group.type_info)
            i0, p0 = self._place(q, group, index)
            idx = s.idx[i0 : i0 + width].copy()  # row and blocks are its last integers
            idx[-slots - 1] = 0
            idx[-slots:] = 6 * rows * np.arange(slots)
            arrays = LoopArrays(body=s.body, F=s.F, idx=idx, par=s.par, states=s.states)
            size = 6 * slots * rows
            first = self._take(size + 2 * rows)
            more = first + size, first + size + rows
            call = Call(evaluator.loops, q, arrays, (0, p0), first, size + 2 * rows, more)
            self.calls.append(call)
            return Element(group, index, first)
        return None

    def _contact(self, name: str) -> Element:
        evaluator, s = self._evaluator, self._evaluator.system
        contact = evaluator.model.joint_names.index(name)
        q, group = next(
            (q, group) for q, (kind, group) in enumerate(evaluator.loop_groups)
            if kind == "switch" and group in evaluator.model.contacts and contact in group.members
        )  # fmt: skip
        index = int(np.flatnonzero(group.members == contact)[0])
        size = len(group.type_info.outputs["tension"])
        first, place = self._take(size), self._place(q, group, index)
        table = loop_list([compiled_loop(group.type_info, "tension")])
        self.calls.append(Call(table, 0, s, place, first, size, (self.counter, self.minus)))
        return Element(group, index, first)

    def _force(self, name: str) -> Element:
        evaluator, s = self._evaluator, self._evaluator.system
        element = evaluator.model.force_names.index(name)
        group, index = group_of(evaluator, name, element)
        loops = {kind: q for q, (kind, g) in enumerate(evaluator.loop_groups) if g is group}
        law = "wrench" if "wrench" in loops else "friction"
        first = self._take(s.force.size)
        place = self._place(loops[law], group, index)
        reads_loads = bool(group.read) or law == "friction"
        given = (self.minus if reads_loads else first,) * 2
        self.calls.append(Call(evaluator.loops, loops[law], s, place, first, s.force.size, given))
        energy = tension = -1
        if "energy" in loops:
            q, energy = loops["energy"], self._take(1)
            place = self._place(q, group, index)
            self.calls.append(Call(evaluator.loops, q, s, place, energy, 1, (energy, energy)))
        if paths := group.type_info.outputs.get("tension", ()):
            tension = self._take(len(paths))
            table = loop_list([compiled_loop(group.type_info, "tension")])
            self.calls.append(Call(table, 0, s, place, tension, len(paths), (self.counter,) * 2))
        return Element(group, index, first, energy, tension, reads_loads)
