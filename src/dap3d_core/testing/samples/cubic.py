"""A cubic, the sample of a function of an argument."""

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
