"""Many arrays handed to compiled code as one address.

A tuple of 25 arrays is 175 numbers that every call copies, and counts references to: on a small
scene more than its physics. Here the arrays stand in a table in memory, and what is handed on is
where the table is; compiled code reads from it what it uses. The owner of the arrays lives as long
as the call, because Python holds it. Measurements: docs/decisions/0001.

A class of arrays that extends another one begins with its members: compiled code takes it for that
one as well, as in C.
"""

from collections.abc import Iterator
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.kernels.compiler.types import COMPLEX, DTYPES, FLOAT, INT, Array, Struct
from dap3d_core.kernels.compiler.units import address_of
from dap3d_core.kernels.compiler.words import word

VECTOR, MATRIX, TENSOR = Array(FLOAT, 1), Array(FLOAT, 2), Array(FLOAT, 3)
INTEGERS, INTEGER_MATRIX = Array(INT, 1), Array(INT, 2)
COMPLEX_VECTOR = Array(COMPLEX, 1)


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
            members = [(f.name, cls.types.get(f.name, VECTOR)) for f in attrs.fields(cls) if f.init]
            found = cls._type = Struct(cls.__name__, tuple(members))  # type: ignore[attr-defined]
        return found


@word("pointer")
def pointer(array: Any) -> Any:
    """A C-contiguous array as a loop writes into it: by flat index, never counted from the end."""
    return array.reshape(-1)
