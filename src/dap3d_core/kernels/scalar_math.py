"""Scalar mathematics for kernels: one name for floats, complex numbers, sympy and compiled code.

Outside their domain the functions give what IEEE arithmetic gives, as compiled code does; a run
stops at the first NaN and names its source.
"""

import cmath
import math
from collections.abc import Callable
from typing import Any

from dap3d_core.kernels.compiler.intrinsics import intrinsic


def _symbolic(x):
    return hasattr(x, "free_symbols") or hasattr(x, "tracer")


def _library(*numbers: Any) -> Any:
    """The functions for symbolic numbers: those of sympy, or of a trace."""
    for x in numbers:
        if hasattr(x, "tracer"):
            return x.tracer
    import sympy  # installed, as an argument is of sympy

    return sympy


def _like(x, value):
    """A value as a number of the type of x.

    numpy's floats divide by zero as compiled code does.
    """
    return type(x)(value) if isinstance(x, (float, complex)) else value


def _generic(name: str, outside: Callable[[float], float] = lambda x: math.nan) -> Any:
    real, other = getattr(math, name), getattr(cmath, name)

    @intrinsic(name)
    def function(x):
        if isinstance(x, complex):
            try:
                return _like(x, other(x))
            except (ValueError, OverflowError):
                return _like(x, complex(outside(x.real), math.nan))
        if _symbolic(x):
            return getattr(_library(x), name)(x)
        try:
            return _like(x, real(x))
        except (ValueError, OverflowError):
            return _like(x, outside(x))

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{name}(x) of a number (float, complex or sympy)."
    return function


sqrt = _generic("sqrt")
sin = _generic("sin")
cos = _generic("cos")
tan = _generic("tan")
atan = _generic("atan")
sinh = _generic("sinh", lambda x: math.copysign(math.inf, x))
cosh = _generic("cosh", lambda x: math.inf)
tanh = _generic("tanh")
asin = _generic("asin")
acos = _generic("acos")
exp = _generic("exp", lambda x: math.inf)
log = _generic("log", lambda x: -math.inf if x == 0.0 else math.nan)


@intrinsic("atan2")
def atan2(y, x):
    """Angle of the point (x, y) in (-pi, pi]; complex: its first-order continuation."""
    if isinstance(y, complex) or isinstance(x, complex):
        square = x.real * x.real + y.real * y.real
        slope = (x.real * y.imag - y.real * x.imag) / square if square else math.nan
        return _like(x + y, complex(math.atan2(y.real, x.real), slope))
    if _symbolic(y) or _symbolic(x):
        return _library(y, x).atan2(y, x)
    return _like(x + y, math.atan2(y, x))


@intrinsic("where")
def where(condition, a, b):
    """``a`` where the condition holds, else ``b``: a kernel's branch. Both are evaluated."""
    if hasattr(condition, "tracer"):
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(where(condition, x, y) for x, y in zip(a, b, strict=True))
        return condition.tracer.where(condition, a, b)
    if _symbolic(condition):
        sympy = _library()
        return sympy.Piecewise((a, condition), (b, True))
    return a if condition else b


def _order(x):
    """The real part of a number, by which complex numbers of derivative checks are compared."""
    return x.real if isinstance(x, complex) else x


def minimum(a, b):
    """The lesser of two numbers; the second one where they are not ordered."""
    return where(_order(a) < _order(b), a, b)


def maximum(a, b):
    """The greater of two numbers; the second one where they are not ordered."""
    return where(_order(a) > _order(b), a, b)


def abs(x):
    """The magnitude of a number; complex: its first-order continuation."""
    return where(_order(x) < 0.0, -x, x + 0.0)


def sign(x):
    """1 for a positive number, -1 for a negative one, 0 for zero and for NaN."""
    return where(_order(x) > 0.0, 1.0, where(_order(x) < 0.0, -1.0, 0.0))


def hypot(x, y):
    """The length of (x, y)."""
    return sqrt(x * x + y * y)


def floor(x):
    """The largest integer not above x, as a float."""
    if isinstance(x, complex):
        return _like(x, math.floor(x.real))
    if _symbolic(x):
        return _library(x).floor(x)
    return _like(x, math.floor(x)) if math.isfinite(x) else x


def mod(x, y):
    """What is left of x / y after whole multiples: x - y floor(x / y), of the sign of y."""
    return x - y * floor(x / y)


@intrinsic("with_slopes")
def with_slopes(x: float, source: float) -> float:
    """The number x; where code is differentiated (compiler/derivatives), with the derivatives of
    ``source``, for results of iterations that stop by their value. Those of a constant are zero.
    """
    return x


@intrinsic("slope")
def slope(x: float, k: int) -> float:
    """Derivative k of a number where code is differentiated, else zero: for iterations that stop
    by the derivatives of what they find. Values may not depend on it.
    """
    return 0.0


@intrinsic("slope_count")
def slope_count() -> int:
    """How many derivatives numbers have: none where code is not differentiated."""
    return 0


@intrinsic("is_differentiated")
def is_differentiated() -> bool:
    """True where code is differentiated: iterations then make one pass more, for derivatives."""
    return False


@intrinsic("values_alone")
def values_alone() -> bool:
    """First statement of functions that are differentiated as if nothing depended on parameters:
    of norms, which decide and are no part of the motion.
    """
    return False
