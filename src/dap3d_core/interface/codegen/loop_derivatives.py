"""Derivatives of what a group loop computes, by the bodies of each instance.

The loop of a type runs once, as plain Python, with dual numbers (kernels/dual_numbers.py) in place
of the numbers of all its instances at once. Nothing is compiled, and any type has derivatives, a
third party's too, exact to rounding. Twelve directions for each body an instance reads: its
displacement, its rotation vector (global axes), its velocity, its angular velocity (global axes).
"""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.codegen.compile_loops import write
from dap3d_core.interface.codegen.loop_source import stride
from dap3d_core.interface.codegen.reactions import body_columns, rows_read
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.dual_numbers import Dual, DualFunctions
from dap3d_core.kernels.runtime import generated_modules
from dap3d_core.kernels.runtime.loop_modules import Loop, source_of
from dap3d_core.kernels.runtime.loop_support import A, P, R, V, W

#: Directions of a body: r, rotation vector, r_dot, omega.
DIRECTIONS = 12


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


@attrs.frozen(eq=False)
class _Column:
    """A column of the integers of all instances, scaled and shifted: an index of a loop."""

    column: int
    factor: int = 1
    shift: int = 0

    def __add__(self, k: int) -> "_Column":
        return attrs.evolve(self, shift=self.shift + k)

    def __mul__(self, k: int) -> "_Column":
        return _Column(self.column, self.factor * k, self.shift * k)

    __radd__, __rmul__ = __add__, __mul__


class _Integers:
    """The integers of an instance."""

    def __getitem__(self, k: int) -> _Column:
        return _Column(k)


class _Numbers:
    """The numbers of all instances; ``flat`` holds those of all groups, tables as well."""

    tracer = DualFunctions()

    def __init__(
        self, flat: Floats, p0: int, shape: tuple[int, int], slopes: dict[int, Floats]
    ) -> None:
        self.flat, self.own = flat, flat[p0 : p0 + shape[0] * shape[1]].reshape(shape)
        self.slopes = slopes

    def __getitem__(self, k: Any) -> Dual:
        if isinstance(k, np.ndarray):
            return Dual(self.flat[k][:, None])
        return Dual(self.own[:, k : k + 1], self.slopes.get(k))


class _Bodies:
    """The rows of the bodies of all instances, with their derivatives by the bodies' motion."""

    def __init__(self, body: Floats, idx: Integers, places: list[int], directions: int) -> None:
        self.rows = {column: body[idx[:, column]] for column in places}
        self.place = {column: n for n, column in enumerate(places)}
        self.directions = directions

    def __getitem__(self, key: tuple[_Column, int]) -> Dual:
        column, k = key[0].column, key[1]
        rows = self.rows[column]
        mine = _by_motion(rows, k)
        if mine is None:
            return Dual(rows[:, k : k + 1])
        slope = np.zeros((len(rows), self.directions))
        first = DIRECTIONS * self.place[column]
        slope[:, first : first + DIRECTIONS] = mine
        return Dual(rows[:, k : k + 1], slope)


def _by_motion(rows: Floats, k: int) -> Floats | None:
    """(m, 12) derivatives of column k of body rows; None where it is constant."""
    slope = np.zeros((len(rows), DIRECTIONS))
    if R <= k < R + 3:
        slope[:, k - R] = 1.0
    elif A <= k < A + 9:  # e x a, with a a column of A
        row, column = divmod(k - A, 3)
        i, j = (row + 1) % 3, (row + 2) % 3
        slope[:, 3 + i] = rows[:, A + 3 * j + column]
        slope[:, 3 + j] = -rows[:, A + 3 * i + column]
    elif V <= k < V + 3:
        slope[:, 6 + k - V] = 1.0
    elif W <= k < W + 3:
        slope[:, 9 + k - W] = 1.0
    elif k == P:  # half (0, e) times p
        slope[:, 3:6] = -0.5 * rows[:, P + 1 : P + 4]
    elif P < k < P + 4:
        row = k - P - 1
        i, j = (row + 1) % 3, (row + 2) % 3
        slope[:, 3 + row] = 0.5 * rows[:, P]
        slope[:, 3 + i] = 0.5 * rows[:, P + 1 + j]
        slope[:, 3 + j] = -0.5 * rows[:, P + 1 + i]
    else:
        return None
    return slope


class _Functions:
    """Functions of time, as they stand at the time of the evaluation."""

    def __init__(self, F: Floats, idx: Integers, slopes: dict[tuple[int, int], Floats]) -> None:
        self.F, self.idx, self.slopes = F, idx, slopes

    def __getitem__(self, key: tuple[_Column, int]) -> Dual:
        column, order = key[0].column, key[1]
        value = self.F[self.idx[:, column], order][:, None]
        return Dual(value, self.slopes.get((column, order)))


class _States:
    """States of all instances, with derivatives by their own where there are directions for it."""

    def __init__(self, values: Floats, idx: Integers, slopes: Floats | None) -> None:
        self.values, self.idx, self.slopes = values, idx, slopes

    def __getitem__(self, k: _Column) -> Dual:
        value = self.values[self.idx[:, k.column] + k.shift][:, None]
        return Dual(value, None if self.slopes is None else self.slopes[k.shift])


@attrs.frozen(eq=False)
class _Multipliers:
    """-lambda of all rows, as friction reads it; slopes: by lambda of each row of each joint.

    A joint is known by the column of its first row's index.
    """

    values: Floats
    idx: Integers
    slopes: dict[int, Floats]

    def at(self, k: _Column) -> Dual:
        values = self.values[self.idx[:, k.column] + k.shift][:, None]
        return Dual(values, -self.slopes[k.column][k.shift])


class _Outputs:
    """An array that a loop writes to, or from which friction reads -lambda."""

    def __init__(self, multipliers: _Multipliers | None = None) -> None:
        self.values: dict[tuple[int, int], Any] = {}
        self.multipliers = multipliers

    def __getitem__(self, k: _Column) -> Any:
        if self.multipliers is not None:
            return self.multipliers.at(k)
        return self.values.get((k.column, k.shift), 0.0)

    def __setitem__(self, k: _Column, x: Any) -> None:
        self.values[k.column, k.shift] = x


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
    loop: Any = write(type_info, what)
    layout, (i0, p0, count), width = type_info.layout, group, stride(type_info)
    idx = arrays.idx[i0 : i0 + count * width].reshape(count, width)
    slots, first = len(layout.slots), len(layout.slots) + len(layout.functions)
    read = rows_read(type_info) if what == "friction" else {}
    places = [*range(slots), *range(first, first + len(layout.others))]
    places += body_columns(type_info) if read else []
    of_bodies = DIRECTIONS * len(places)
    by_numbers = of_bodies + sum(read.values())
    by_states = by_numbers + len(numbers) + len(functions)
    directions = by_states + (layout.state_width if states else 0)
    unit = np.eye(directions)[:, None]
    slopes = dict(zip(numbers, unit[by_numbers:], strict=False))
    columns = [(slots + field, order) for field, order in functions]
    by_functions = dict(zip(columns, unit[by_numbers + len(numbers) : by_states], strict=True))
    ends = of_bodies + np.cumsum(list(read.values()), dtype=np.int64)
    of_rows = {c: unit[e - n : e] for (c, n), e in zip(read.items(), ends, strict=True)}
    friction = _Multipliers(multipliers, idx, of_rows) if multipliers is not None else None
    outputs = [_Outputs(), _Outputs(friction if read else None), _Outputs(), _Outputs()]
    loop_arrays = SimpleNamespace(
        body=_Bodies(arrays.body, idx, places, directions),
        F=_Functions(arrays.F, idx, by_functions),
        idx=_Integers(),
        par=_Numbers(arrays.par, p0, (count, layout.par_width), slopes),
        states=_States(arrays.states, idx, unit[by_states:] if states else None),
        rates=outputs[3],
    )
    _run(loop, t, loop_arrays, outputs[:3])
    bodies, size = np.ascontiguousarray(idx[:, places]), (count, directions)
    return LoopDerivatives(bodies, _results(type_info, what, outputs, size))


def _run(loop: Loop, t: float, arrays: SimpleNamespace, outputs: list[_Outputs]) -> None:
    """Run a loop once, as plain Python, for all instances at once."""
    namespace = generated_modules.load(None, f"derivatives of {loop.name}", source_of(loop))
    namespace |= loop.kernels | {"range": lambda count: [0]}
    with np.errstate(all="ignore"):
        namespace["loop"](t, arrays, 0, 0, 1, *outputs)


def _results(
    type_info: TypeInfo, what: str, outputs: list[_Outputs], size: tuple[int, int]
) -> dict[str, tuple[Floats, Floats]]:
    """What a loop wrote, by kernel; size: (m, d)."""
    layout, rows = type_info.layout, type_info.row_count
    slots, row = len(layout.slots), layout.integers  # the column of the first row's index
    if what == "acceleration":
        J, J_slope = _gathered(outputs[0], list(range(row + 1, row + 1 + slots)), 6 * rows, size)
        shape = (size[0], slots, rows, 6)
        return {
            "J": (J.reshape(shape), J_slope.reshape(*shape, size[1])),
            "gamma": _of_one(outputs[1], row, rows, size),
            "nu": _of_one(outputs[2], row, rows, size),
        }
    if what == "position":
        return {"C": _of_one(outputs[0], row, rows, size)}
    if what == "rate":
        return {what: _of_one(outputs[3], row - 1, layout.state_width, size)}
    return {what: _gathered(outputs[0], list(range(slots)), 6, size)}


def _of_one(output: _Outputs, column: int, width: int, size: tuple[int, int]) -> Any:
    """Values (m, width) and derivatives (m, width, d) behind one index of the instances."""
    value, slope = _gathered(output, [column], width, size)
    return value[:, 0], slope[:, 0]


def _gathered(
    output: _Outputs, columns: list[int], width: int, size: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Values (m, columns, width) and derivatives (..., d) that a loop wrote; size: (m, d)."""
    count, directions = size
    value = np.zeros((count, len(columns), width))
    slope = np.zeros((count, len(columns), width, directions))
    for (column, shift), x in output.values.items():
        n = columns.index(column)
        if isinstance(x, Dual):
            value[:, n, shift] = np.broadcast_to(x.value, (count, 1))[:, 0]
            slope[:, n, shift] = 0.0 if x.slope is None else x.slope
        else:
            value[:, n, shift] = x
    return value, slope
