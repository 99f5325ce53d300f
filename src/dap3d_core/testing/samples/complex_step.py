"""Complex numbers for derivatives by complex step, in place of real arguments of kernels.

f(x + i h) = f(x) + i h f'(x) - ..., with h = 1e-100: the imaginary part over h is the derivative to
rounding, without a difference of nearly equal numbers (Squire and Trapp, SIAM Review 40, 1998).
Branches are those of the real part.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

STEP = 1e-100


def _wrapped(name: str) -> Callable[..., Any]:
    operation = getattr(complex, name)

    def method(self: "Stepped", *others: Any) -> Any:
        try:
            result = operation(self, *others)
        except ZeroDivisionError:  # on a side of a branch that is not taken, as a rule
            result = complex(math.nan, math.nan)
        return result if result is NotImplemented else type(self)(result)

    method.__name__ = name
    return method


def _by_real_part(name: str) -> Any:
    compare = getattr(operator, name)
    # of numpy, whose ~ is a negation
    return lambda self, other: np.bool_(compare(self.real, _real(other)))


class Stepped(complex):
    """A number and, in its imaginary part, STEP times its derivative."""

    __slots__ = ()
    __hash__ = complex.__hash__
    __array_ufunc__ = None  # numpy's floats leave the operation to this class

    __add__, __radd__ = _wrapped("__add__"), _wrapped("__radd__")
    __sub__, __rsub__ = _wrapped("__sub__"), _wrapped("__rsub__")
    __mul__, __rmul__ = _wrapped("__mul__"), _wrapped("__rmul__")
    __truediv__, __rtruediv__ = _wrapped("__truediv__"), _wrapped("__rtruediv__")
    __pow__, __rpow__ = _wrapped("__pow__"), _wrapped("__rpow__")
    __neg__, __pos__ = _wrapped("__neg__"), _wrapped("__pos__")

    @property
    def slope(self) -> float:
        """The derivative."""
        return self.imag / STEP

    def __bool__(self) -> bool:
        return self.real != 0.0

    __eq__, __ne__ = _by_real_part("__eq__"), _by_real_part("__ne__")
    __lt__, __le__ = _by_real_part("__lt__"), _by_real_part("__le__")
    __gt__, __ge__ = _by_real_part("__gt__"), _by_real_part("__ge__")

    def __abs__(self) -> Any:
        return -self if self.real < 0.0 else self

    def __floor__(self) -> int:
        return math.floor(self.real)

    def __ceil__(self) -> int:
        return math.ceil(self.real)

    def __trunc__(self) -> int:
        return math.trunc(self.real)

    def __round__(self, digits: int | None = None) -> Any:
        return round(self.real, digits)

    def __floordiv__(self, other: Any) -> float:
        return float(self.real // _real(other))

    def __rfloordiv__(self, other: Any) -> float:
        return float(_real(other) // self.real)

    def __mod__(self, other: Any) -> Any:
        return self - other * (self // other)

    def __rmod__(self, other: Any) -> Any:
        return other - self * (other // self)


def _real(x: Any) -> Any:
    return getattr(x, "real", x)
