"""Derivatives of what a group loop computes, by the bodies of each instance.

The compiled loop of a type runs in its differentiated form (kernels/compiler/derivatives), on
arrays in which each instance has bodies, functions, states and rows of its own. So any type has
derivatives, a third party's too, exact to rounding. Twelve directions for each body an instance
reads: its displacement, its rotation vector (global axes), its velocity, its angular velocity
(global axes).
"""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.codegen.compile_loops import differentiated_loop
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.interface.codegen.reactions import body_columns, rows_read
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.function_lists import LoopArrays
from dap3d_core.kernels.runtime.lanes import DifferentiatedArrays
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A, P, R, V, W

#: Directions of a body: r, rotation vector, r_dot, omega.
DIRECTIONS = 12
#: Directions of one call of a loop.
AT_ONCE = 7


@attrs.frozen(eq=False)
class LoopDerivatives:
    """What the loop of a type computes for its m instances, and its derivatives.

    Attributes:
        bodies: (m, places) bodies that an instance reads; the first ones are its slots.
        outputs: kernel -> its values (m, ...) and derivatives (m, ..., d), with
            d = 12 places, then one for each multiplier that the loop reads, then one for each
            number, each function and each state.
    """

    bodies: Integers
    outputs: dict[str, tuple[Floats, Floats]]


#: Array, places in it (flat), slopes there.
_Seed = tuple[str, Integers, Floats]


def _by_motion(rows: Floats) -> Floats:
    """(12, m, width) derivatives of body rows (m, width) by the motion of the body."""
    slopes = np.zeros((DIRECTIONS, len(rows), BODY_WIDTH))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        turned = slopes[3 + k]
        slopes[k, :, R + k] = slopes[6 + k, :, V + k] = slopes[9 + k, :, W + k] = 1.0
        for c in range(A, A + 3):  # e x a, with a a column of A
            turned[:, c + 3 * i], turned[:, c + 3 * j] = -rows[:, c + 3 * j], rows[:, c + 3 * i]
        turned[:, P] = -0.5 * rows[:, P + 1 + k]  # half (0, e) times p
        turned[:, P + 1 + k] = 0.5 * rows[:, P]
        turned[:, P + 1 + i] = -0.5 * rows[:, P + 1 + j]
        turned[:, P + 1 + j] = 0.5 * rows[:, P + 1 + i]
    return slopes


class _Instances:
    """Arrays of a loop in which each instance has numbers of its own.

    Attributes:
        idx: (m, stride) the integers of the instances.
        at: array and column of ``idx`` -> (m, k) places of the instances' own numbers, flat.
        seeds: one for each direction.
    """

    def __init__(self, arrays: Any, idx: Integers, multipliers: Floats | None) -> None:
        self.idx, self._places = idx.copy(), 0
        self.at: dict[tuple[str, int], Integers] = {}
        self.seeds: list[_Seed] = []
        names = ("body", "F", "par", "states")
        self._arrays: dict[str, Any] = {name: getattr(arrays, name) for name in names}
        self._arrays["multipliers"] = np.zeros(0) if multipliers is None else multipliers

    def part(self, name: str, column: int, length: int = 1) -> None:
        """Give each instance a copy of what a column of its integers names in an array."""
        array, begin = self._arrays[name], self.idx[:, column]
        copied = array[begin[:, None] + np.arange(length)]  # (m, length, ...)
        self.idx[:, column] = len(array) + length * np.arange(len(begin))
        self._arrays[name] = np.concatenate([array, copied.reshape(-1, *array.shape[1:])])
        places = array.size + np.arange(copied.size)
        self.at[name, column] = places.reshape(len(begin), -1)

    def seed(self, name: str, at: Integers) -> None:
        """Differentiate by numbers at some places of an array."""
        sign = -1.0 if name == "multipliers" else 1.0  # -lambda is read
        self.seeds.append((name, at, np.full(at.shape, sign)))

    def seed_reading(self, bodies: Sequence[int], rows: dict[int, int]) -> None:
        """Differentiate by the motion of bodies, and by the multipliers of rows, behind columns."""
        body = self._arrays["body"]
        for column in bodies:
            slopes = _by_motion(body[self.idx[:, column]])
            self.part("body", column)
            self.seeds += [("body", self.at["body", column], slope) for slope in slopes]
        for column, count in rows.items():
            self.part("multipliers", column, count)
            for k in range(count):
                self.seed("multipliers", self.at["multipliers", column][:, k])

    def outputs(self, column: int, length: int, shift: int = 0, of: int = 1) -> Integers:
        """(m, length) places behind an index, from here on the instance's own."""
        self.idx[:, column] = length * (of * np.arange(len(self.idx)) + shift)
        self._places = max(self._places, length * of * len(self.idx))
        return self.idx[:, column, None] + np.arange(length)

    def run(self, entry: Entry, t: float, p0: int) -> list[Floats]:
        """(size, 1 + d) values and slopes: of the three outputs of a loop, and rates of states."""
        multipliers = self._arrays.pop("multipliers")
        arrays = LoopArrays(idx=self.idx.ravel(), **self._arrays)
        size = max(self._places, arrays.body.shape[0] * 6, len(multipliers))
        parts = []
        for first in range(0, max(len(self.seeds), 1), AT_ONCE):
            wide = DifferentiatedArrays(arrays, 1 + AT_ONCE)
            outs = np.zeros((3, size, 1 + AT_ONCE))
            outs[1:, : len(multipliers), 0] = multipliers  # contacts read them behind outputs
            for lane, (name, at, slopes) in enumerate(self.seeds[first : first + AT_ONCE], 1):
                if name == "multipliers":
                    outs[1:, at, lane] = slopes
                else:
                    wide.matrix(self._arrays[name])[at, lane] = slopes
            entry(t, wide, 0, p0, len(self.idx), *outs)
            parts.append([*outs, wide.matrix(arrays.rates)])
        return [
            np.hstack([part[k] if part is parts[0] else part[k][:, 1:] for part in parts])[
                :, : 1 + len(self.seeds)
            ]
            for k in range(4)
        ]


def differentiate_loop(
    type_info: TypeInfo,
    what: str,
    t: float,
    arrays: Any,
    group: tuple[int, int, int],
    multipliers: Floats | None = None,
    numbers: Sequence[int] = (),
    functions: Sequence[tuple[int, int]] = (),
    states: bool = False,
) -> LoopDerivatives:
    """Values and derivatives of what a group loop computes.

    Args:
        type_info: the type.
        what: "wrench", "friction", "acceleration" (J, gamma, nu), "position" (C) or "rate".
        t: time, s.
        arrays: with ``body``, ``F``, ``idx`` and ``par``, as the compiled loops read them.
        group: first integer in ``idx``, first number in ``par``, number of instances.
        multipliers: (row_size,) -lambda, for friction.
        numbers: indices of an instance's own numbers by which to differentiate, too.
        functions: by which functions of time as well: index among the type's fields, and 0 for the
            value, 1 and 2 for its rates.
        states: True to differentiate by an instance's own states as well.

    Returns:
        by kernel: "wrench" or "friction" (m, slots, 6), force and moment about the mass centre;
        "J" (m, slots, rows, 6); "gamma", "nu", "C" (m, rows); "rate" (m, states).
    """
    layout, (i0, p0, count), width = type_info.layout, group, stride(type_info)
    idx = arrays.idx[i0 : i0 + count * width].reshape(count, width)
    slots, state = len(layout.slots), layout.integers - 1
    first = slots + len(layout.functions)
    read = rows_read(type_info) if what == "friction" else {}
    places = [*range(slots), *range(first, first + len(layout.others))]
    places += body_columns(type_info) if read else []
    own = _Instances(arrays, idx, multipliers)
    own.seed_reading(places, read)
    for k in numbers:
        own.seed("par", p0 + layout.par_width * np.arange(count) + k)
    for column in dict.fromkeys(slots + field for field, _ in functions):
        own.part("F", column)
    for field, order in functions:
        own.seed("F", own.at["F", slots + field][:, order])
    if layout.states:
        own.part("states", state, layout.state_width)
    for k in range(layout.state_width if states else 0):
        own.seed("states", own.at["states", state][:, k])
    where = _places(type_info, what, own)
    found = own.run(differentiated_loop(type_info, what, 1 + AT_ONCE), t, p0)
    outputs = {name: found[k][at] for name, (k, at) in where.items()}
    bodies = np.ascontiguousarray(idx[:, places])
    return LoopDerivatives(bodies, {name: (x[..., 0], x[..., 1:]) for name, x in outputs.items()})


def _places(type_info: TypeInfo, what: str, own: _Instances) -> dict[str, tuple[int, Integers]]:
    """Kernel -> the output it writes, and the places of its numbers there."""
    layout, rows = type_info.layout, type_info.row_count
    slots, row = len(layout.slots), layout.integers  # the column of the first row's index
    if what == "acceleration":
        blocks = [own.outputs(row + 1 + n, 6 * rows, n, slots) for n in range(slots)]
        of_rows = own.outputs(row, rows)
        J = np.stack(blocks, axis=1).reshape(-1, slots, rows, 6)
        return {"J": (0, J), "gamma": (1, of_rows), "nu": (2, of_rows)}
    if what == "position":
        return {"C": (0, own.outputs(row, rows))}
    if what == "rate":
        return {what: (3, own.at["states", row - 1])}
    return {what: (0, 6 * own.idx[:, :slots, None] + np.arange(6))}
