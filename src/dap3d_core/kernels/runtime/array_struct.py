"""Many arrays handed to compiled code as one address.

A tuple of 25 arrays is 175 numbers that every call copies, and counts references to: on a small
scene more than its physics. Here the arrays stand in a table in memory, and what is handed on is
where the table is; compiled code reads from it what it uses. The owner of the arrays lives as long
as the call, because Python holds it. Measurements: docs/decisions/0001.

A class of arrays that extends another one begins with its members: compiled code takes it for that
one as well, as in C.

A number that has a name of its own is a ``Scalar``, an item of one of the arrays: reading it loads
that item, assigning to it stores there, in Python and in compiled code.
"""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Generic, TypeVar, get_args, get_origin, overload

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.compiler.intrinsics import intrinsic
from dap3d_core.kernels.compiler.types import COMPLEX, DTYPES, FLOAT, INT, Array, Struct
from dap3d_core.kernels.compiler.units import address_of

VECTOR = Array(FLOAT, 1)
#: Annotations of members that are no vectors: ``Floats`` and ``Integers`` are (array_types.py).
Matrix = Annotated[Floats, Array(FLOAT, 2)]
Tensor = Annotated[Floats, Array(FLOAT, 3)]
IntegerMatrix = Annotated[Integers, Array(INT, 2)]
ComplexMatrix = Annotated[Any, Array(COMPLEX, 2)]
Number = TypeVar("Number", float, int)


class Scalar(Generic[Number]):
    """A number of a class of arrays by name: the next item of the member ``array``."""

    index: int

    def __init__(self, array: str) -> None:
        self.array = array

    def __set_name__(self, owner: "type[Arrays]", name: str) -> None:
        self.index = len(owner.indices(self.array))
        owner.scalars = {**owner.scalars, name: self}

    @overload
    def __get__(self, struct: None, owner: Any) -> "Scalar[Number]": ...

    @overload
    def __get__(self, struct: "Arrays", owner: Any) -> Number: ...

    def __get__(self, struct: Any, owner: Any) -> Any:
        return self if struct is None else getattr(struct, self.array)[self.index]

    def __set__(self, struct: "Arrays", value: Number) -> None:
        getattr(struct, self.array)[self.index] = value


@attrs.define(eq=False, kw_only=True, slots=False)
class Arrays:
    """Base of classes whose members are C-contiguous arrays, or further such classes.

    The annotation of a member gives its type. One that is a class of arrays may be None where
    nothing reads it: ``Annotated[Any, CLASS]``. Subclasses are frozen, but for those with scalars:
    their arrays are bound once.
    """

    #: By name; those of base classes first.
    scalars: ClassVar[dict[str, Scalar[Any]]] = {}
    _table: Any = attrs.field(init=False, repr=False)
    #: Where the table is.
    address: int = attrs.field(init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        words: list[int] = []
        for name, type_ in self.type_of().members:
            array = getattr(self, name)
            if isinstance(type_, Struct):
                words.append(0 if array is None else array.address)
                continue
            fits = array.dtype == DTYPES[type_.item] and array.ndim == type_.ndim
            if not (fits and array.flags.c_contiguous):
                raise TypeError(f"{name} is not {type_}")
            words.append(address_of(array))
            words += array.shape
        table = np.array(words, dtype=np.int64)
        object.__setattr__(self, "_table", table)
        object.__setattr__(self, "address", address_of(table))

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in type(self).scalars and (
            name in self.__dict__ or not hasattr(attrs.fields(type(self)), name)
        ):
            raise AttributeError(f"{name} is no scalar: only scalars and items of arrays change")
        object.__setattr__(self, name, value)

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
    def type_of(cls) -> Struct:
        """The type of the class in compiled code."""
        found: Struct | None = cls.__dict__.get("_type")
        if found is None:
            members = [(f.name, _member_type(f.type)) for f in attrs.fields(cls) if f.init]
            scalars = {name: (s.array, s.index) for name, s in cls.scalars.items()}
            found = cls._type = Struct(  # type: ignore[attr-defined]
                cls.__name__, tuple(members), scalars
            )
        return found

    @classmethod
    def indices(cls, array: str) -> dict[str, int]:
        """Index of each scalar of a member, by name."""
        return {name: s.index for name, s in cls.scalars.items() if s.array == array}


def _member_type(annotation: Any) -> Array | Struct:
    """The type in compiled code of a member with an annotation."""
    if annotation in (Floats, Integers):
        return VECTOR if annotation == Floats else Array(INT, 1)
    given = get_args(annotation)[1] if get_origin(annotation) is Annotated else annotation
    return given if isinstance(given, Array) else given.type_of()


@intrinsic("pointer")
def pointer(array: Any) -> Any:
    """A C-contiguous array as a loop writes into it: by flat index, never counted from the end."""
    return array.reshape(-1)
