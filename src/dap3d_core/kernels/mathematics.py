"""Scalar mathematics for kernels: one name for floats, complex numbers, sympy and compiled code.

Outside their domain the functions give NaN, as compiled code does; a run stops at the first NaN and
names its source.
"""

import cmath
import math

from numba.extending import overload

from dap3d_core.kernels.inline import INLINE_OPTIONS


def _symbolic(x):
    return hasattr(x, "free_symbols")


def _sympy():
    import sympy  # only reached with a sympy argument, so it is there

    return sympy


def _like(x, value):
    """A value as the kind of number that x is.

    numpy's floats divide by zero as compiled code does; the complex numbers of derivative checks
    are compared by their real parts.
    """
    return type(x)(value) if isinstance(x, (float, complex)) else value


def _generic(name):
    real, other = getattr(math, name), getattr(cmath, name)

    def function(x):
        if isinstance(x, complex):
            return _like(x, other(x))
        if _symbolic(x):
            return getattr(_sympy(), name)(x)
        try:
            return _like(x, real(x))
        except ValueError:
            return _like(x, math.nan)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"{name}(x) of a number (float, complex or sympy)."

    @overload(function, jit_options=INLINE_OPTIONS)
    def compiled(x):
        return lambda x: real(x)

    return function


sqrt = _generic("sqrt")
sin = _generic("sin")
cos = _generic("cos")
tanh = _generic("tanh")


def atan2(y, x):
    """Angle of the point (x, y) in (-pi, pi]; complex: its first-order continuation."""
    if isinstance(y, complex) or isinstance(x, complex):
        square = x.real**2 + y.real**2
        slope = (x.real * y.imag - y.real * x.imag) / square if square else math.nan
        return _like(x + y, complex(math.atan2(y.real, x.real), slope))
    if _symbolic(y) or _symbolic(x):
        return _sympy().atan2(y, x)
    return _like(x + y, math.atan2(y, x))


@overload(atan2, jit_options=INLINE_OPTIONS)
def _compiled_atan2(y, x):
    return lambda y, x: math.atan2(y, x)


def where(condition, a, b):
    """``a`` where the condition holds, else ``b``: a kernel's branch. Both are evaluated."""
    if _symbolic(condition):
        sympy = _sympy()
        return sympy.Piecewise((a, condition), (b, True))
    return a if condition else b


@overload(where, jit_options=INLINE_OPTIONS)
def _compiled_where(condition, a, b):
    return lambda condition, a, b: a if condition else b
