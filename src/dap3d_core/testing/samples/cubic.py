"""Samples of functions of an argument, and of two."""

from typing import Any

from dap3d_core.interface import Function, number


class Cubic(Function):
    """f = a + b x + c x^2 + d x^3."""

    keyword = "cubic"
    a: float = number(doc="coefficient of x^0")
    b: float = number(doc="of x^1")
    c: float = number(doc="of x^2")
    d: float = number(doc="of x^3")

    def value(x: Any, a: Any, b: Any, c: Any, d: Any) -> Any:  # noqa: D102, N805
        f = a + x * (b + x * (c + x * d))
        return f, b + x * (2.0 * c + 3.0 * x * d), 2.0 * c + 6.0 * x * d, 6.0 * d


class CubicOfTwo(Function):
    """f = a + b x + c y + x y (d x + e y), with no two derivatives alike."""

    keyword, arguments = "cubic-of-two", 2
    a: float = number(doc="constant")
    b: float = number(doc="coefficient of x")
    c: float = number(doc="of y")
    d: float = number(doc="of x^2 y")
    e: float = number(doc="of x y^2")

    def value(x: Any, y: Any, a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:  # noqa: D102, N805
        f = a + b * x + c * y + x * y * (d * x + e * y)
        f_x, f_y = b + y * (2.0 * d * x + e * y), c + x * (d * x + 2.0 * e * y)
        return f, f_x, f_y, 2.0 * d * y, 2.0 * (d * x + e * y), 2.0 * e * x
