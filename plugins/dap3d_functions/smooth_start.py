"""Function of type d: a smooth start into a constant slope."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import where
from dap3d_functions.step import Step

interface_version = 1


class SmoothStart(Function):
    """From rest at f_start into the slope fp_end, which is kept (manual: type ``d``).

    With D = x_end - x_start, u = (x - x_start) / D and v = fp_end:

        f' = v (10 u^3 - 15 u^4 + 6 u^5),  0 before x_start and v after x_end
        f  = f_start + v D (5/2 u^4 - 3 u^5 + u^6),  f_start + v D / 2 + v (x - x_end) after
    """

    keyword = "d"
    x_start: float = number(default=0.0, doc="where the slope begins to grow")
    x_end: float = number(default=1.0, doc="from where on it is constant")
    f_start: float = number(default=0.0, doc="value before")
    fp_end: float = number(default=0.0, doc="slope after")

    prepare, breaks = Step.prepare, Step.breaks

    def value(x, x_start, x_end, f_start, fp_end):
        D = x_end - x_start
        u = (x - x_start) / D
        beyond = where(u > 1.0, x - x_end, 0.0)
        u = where(u < 0.0, 0.0, where(u > 1.0, 1.0, u))
        v = u * (1.0 - u)
        f = f_start + fp_end * (D * u * u * u * u * (2.5 + u * (u - 3.0)) + beyond)
        f_dot = fp_end * u * u * u * (10.0 + u * (6.0 * u - 15.0))
        f_ddot = 30.0 * fp_end / D * v * v
        f_dddot = 60.0 * fp_end / (D * D) * v * (1.0 - 2.0 * u)
        return f, f_dot, f_ddot, f_dddot


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [SmoothStart]
