"""Storage of the instances of a type, integers and numbers of each; shapes of what kernels return.

Kernels may omit brackets around a single entry: a joint of one row may return a number for its row,
an element of one body its pair or block. ``entries`` gives the expression of each number.
"""

from collections.abc import Mapping
from inspect import signature
from itertools import takewhile
from math import prod
from typing import Any

import attrs

from dap3d_core.interface.element_states import state_shape, unknown_names
from dap3d_core.interface.fields import SLOTS, slot_of, specs_of
from dap3d_core.interface.types import TypeBase, acts_on_all

#: Numbers of an angle: itself, its rate and the time, at the last accepted step.
ANGLE_WIDTH = 3

#: A constant or a field in the numbers of an instance: its offset and shape.
Place = tuple[int, tuple[int, ...]]


@attrs.frozen
class InstanceLayout:
    """Indices of the integers and numbers of an instance.

    Attributes:
        slots: body slots, in the order of the J blocks.
        functions: function fields of time and input fields that kernels name, in order; their rows
            of F follow the bodies in ``idx``.
        others: vector fields of no slot, in order; the bodies they are fixed in come next.
        constants: names that ``prepare`` returns.
        numbers: name -> (offset in ``par``, shape) of the stored numbers.
        tables: name -> (offset of its start and its number of rows, columns).
        angles: name -> offset of the angle at the last accepted step, its rate and the time there;
            of unknowns as well.
        par_width: numbers of an instance.
        states: name -> (offset, shape) of its own states; the index of the first one among those
            of all elements is the last of these integers.
    """

    slots: tuple[str, ...]
    functions: tuple[str, ...]
    others: tuple[str, ...]
    constants: tuple[str, ...]
    numbers: dict[str, Place]
    tables: dict[str, tuple[int, int]]
    angles: dict[str, int]
    par_width: int
    states: dict[str, Place] = attrs.field(factory=dict)
    unknowns: tuple[str, ...] = ()

    @property
    def integers(self) -> int:
        """Number of bodies and functions of an instance in ``idx``, and of its states' index."""
        return len(self.slots) + len(self.functions) + len(self.others) + bool(self.states)

    def shifted(self, start: int) -> "InstanceLayout":
        """The same with the numbers from ``start`` on."""
        return attrs.evolve(
            self,
            numbers={n: (start + at, shape) for n, (at, shape) in self.numbers.items()},
            tables={n: (start + at, columns) for n, (at, columns) in self.tables.items()},
            par_width=start + self.par_width,
        )

    @property
    def state_width(self) -> int:
        """Numbers of all states of an instance."""
        return sum(size(shape) for _, shape in self.states.values())


def body_slots(type_: type[TypeBase]) -> tuple[str, ...]:
    """The body slots of a type, in the order i, j, k, l, ...

    One after k counts only where all from k on are there: a vector ``a_n`` of a type of two bodies
    has no slot.
    """
    slots = set(SLOTS[: acts_on_all(type_)])
    for name, spec in specs_of(type_).items():
        if spec.kind == "vector2":
            slots |= {"i", "j"}
        elif spec.ground:
            continue
        elif spec.kind in ("body", "point", "vector") and (slot := slot_of(name)):
            slots.add(slot)
    first = (s for s in SLOTS[:2] if s in slots)
    return (*first, *takewhile(slots.__contains__, SLOTS[2:]))


def size(shape: tuple[int, ...]) -> int:
    """Number of entries of a shape."""
    return prod(shape)


def shape_of(value: Any) -> tuple[int, ...]:
    """Shape of a number or a nested tuple of numbers."""
    if isinstance(value, (tuple, list)):
        return (len(value), *shape_of(value[0])) if value else (0,)
    return ()


def prefix_of(type_: type[TypeBase], field: str) -> str:
    """How the names begin that a function field offers: ``f`` unless the type has a field f."""
    return "f" if field == "function" and "f" not in specs_of(type_) else field


def _is_named(type_: type[TypeBase], field: str) -> bool:
    """True if a kernel names what a field offers that is a row of F."""
    f = prefix_of(type_, field)
    offered = {f, f"{f}_dot", f"{f}_ddot", f"{f}_0"}
    return any(offered & set(signature(kernel).parameters) for kernel in type_.kernels().values())


def layout_of(type_: type[TypeBase], constants: Mapping[str, Any]) -> InstanceLayout:
    """The layout of the instances of a type, given the constants of one of them."""
    numbers: dict[str, Place] = {}
    tables: dict[str, tuple[int, int]] = {}
    angles: dict[str, int] = {}
    functions, others = [], []
    slots = body_slots(type_)
    width = 0
    shapes = {"number": (), "point": (3,), "vector": (3,), "vec3": (3,), "matrix": (3, 3)}
    for name, spec in specs_of(type_).items():
        if spec.for_prepare:
            continue
        if spec.kind == "table":
            tables[name] = width, spec.columns
            width += 2
        elif name in constants:
            continue
        elif spec.kind == "vector2":
            numbers["P_i"], numbers["P_j"] = (width, (3,)), (width + 3, (3,))
            width += 6
        elif spec.kind in shapes or spec.kind == "numbers":
            numbers[name] = width, shapes.get(spec.kind, (spec.columns,))
            width += size(numbers[name][1])
            if spec.kind == "vector" and not spec.ground and slot_of(name) not in slots:
                others.append(name)
            if spec.by_name and _is_named(type_, name):
                functions.append(name)
        elif spec.kind == "input" or (spec.kind == "function" and not spec.argument):
            if _is_named(type_, name):
                functions.append(name)
        elif spec.kind == "angle":
            angles[name] = width
            width += ANGLE_WIDTH
    unknowns = unknown_names(type_) if type_.kind == "joint" else ()
    for name in unknowns:
        angles[name] = width
        width += ANGLE_WIDTH + 1  # and a sign (unknowns.py)
    stored = tuple(name for name in constants if name not in tables)
    for name in stored:
        numbers[name] = width, shape_of(constants[name])
        width += size(numbers[name][1])
    return InstanceLayout(
        slots, tuple(functions), tuple(others), stored, numbers, tables, angles, width,
        state_places(type_), unknowns,
    )  # fmt: skip


def state_places(type_: type[TypeBase]) -> dict[str, Place]:
    """Offset and shape of each state."""
    states: dict[str, Place] = {}
    offset = 0
    for name, length in type_.state_lengths().items():
        states[name] = offset, state_shape(length)
        offset += length
    return states


class ShapeError(ValueError):
    """The return value of a kernel does not match its rows and bodies."""


def entries(value: Any, shape: tuple[int, ...], what: str, name: str = "out") -> list[str]:
    """Expressions for the numbers of ``shape``, by rows, in a kernel's output.

    Args:
        value: a sample of the output.
        shape: the expected shape; dimensions of extent 1 may be missing in the value.
        what: the expectation, for the error.
        name: variable of the output in the loop.

    Raises:
        ShapeError: the value has another shape.
    """
    actual = checked_shape(value)
    if size(actual) != size(shape) or [n for n in actual if n > 1] != [n for n in shape if n > 1]:
        raise ShapeError(f"it should return {what}, shape {shape}; it returned shape {actual}")
    return _paths(actual, name)


def state_entries(value: Any, type_: type[TypeBase]) -> list[str]:
    """As ``entries``, of what ``rate`` of a type returns: the derivative of each of its states.

    Raises:
        ShapeError: the value has another shape.
    """
    shapes = [shape for _, shape in state_places(type_).values()]
    what = f"{sum(map(size, shapes))} numbers, the derivatives of its states"
    if len(shapes) == 1:
        return entries(value, shapes[0], what)
    count = len(value) if isinstance(value, (tuple, list)) else 1
    if count != len(shapes):
        raise ShapeError(
            f"it should return {len(shapes)} derivatives, one for each state; it returned {count}"
        )
    parts = zip(value, shapes, strict=True)
    found = [entries(part, shape, what, f"out[{k}]") for k, (part, shape) in enumerate(parts)]
    return [path for paths in found for path in paths]


def checked_shape(value: Any) -> tuple[int, ...]:
    """Shape of a number or a nested tuple of numbers, with rows of equal length."""
    shape = shape_of(value)
    if shape and any(checked_shape(v) != shape[1:] for v in value):
        raise ShapeError("its rows differ in length")
    return shape


def _paths(shape: tuple[int, ...], name: str) -> list[str]:
    if not shape:
        return [name]
    return [path for k in range(shape[0]) for path in _paths(shape[1:], f"{name}[{k}]")]


def value_at(value: Any, path: str) -> Any:
    """The number of an expression of ``entries`` in a value."""
    for index in path.split("[")[1:]:
        value = value[int(index.rstrip("]"))]
    return value
