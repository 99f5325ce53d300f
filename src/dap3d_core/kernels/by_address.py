"""Many arrays handed to compiled code as one address.

A tuple of 25 arrays is 175 numbers that every call copies, and counts references to: on a small
scene more than its physics. Here the arrays stand in a table in memory, and what is handed on is
where the table is; compiled code reads from it what it uses. The owner of the arrays lives as long
as the call, because Python holds it. Measurements: docs/decisions/0001.

A class of arrays that extends another one begins with its members: compiled code takes it for that
one as well, as in C.
"""

from collections.abc import Iterator
from ctypes import addressof, c_char
from typing import Any, ClassVar

import attrs
import numpy as np
from llvmlite import ir
from numba import int64, types
from numba.core import cgutils
from numba.core.imputils import lower_cast, lower_getattr_generic
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    models,
    overload,
    register_model,
    unbox,
)
from numba.np.numpy_support import as_dtype

VECTOR, MATRIX = types.Array(types.float64, 1, "C"), types.Array(types.float64, 2, "C")
INTEGERS, INTEGER_MATRIX = types.Array(int64, 1, "C"), types.Array(int64, 2, "C")
TENSOR = types.Array(types.float64, 3, "C")
COMPLEX_VECTOR = types.Array(types.complex128, 1, "C")


class ByAddress(types.Type):
    """The compiled code's type of a class of arrays: names and types of its members, in order."""

    def __init__(self, name: str, members: tuple[tuple[str, Any], ...]) -> None:
        self.members = members
        #: Each member's name, type and numpy dtype; None for a class of arrays.
        self.expected = [
            (name, type_, None if isinstance(type_, ByAddress) else as_dtype(type_.dtype))
            for name, type_ in members
        ]
        super().__init__(f"ByAddress({name})")

    @property
    def key(self) -> Any:
        """What makes two of these types equal."""
        return self.name, self.members

    def can_convert_to(self, _context: Any, other: Any) -> Any:
        """Whether this begins with the members of the other."""
        if isinstance(other, ByAddress) and self.members[: len(other.members)] == other.members:
            return Conversion.safe
        return None


register_model(ByAddress)(models.OpaqueModel)


def _place_of(array: Any) -> int:
    """Address of an array's first number; 0 where it has none."""
    if array.size == 0:
        return 0
    try:
        return addressof(c_char.from_buffer(array))  # four times faster than what follows
    except TypeError:  # it may not be written
        return int(array.ctypes.data)


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Arrays:
    """Base of classes whose members are C-contiguous arrays, or further such classes.

    ``types`` gives the type of each member that is not a vector of float64. A member that is a
    class of arrays may be None where nothing reads it.
    """

    types: ClassVar[dict[str, Any]] = {}
    _table: Any = attrs.field(init=False, repr=False)
    #: Where the table is.
    address: int = attrs.field(init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        words: list[int] = []
        for name, type_, dtype in self.type_of().expected:
            array = getattr(self, name)
            if dtype is None:
                words.append(0 if array is None else array.address)
                continue
            fits = array.dtype == dtype and array.ndim == type_.ndim
            if not (fits and array.flags.c_contiguous):
                raise TypeError(f"{name} is not {type_}")
            words.append(_place_of(array))
            words += array.shape
        table = np.array(words, dtype=np.int64)
        object.__setattr__(self, "_table", table)
        object.__setattr__(self, "address", _place_of(table))

    def __iter__(self) -> Iterator[Any]:
        """The members, in order."""
        return (getattr(self, name) for name, _ in self.type_of().members)

    def walk(self, before: str = "") -> Iterator[tuple[str, Any]]:
        """Name and array of each member, those of further classes behind a dot."""
        for name, _ in self.type_of().members:
            member = getattr(self, name)
            if isinstance(member, Arrays):
                yield from member.walk(f"{before}{name}.")
            elif member is not None:
                yield f"{before}{name}", member

    @classmethod
    def type_of(cls) -> ByAddress:
        """The type of the class in compiled code."""
        found: ByAddress | None = cls.__dict__.get("_numba_type_")
        if found is None:
            members = [(f.name, cls.types.get(f.name, VECTOR)) for f in attrs.fields(cls) if f.init]
            found = ByAddress(cls.__name__, tuple(members))
            # where the dispatcher looks first: 0.4 us a call, against 5 us by way of typeof
            cls._numba_type_ = found  # type: ignore[attr-defined]
        return found


@unbox(ByAddress)
def _unbox(type_: ByAddress, obj: Any, c: Any) -> NativeValue:
    number = c.pyapi.object_getattr_string(obj, "address")
    failed = cgutils.is_null(c.builder, number)
    address = c.builder.inttoptr(c.pyapi.long_as_longlong(number), c.context.get_value_type(type_))
    c.pyapi.decref(number)
    return NativeValue(address, is_error=failed)


@infer_getattr
class _Members(AttributeTemplate):
    key = ByAddress

    def generic_resolve(self, type_: ByAddress, name: str) -> Any:
        return dict(type_.members).get(name)


def _words(type_: Any) -> int:
    """Words of a member in the table: its place, and its shape."""
    return 1 if isinstance(type_, ByAddress) else 1 + type_.ndim


@lower_getattr_generic(ByAddress)
def _read_member(context: Any, builder: Any, type_: ByAddress, value: Any, name: str) -> Any:
    word, first = ir.IntType(64), 0
    for member, member_type in type_.members:
        if member == name:
            break
        first += _words(member_type)
    table = builder.bitcast(value, word.as_pointer())
    unchanged = builder.module.add_metadata([])

    def read(k: int) -> Any:
        number = builder.load(builder.gep(table, [ir.Constant(word, first + k)]))
        number.set_metadata("invariant.load", unchanged)  # so that no loop reads it again
        return number

    if isinstance(member_type, ByAddress):
        return builder.inttoptr(read(0), context.get_value_type(member_type))
    array = context.make_array(member_type)(context, builder)
    item = context.get_abi_sizeof(context.get_data_type(member_type.dtype))
    shape = [read(1 + k) for k in range(member_type.ndim)]
    strides = [ir.Constant(word, item)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    count = shape[0]
    for length in shape[1:]:
        count = builder.mul(count, length)
    array.data = builder.inttoptr(read(0), array.data.type)
    array.nitems, array.itemsize = count, ir.Constant(word, item)
    array.shape = cgutils.pack_array(builder, shape)
    array.strides = cgutils.pack_array(builder, strides)
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    return array._getvalue()


@lower_cast(ByAddress, ByAddress)
def _same_address(_context: Any, _builder: Any, _one: Any, _other: Any, value: Any) -> Any:
    return value


@intrinsic
def _first_of(_typing: Any, array: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


def pointer(array: Any) -> Any:
    """A C-contiguous array as a loop writes into it: by flat index, never counted from the end."""
    return array.reshape(-1)


@overload(pointer)
def _compiled_pointer(array):  # type: ignore[no-untyped-def]
    return lambda array: _first_of(array)
