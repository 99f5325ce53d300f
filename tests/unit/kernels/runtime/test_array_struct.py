"""Arrays handed to compiled code by one address."""

from typing import Any, ClassVar

import attrs
import numpy as np
import pytest

from dap3d_core.kernels.runtime.array_struct import INTEGERS, MATRIX, Arrays, pointer
from dap3d_core.kernels.runtime.cache import compiled, jit_is_on


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Inner(Arrays):
    weights: Any


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Base(Arrays):
    types: ClassVar[dict[str, Any]] = {"table": MATRIX, "count": INTEGERS}

    table: Any
    count: Any


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Whole(Base):
    types: ClassVar[dict[str, Any]] = Base.types | {"inner": Inner.type_of()}

    values: Any
    inner: Inner


def whole(rows=2):
    return Whole(
        table=np.arange(3.0 * rows).reshape(rows, 3),
        count=np.array([rows]),
        values=np.zeros(2),
        inner=Inner(weights=np.array([10.0, 20.0])),
    )


@compiled
def last_of(base):
    return base.table[base.count[0] - 1, 2] + 100.0 * base.table.shape[0]


@compiled
def fill(arrays):
    out = pointer(arrays.values)
    for k in range(arrays.values.shape[0]):
        out[k] = arrays.inner.weights[k] * arrays.table[0, 1]
    return last_of(arrays)


@pytest.mark.parametrize("rows", [2, 5])
def test_members_are_the_arrays_themselves(rows):
    """Also of a class within a class; the shape is that of this object, not of the first one."""
    arrays = whole(rows)
    assert fill(arrays) == 3.0 * rows - 1.0 + 100.0 * rows
    assert arrays.values.tolist() == [10.0, 20.0]
    arrays.table[0, 1] = -1.0
    fill(arrays)
    assert arrays.values.tolist() == [-10.0, -20.0]


@pytest.mark.skipif(not jit_is_on(), reason="types are those of compiled code")
def test_a_class_is_taken_for_the_one_it_extends():
    """Compiled for the base alone, called with the whole."""
    assert last_of.compile((Base.type_of(),))(whole()) == 205.0
    assert Whole.type_of().begins_with(Base.type_of())
    assert not Inner.type_of().begins_with(Base.type_of())


@pytest.mark.parametrize(
    "wrong",
    [np.zeros((2, 3), dtype=np.float32), np.zeros(3), np.zeros((3, 2)).T],
    ids=["single", "one dimension", "not contiguous"],
)
def test_other_arrays_are_refused(wrong):
    """Compiled code would read beyond them."""
    with pytest.raises(TypeError, match="table is not"):
        Base(table=wrong, count=np.array([2]))


def test_members_in_order():
    arrays = whole()
    assert [id(member) for member in arrays] == [
        id(x) for x in (arrays.table, arrays.count, arrays.values, arrays.inner)
    ]
