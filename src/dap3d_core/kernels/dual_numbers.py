"""Dual numbers for kernels: values of many instances, with derivatives in many directions.

A dual number holds a value v of each of m instances and its derivatives g in d directions; every
operation carries both on (forward-mode differentiation; Griewank and Walther, Evaluating
Derivatives, 2008, ch. 3). Derivatives are exact to rounding, branches those of the values. The
functions of scalar_math.py take dual numbers through the entry point of traced symbols: an
attribute ``tracer`` that has their functions.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np


class DualFunctions:
    """The functions of kernels for dual numbers."""

    def where(self, condition, a, b):
        """``a`` where the condition holds, else ``b``; tuples item by item."""
        if isinstance(a, tuple) and isinstance(b, tuple):
            return tuple(self.where(condition, x, y) for x, y in zip(a, b, strict=True))
        chosen = condition.value
        if isinstance(a, Condition) or isinstance(b, Condition):
            return Condition(np.where(chosen, _truth(a), _truth(b)))
        (v, g), (w, h) = _parts(a), _parts(b)
        if g is None and h is None:
            return Dual(np.where(chosen, v, w))
        g, h = (0.0 if part is None else part for part in (g, h))
        return Dual(np.where(chosen, v, w), np.where(chosen, g, h))

    def integer(self, x):
        """The whole numbers of a dual number without derivatives, as indices."""
        return np.asarray(_parts(x)[0]).astype(np.int64)

    def row_of(self, row, array, place, rows, width, x):
        """Index at which the row of a table begins, for each instance."""
        starts, counts, arguments = np.broadcast_arrays(
            self.integer(place), self.integer(rows), _parts(x)[0]
        )
        found = [
            row(array.flat, int(first), int(count), width, float(argument))
            for first, count, argument in zip(
                starts.ravel(), counts.ravel(), arguments.ravel(), strict=True
            )
        ]
        return np.array(found, dtype=np.int64)

    def atan2(self, y, x):
        """Angle of the point (x, y)."""
        (v, g), (w, h) = _parts(y), _parts(x)
        square = v * v + w * w
        return Dual(np.arctan2(v, w), _sum(_scaled(w / square, g), _scaled(-v / square, h)))

    def floor(self, x):
        """The largest integer not above x."""
        return Dual(np.floor(x.value))


def _function(name: str, slope: Callable[[Any, Any], Any]) -> None:
    function = getattr(np, name)

    def apply(self, x):
        value = function(x.value)
        return Dual(value, None if x.slope is None else slope(x.value, value) * x.slope)

    short = name.replace("arc", "a")
    apply.__name__, apply.__doc__ = short, f"{short}(x)."
    setattr(DualFunctions, short, apply)


for _name, _slope in {
    "sqrt": lambda x, f: 0.5 / f,
    "sin": lambda x, f: np.cos(x),
    "cos": lambda x, f: -np.sin(x),
    "tan": lambda x, f: 1.0 + f * f,
    "arctan": lambda x, f: 1.0 / (1.0 + x * x),
    "sinh": lambda x, f: np.cosh(x),
    "cosh": lambda x, f: np.sinh(x),
    "tanh": lambda x, f: 1.0 - f * f,
    "arcsin": lambda x, f: 1.0 / np.sqrt(1.0 - x * x),
    "arccos": lambda x, f: -1.0 / np.sqrt(1.0 - x * x),
    "exp": lambda x, f: f,
    "log": lambda x, f: 1.0 / x,
}.items():
    _function(_name, _slope)

_FUNCTIONS = DualFunctions()


class Condition:
    """Truth values of many instances."""

    __slots__ = ("value",)
    __array_ufunc__ = None
    tracer = _FUNCTIONS

    def __init__(self, value):
        self.value = value

    def __and__(self, other):
        return Condition(self.value & _truth(other))

    def __or__(self, other):
        return Condition(self.value | _truth(other))

    def __xor__(self, other):
        return Condition(self.value ^ _truth(other))

    def __invert__(self):
        return Condition(~self.value)

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__


#: Of all comparisons by order since ``comparisons`` began, their truth values.
_recorded: ContextVar[list[Any] | None] = ContextVar("recorded", default=None)


@contextmanager
def comparisons() -> Iterator[list[Any]]:
    """Truth values of the comparisons by order that are made here, one array for each."""
    token = _recorded.set([])
    try:
        yield _recorded.get()
    finally:
        _recorded.reset(token)


def _comparison(name: str) -> Callable[..., Condition]:
    compare, is_order = getattr(np, name), name not in ("equal", "not_equal")

    def method(self, other):
        holds = compare(self.value, _parts(other)[0])
        if is_order and (recorded := _recorded.get()) is not None:
            recorded.append(holds)
        return Condition(holds)

    return method


class Dual:
    """A number of each of m instances with its derivatives.

    Attributes:
        value: (m, 1), or (1, 1) where it is the same for all.
        slope: (m, d) derivatives; None where there are none.
    """

    __slots__ = ("slope", "value")
    __hash__ = None
    tracer = _FUNCTIONS

    def __init__(self, value, slope=None):
        self.value, self.slope = value, slope

    def __add__(self, other):
        v, g = _parts(other)
        return Dual(self.value + v, _sum(self.slope, g))

    def __sub__(self, other):
        v, g = _parts(other)
        return Dual(self.value - v, _sum(self.slope, _scaled(-1.0, g)))

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        v, g = _parts(other)
        return Dual(self.value * v, _sum(_scaled(v, self.slope), _scaled(self.value, g)))

    def __truediv__(self, other):
        v, g = _parts(other)
        value = self.value / v
        return Dual(value, _sum(_scaled(1.0 / v, self.slope), _scaled(-value / v, g)))

    def __rtruediv__(self, other):
        return Dual(_parts(other)[0]) / self

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return Dual(-self.value, _scaled(-1.0, self.slope))

    def __pos__(self):
        return self

    def __abs__(self):
        return self.tracer.where(self < 0.0, -self, self)

    def __pow__(self, n):
        v, g = _parts(n)
        value = self.value**v
        base = np.where(v == 0.0, 1.0, self.value)  # the slope of x^0 is 0, also at 0
        own = _scaled(v * base ** (v - 1.0), self.slope)
        if g is None:
            return Dual(value, own)
        logarithm = np.log(np.where(g == 0.0, 1.0, self.value))
        return Dual(value, _sum(own, value * logarithm * g))

    def __rpow__(self, x):
        return Dual(np.asarray(float(x))) ** self

    __lt__, __le__ = _comparison("less"), _comparison("less_equal")
    __gt__, __ge__ = _comparison("greater"), _comparison("greater_equal")
    __eq__, __ne__ = _comparison("equal"), _comparison("not_equal")

    def __bool__(self):
        raise TypeError("branches on a number; use where(condition, a, b)")

    def rint(self):
        """The nearest integer, for ``numpy.rint``."""
        return Dual(np.rint(self.value))

    @property
    def real(self):
        """The number itself: conditions of complex numbers compare real parts."""
        return self


def _parts(x):
    """Value and derivatives of a number."""
    if isinstance(x, Dual):
        return x.value, x.slope
    return x if isinstance(x, np.ndarray) else np.float64(x), None


def _truth(x):
    return x.value if isinstance(x, Condition) else bool(x)


def _scaled(factor, slope):
    return None if slope is None else factor * slope


def _sum(a, b):
    if a is None or b is None:
        return b if a is None else a
    return a + b
