"""The types of compiled code, and the machine words that a value of each is made of."""

import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np


class CompileError(TypeError):
    """Python that the compiler does not take: why, what to write instead, file and line."""


@dataclass(frozen=True, eq=False)
class Scalar:
    """A number, or nothing."""

    name: str
    words: tuple[str, ...]


NOTHING, BOOL, INT = Scalar("None", ()), Scalar("bool", ("i1",)), Scalar("int", ("i64",))
FLOAT, COMPLEX = Scalar("float", ("double",)), Scalar("complex", ("double", "double"))
#: Numbers in the order in which one becomes another.
NUMBERS = (BOOL, INT, FLOAT, COMPLEX)
#: Items of arrays.
DTYPES = {INT: np.dtype(np.int64), FLOAT: np.dtype(float), COMPLEX: np.dtype(complex)}


@dataclass(frozen=True)
class Array:
    """A C-contiguous array: where its numbers begin, and its shape."""

    item: Scalar
    ndim: int

    @property
    def words(self) -> tuple[str, ...]:
        """An address, and a length for each dimension."""
        return ("ptr", *["i64"] * self.ndim)


@dataclass(frozen=True)
class _ByAddress:
    @property
    def words(self) -> tuple[str, ...]:
        """One address."""
        return ("ptr",)


@dataclass(frozen=True)
class Numbers(_ByAddress):
    """Where the numbers of an array begin: what a function called by address takes of it."""


@dataclass(frozen=True, eq=False)
class Struct(_ByAddress):
    """A table of arrays, and of further such tables (kernels/by_address.py)."""

    name: str
    members: tuple[tuple[str, Any], ...]

    def begins_with(self, other: Any) -> bool:
        """Whether this has the members of the other first, so that it can stand for it."""
        return isinstance(other, Struct) and self.members[: len(other.members)] == other.members


@dataclass(frozen=True, eq=False)
class Signature:
    """Types of the arguments and of the result of a function called by address."""

    arguments: tuple[Any, ...]
    result: Any = NOTHING


@dataclass(frozen=True)
class Pointer(_ByAddress):
    """The address of a function."""

    signature: Signature


@dataclass(frozen=True)
class Table(_ByAddress):
    """Addresses of functions of one signature."""

    signature: Signature


@dataclass(frozen=True)
class Tuple:
    """Values of several types."""

    items: tuple[Any, ...]

    @property
    def words(self) -> tuple[str, ...]:
        """Those of its items."""
        return tuple(word for item in self.items for word in item.words)


@dataclass(frozen=True)
class Known:
    """What is known when code is compiled: a function, a module, a number put into a function."""

    value: Any
    words: tuple[str, ...] = ()


class Value(NamedTuple):
    """A value while code is written: its type, LLVM's names of its words, the number if known."""

    type: Any
    words: tuple[str, ...] = ()
    constant: Any = None
    items: "tuple[Value, ...]" = ()

    @property
    def word(self) -> str:
        """The word of a value that has one."""
        return self.words[0]


def bits(x: float) -> str:
    """A float as LLVM writes it, exactly."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', x))[0]:016X}"


def constant(value: Any) -> Value | None:
    """A number, a tuple of numbers or None as a value; None where it is something else."""
    if value is None:
        return Value(NOTHING)
    if isinstance(value, (bool, np.bool_)):
        return Value(BOOL, ("true" if value else "false",), bool(value))
    if isinstance(value, (int, np.integer)):
        return Value(INT, (str(int(value)),), int(value)) if -(2**63) <= value < 2**63 else None
    if isinstance(value, (float, np.floating)):
        return Value(FLOAT, (bits(float(value)),), float(value))
    if isinstance(value, (complex, np.complexfloating)):
        return Value(COMPLEX, (bits(value.real), bits(value.imag)), complex(value))
    if isinstance(value, tuple):
        items = [constant(item) for item in value]
        return None if None in items else group([item for item in items if item is not None])
    return None


def group(items: Any) -> Value:
    """Values as one tuple."""
    types = Tuple(tuple(item.type for item in items))
    return Value(types, tuple(w for item in items for w in item.words), None, tuple(items))


def items_of(value: Value) -> tuple[Value, ...]:
    """The items of a tuple."""
    if value.items or not value.type.items:
        return value.items
    words, items = iter(value.words), value.type.items
    return tuple(Value(item, tuple(next(words) for _ in item.words)) for item in items)


def wider(one: Any, other: Any) -> Any:
    """The type that holds values of both; None where there is none."""
    if one == other:
        return one
    if one in NUMBERS and other in NUMBERS:
        return max(one, other, key=NUMBERS.index)
    if isinstance(one, Tuple) and isinstance(other, Tuple) and len(one.items) == len(other.items):
        items = tuple(wider(a, b) for a, b in zip(one.items, other.items, strict=True))
        return None if None in items else Tuple(items)
    return None
