"""Arrays handed to compiled code by one address, and numbers of them by name."""

import attrs
import numpy as np
import pytest
from support.at_all_levels import compiled_at_all_levels, function_of
from support.internals import (
    FLOAT,
    INT,
    Arrays,
    CompileError,
    Floats,
    Integers,
    Matrix,
    Program,
    Scalar,
    compiled,
    jit_is_on,
    pointer,
)


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Inner(Arrays):
    weights: Floats


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Base(Arrays):
    table: Matrix
    count: Integers


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Whole(Base):
    values: Floats
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


@attrs.define(eq=False, kw_only=True, slots=False)
class Clock(Arrays):
    t = Scalar[float]("real")
    ticks = Scalar[int]("integer")
    h = Scalar[float]("real")
    is_running = Scalar[int]("integer")

    real: Floats
    integer: Integers


@attrs.define(eq=False, kw_only=True, slots=False)
class Stopwatch(Clock):
    laps = Scalar[int]("integer")

    marks: np.ndarray


def clock():
    return Clock(real=np.array([1.0, 0.25, 7.0]), integer=np.array([3, 0]))


def test_scalars_are_items_of_their_arrays_in_the_order_of_definition():
    c = clock()
    c.t += c.h
    c.ticks = 5
    assert c.real.tolist() == [1.25, 0.25, 7.0]
    assert c.integer.tolist() == [5, 0]
    assert type(c.t) is np.float64  # division by zero is not raised, as in compiled code


def test_scalars_of_a_derived_class_follow_those_of_its_base():
    assert Clock.indices("integer") == {"ticks": 0, "is_running": 1}
    assert Stopwatch.indices("integer") == {"ticks": 0, "is_running": 1, "laps": 2}
    assert Stopwatch.indices("real") == {"t": 0, "h": 1}


@pytest.mark.parametrize("name", ["real", "address", "tick"])
def test_nothing_else_is_assigned(name):
    with pytest.raises(AttributeError, match=f"{name} is no scalar"):
        setattr(clock(), name, 1.0)


SOURCE = """
def f(c, x, k):
    n = 0
    while c.t < x:
        c.t += c.h
        c.ticks = c.ticks + k
        c.is_running, c.h = c.t < x, c.h * 2
        n += 1
    c.real[2] = c.ticks
    c.ticks += c.real[2] * 0.5
    return c.ticks / n
"""


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
def test_compiled_code_reads_and_writes_them_as_python_does():
    """Integers become floats, floats lose their fraction, comparisons are 0 and 1."""
    function, plain = function_of(SOURCE), clock()
    expected = function(plain, 4.0, 2)
    for level, made in compiled_at_all_levels(function, (Clock.type_of(), FLOAT, INT)).items():
        own = clock()
        assert made(own, 4.0, 2) == expected, level
        assert own.real.tobytes() == plain.real.tobytes(), level
        assert own.integer.tobytes() == plain.integer.tobytes(), level


@pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
@pytest.mark.parametrize(("line", "words"), [
    ("c.real = c.real", "real of a Clock is given a value; only arrays and scalars"),
    ("c.tick = 1", "tick of a Clock is given a value"),
    ("c.ticks = c.real", "array of floats with 1 indices is given for a int"),
    ("x = c.tick", "has no member tick; it has real, integer, t, ticks, h, is_running"),
])  # fmt: skip
def test_what_compiled_code_refuses(line, words):
    function = function_of(f"def f(c):\n    {line}\n    return c.t\n")
    with pytest.raises(CompileError, match=words):
        Program().function(function, (Clock.type_of(),))
