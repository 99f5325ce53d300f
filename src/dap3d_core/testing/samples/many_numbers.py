"""Numbers of many instances at once, in place of real arguments of kernels.

The functions of scalar_math.py take them through the entry point of traced symbols: an attribute
``tracer`` that has their functions. Both sides of a branch are computed, as by compiled code.
"""

import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np


class _Functions:
    """The functions of kernels."""

    def where(self, condition: Any, a: Any, b: Any) -> Any:
        """``a`` where the condition holds, else ``b``."""
        kind = Condition if isinstance(a, Condition) or isinstance(b, Condition) else Many
        return kind(np.where(condition.value, _value(a), _value(b)))

    def integer(self, x: Any) -> Any:
        """The whole numbers, as indices."""
        return np.asarray(_value(x)).astype(np.int64)

    def row_of(self, row: Any, array: Any, place: Any, rows: Any, width: Any, x: Any) -> Any:
        """Index at which the row of a table begins, for each instance."""
        found = np.vectorize(
            lambda first, count, at: row(array.flat, int(first), int(count), width, float(at)),
            otypes=[np.int64],
        )
        return found(self.integer(place), self.integer(rows), _value(x))

    def atan2(self, y: Any, x: Any) -> "Many":
        """Angle of the point (x, y)."""
        return Many(np.arctan2(_value(y), _value(x)))


def _function(name: str) -> None:
    function = getattr(np, name)
    short = name.replace("arc", "a")
    setattr(_Functions, short, lambda self, x: Many(function(_value(x))))


for _name in ("sqrt", "sin", "cos", "tan", "arctan", "sinh", "cosh", "tanh", "arcsin", "arccos",
              "exp", "log", "floor"):  # fmt: skip
    _function(_name)


class Condition:
    """Truth values of many instances."""

    __slots__ = ("value",)
    __array_ufunc__ = None
    tracer = _Functions()

    def __init__(self, value: Any) -> None:
        self.value = value

    def __invert__(self) -> "Condition":
        return Condition(~self.value)


#: Of all comparisons by order since ``comparisons`` began, their truth values.
_recorded: ContextVar[list[Any] | None] = ContextVar("recorded", default=None)


@contextmanager
def comparisons() -> Iterator[list[Any]]:
    """Truth values of the comparisons by order that are made here, one array for each."""
    found: list[Any] = []
    token = _recorded.set(found)
    try:
        yield found
    finally:
        _recorded.reset(token)


class Many:
    """A number of each of m instances, (m, 1), or (1, 1) where it is the same for all."""

    __slots__ = ("value",)
    __hash__ = None  # type: ignore[assignment]
    tracer = Condition.tracer

    def __init__(self, value: Any) -> None:
        self.value = value

    def __neg__(self) -> "Many":
        return Many(-self.value)

    def __pos__(self) -> "Many":
        return self

    def __abs__(self) -> "Many":
        return Many(np.abs(self.value))

    def __bool__(self) -> bool:
        raise TypeError("branches on a number; use where(condition, a, b)")

    def rint(self) -> "Many":
        """The nearest integer, for ``numpy.rint``."""
        return Many(np.rint(self.value))

    @property
    def real(self) -> "Many":
        """The number itself: conditions of complex numbers compare real parts."""
        return self


def _value(x: Any) -> Any:
    if isinstance(x, Many | Condition):
        return x.value
    return x if isinstance(x, np.ndarray | bool | np.bool_) else np.float64(x)


def _operation(name: str, made: type) -> tuple[Callable[..., Any], Callable[..., Any]]:
    operation = getattr(operator, name)

    def method(self: Any, other: Any) -> Any:
        return made(operation(self.value, _value(other)))

    def reflected(self: Any, other: Any) -> Any:
        return made(operation(_value(other), self.value))

    return method, reflected


def _comparison(name: str) -> Callable[..., Condition]:
    compare, is_order = getattr(operator, name), name not in ("eq", "ne")

    def method(self: Many, other: Any) -> Condition:
        holds = compare(self.value, _value(other))
        if is_order and (recorded := _recorded.get()) is not None:
            recorded.append(holds)
        return Condition(holds)

    return method


for _name in ("add", "sub", "mul", "truediv", "pow"):
    for _form, _method in zip(("__{}__", "__r{}__"), _operation(_name, Many), strict=True):
        setattr(Many, _form.format(_name), _method)
for _name in ("and", "or", "xor"):
    for _form, _method in zip(
        ("__{}__", "__r{}__"), _operation(f"__{_name}__", Condition), strict=True
    ):
        setattr(Condition, _form.format(_name), _method)
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Many, f"__{_name}__", _comparison(_name))
