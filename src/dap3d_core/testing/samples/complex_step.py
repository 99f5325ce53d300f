"""Complex numbers for derivatives by complex step, which kernels take for real ones.

f(x + i h) = f(x) + i h f'(x) - ..., with h = 1e-100: the imaginary part over h is the derivative to
rounding, without a difference of nearly equal numbers (Squire and Trapp, SIAM Review 40, 1998).
Branches are those of the real part.
"""

import math
from collections.abc import Callable
from typing import Any

STEP = 1e-100


def _wrapped(name: str) -> Callable[..., Any]:
    operation = getattr(complex, name)

    def method(self: "Stepped", *others: Any) -> Any:
        found = operation(self, *others)
        return found if found is NotImplemented else type(self)(found)

    method.__name__ = name
    return method


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

    def __eq__(self, other: Any) -> bool:
        return bool(self.real == _real(other))

    def __ne__(self, other: Any) -> bool:
        return bool(self.real != _real(other))

    def __lt__(self, other: Any) -> bool:
        return bool(self.real < _real(other))

    def __le__(self, other: Any) -> bool:
        return bool(self.real <= _real(other))

    def __gt__(self, other: Any) -> bool:
        return bool(self.real > _real(other))

    def __ge__(self, other: Any) -> bool:
        return bool(self.real >= _real(other))

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
