"""Types of compiled code, and the machine words that represent their values."""

import struct
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np


class CompileError(TypeError):
    """Python outside the subset: the reason, what to write instead, file and line."""


@dataclass(frozen=True, eq=False)
class Scalar:
    """A number, or None."""

    name: str
    words: tuple[str, ...]


NOTHING, BOOL, INT = Scalar("None", ()), Scalar("bool", ("i1",)), Scalar("int", ("i64",))
FLOAT, COMPLEX = Scalar("float", ("double",)), Scalar("complex", ("double", "double"))
#: Number types in the order of conversion.
NUMBERS = (BOOL, INT, FLOAT, COMPLEX)
#: Types of array items.
DTYPES = {INT: np.dtype(np.int64), FLOAT: np.dtype(float), COMPLEX: np.dtype(complex)}


@dataclass(frozen=True)
class Array:
    """A C-contiguous array: address of its first item, and shape.

    With no dimension it is the address alone, as functions called by address take arrays.
    """

    item: Scalar
    ndim: int

    @property
    def words(self) -> tuple[str, ...]:
        """An address, and a length for each dimension."""
        return ("ptr", *["i64"] * self.ndim)


@dataclass(frozen=True, eq=False)
class Struct:
    """A struct of arrays and further structs (kernels/runtime/array_struct.py).

    ``scalars`` gives array and index of each number that has a name of its own.
    """

    name: str
    members: tuple[tuple[str, Any], ...]
    scalars: dict[str, tuple[str, int]] = field(default_factory=dict)
    words = ("ptr",)

    def begins_with(self, other: Any) -> bool:
        """True if this struct extends the other: its first members are those of the other."""
        return isinstance(other, Struct) and self.members[: len(other.members)] == other.members


@dataclass(frozen=True, eq=False)
class Signature:
    """Argument and result types of a function called by address."""

    arguments: tuple[Any, ...]
    result: Any = NOTHING


@dataclass(frozen=True)
class Pointer:
    """The address of a function."""

    signature: Signature
    words = ("ptr",)


@dataclass(frozen=True)
class Table:
    """Addresses of functions of one signature."""

    signature: Signature
    words = ("ptr",)


@dataclass(frozen=True)
class Tuple:
    """Values of several types."""

    items: tuple[Any, ...]

    @property
    def words(self) -> tuple[str, ...]:
        """The words of its items."""
        return tuple(word for item in self.items for word in item.words)


@dataclass(frozen=True, eq=False)
class Known:
    """A compile-time constant: a function, a module, a number given to an inlined function."""

    value: Any
    words: tuple[str, ...] = ()

    def __eq__(self, other: object) -> bool:
        """Equality of type and bits: 1, 1.0 and True are different code, and so are 0.0, -0.0."""
        return isinstance(other, Known) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> Any:
        return type(self.value), repr(self.value) if isinstance(self.value, float) else self.value


class Value(NamedTuple):
    """A value in the compiler: type, LLVM names of its words, number if it is a constant."""

    type: Any
    words: tuple[str, ...] = ()
    constant: Any = None
    items: "tuple[Value, ...]" = ()

    @property
    def word(self) -> str:
        """The word of a value of one word."""
        return self.words[0]


def bits(x: float) -> str:
    """A float in the exact notation of LLVM."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', x))[0]:016X}"


def constant(value: Any) -> Value | None:
    """A real number, a tuple of them or None as a value; None for anything else."""
    if value is None:
        return Value(NOTHING)
    if isinstance(value, (bool, np.bool_)):
        return Value(BOOL, ("true" if value else "false",), bool(value))
    if isinstance(value, (int, np.integer)):
        return Value(INT, (str(int(value)),), int(value)) if -(2**63) <= value < 2**63 else None
    if isinstance(value, (float, np.floating)):
        return Value(FLOAT, (bits(float(value)),), float(value))
    items = [constant(item) for item in value] if isinstance(value, tuple) else [None]
    return None if None in items else group(items)


def group(items: Any) -> Value:
    """Values as one tuple."""
    types = Tuple(tuple(item.type for item in items))
    return Value(types, tuple(w for item in items for w in item.words), None, tuple(items))


def items_of(value: Value) -> tuple[Value, ...]:
    """The items of a tuple."""
    if value.items or not value.type.items:
        return value.items
    words = iter(value.words)
    return tuple(Value(item, tuple(next(words) for _ in item.words)) for item in value.type.items)


def is_constant(value: Value) -> bool:
    """True for a number that is known, or a tuple of such."""
    is_tuple = isinstance(value.type, Tuple) and len(value.items) == len(value.type.items)
    return value.constant is not None or (is_tuple and all(map(is_constant, value.items)))


def wider(*types: Any) -> Any:
    """The common type of numbers; None where a type is no number's."""
    return max(types, key=NUMBERS.index) if all(type_ in NUMBERS for type_ in types) else None


def name_of(type_: Any) -> str:
    """Description of a type for messages."""
    if isinstance(type_, Array):
        return f"array of {type_.item.name}s with {type_.ndim} indices"
    if isinstance(type_, Known):
        return "function" if callable(type_.value) else "module"
    return str(getattr(type_, "name", type(type_).__name__.lower()))


def result_type(type_: Any) -> str:
    """LLVM type of a result."""
    words = type_.words
    if len(words) > 1:
        return f"{{{', '.join(words)}}}"
    return words[0] if words else "void"
