"""Rates of the values of kernels: numbers that carry their derivatives in time with them.

A kernel of positions runs as it is traced, on pairs of a number and its rate (forward-mode
differentiation; Griewank and Walther, Evaluating Derivatives, 2008, ch. 3), so that what it returns
has its rate. Branches are those of the values.
"""

# Kernels take numbers of any kind: floats, and symbols of a trace.
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math
import operator
from collections.abc import Callable
from typing import Any

from dap3d_core.kernels import (
    acos,
    asin,
    atan,
    atan2,
    cos,
    exp,
    log,
    matmul,
    sin,
    skew,
    sqrt,
    tan,
    where,
)


class _RateFunctions:
    """The functions of kernels for numbers with rates."""

    def where(self, condition, a, b):
        """``a`` where the condition holds, else ``b``."""
        (v, g), (w, h) = _parts(a), _parts(b)
        return Rate(where(condition.value, v, w), where(condition.value, g, h))

    def atan2(self, y, x):
        """The angle of a point (x, y)."""
        (v, g), (w, h) = _parts(y), _parts(x)
        return Rate(atan2(v, w), (w * g - v * h) / (v * v + w * w))


#: Functions of one number x, and the rate of their value y from that of x, g.
_CHAIN = {
    sqrt: lambda x, g, y: 0.5 * g / y,
    sin: lambda x, g, y: cos(x) * g,
    cos: lambda x, g, y: -sin(x) * g,
    tan: lambda x, g, y: (1.0 + y * y) * g,
    atan: lambda x, g, y: g / (1.0 + x * x),
    asin: lambda x, g, y: g / sqrt(1.0 - x * x),
    acos: lambda x, g, y: -g / sqrt(1.0 - x * x),
    exp: lambda x, g, y: y * g,
    log: lambda x, g, y: g / x,
}


def _add(function, chain):
    def with_rate(self, x):
        value = function(x.value)
        return Rate(value, chain(x.value, x.rate, value))

    setattr(_RateFunctions, function.__name__, with_rate)


for _function, _rate in _CHAIN.items():
    _add(_function, _rate)


class _Condition:
    """A truth value of a number with a rate."""

    __slots__ = ("value",)
    tracer = _RateFunctions()

    def __init__(self, value):
        self.value = value

    def __and__(self, other):
        return _Condition(self.value & other.value)

    def __or__(self, other):
        return _Condition(self.value | other.value)


class Rate:
    """A number and its rate."""

    __slots__ = ("rate", "value")
    __hash__ = None  # type: ignore[assignment]
    tracer = _RateFunctions()

    def __init__(self, value, rate):
        self.value, self.rate = value, rate

    @property
    def plain(self):
        """The number without its rate."""
        return self.value

    @staticmethod
    def constant(value):
        """A number that does not change."""
        return Rate(value, 0.0)

    def __add__(self, other):
        v, g = _parts(other)
        return Rate(self.value + v, self.rate + g)

    def __sub__(self, other):
        v, g = _parts(other)
        return Rate(self.value - v, self.rate - g)

    def __rsub__(self, other):
        v, g = _parts(other)
        return Rate(v - self.value, g - self.rate)

    def __mul__(self, other):
        v, g = _parts(other)
        return Rate(self.value * v, self.rate * v + self.value * g)

    def __truediv__(self, other):
        v, g = _parts(other)
        value = self.value / v
        return Rate(value, (self.rate - value * g) / v)

    def __rtruediv__(self, other):
        v, g = _parts(other)
        value = v / self.value
        return Rate(value, (g - value * self.rate) / self.value)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return Rate(-self.value, -self.rate)

    def __pow__(self, n):
        return Rate(self.value**n, n * self.value ** (n - 1) * self.rate)


def _compare(operation):
    return lambda self, other: _Condition(operation(self.value, _parts(other)[0]))


for _name in ("lt", "le", "gt", "ge"):
    setattr(Rate, f"__{_name}__", _compare(getattr(operator, _name)))


def rate_of(function: Callable[..., Any], values: tuple[Any, ...], rates: tuple[Any, ...]) -> Any:
    """The rate of what a function of these values returns; a rate of None: a constant."""
    return _rates(function(*(_paired(v, g) for v, g in zip(values, rates, strict=True))))


def turned(w, A):
    """The rate of a rotation matrix at an angular velocity w, global axes."""
    return matmul(skew(w), A)


def _paired(value: Any, rate: Any) -> Any:
    if callable(value):
        return _function_of_rates(value, rate)
    if isinstance(value, tuple):
        rates = (None,) * len(value) if rate is None else rate
        return tuple(_paired(v, g) for v, g in zip(value, rates, strict=True))
    return Rate(value, 0.0 if rate is None else rate)


def _function_of_rates(f: Callable[..., Any], slopes: Any) -> Callable[..., Any]:
    """A function of the scene, for numbers with rates; slopes: its partial derivatives."""

    def function(*x: Any) -> Any:
        at, changes = zip(*map(_parts, x), strict=True)
        terms = [slope(*at) * g for slope, g in zip(slopes, changes, strict=True)] if slopes else []
        return Rate(f(*at), sum(terms[1:], terms[0]) if terms else math.nan)

    return function


def _rates(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_rates(v) for v in value)
    return _parts(value)[1]


def _parts(x: Any) -> tuple[Any, Any]:
    return (x.value, x.rate) if isinstance(x, Rate) else (x, 0.0)
