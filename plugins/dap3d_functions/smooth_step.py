"""Function of type b: a smooth transition between two values."""

from dap3d_core.interface import hookimpl
from dap3d_core.kernels import where
from dap3d_functions.step import Step

interface_version = 1


class SmoothStep(Step):
    """From f_start to f_end, at rest and without curvature at both ends (manual: type ``b``).

    With D = x_end - x_start, u = (x - x_start) / D and h = f_end - f_start:

        f = f_start + h (10 u^3 - 15 u^4 + 6 u^5),  constant before x_start and after x_end
    """

    keyword = "b"
    synonyms = ("smoothstep", "ramp")

    def value(x, x_start, x_end, f_start, f_end):
        D, h = x_end - x_start, f_end - f_start
        u = (x - x_start) / D
        inside = where(u < 0.0, 0.0, where(u > 1.0, 0.0, 1.0))
        u = where(u < 0.0, 0.0, where(u > 1.0, 1.0, u))
        v = u * (1.0 - u)
        f = f_start + h * u * u * u * (10.0 + u * (6.0 * u - 15.0))
        f_dot = 30.0 * h / D * v * v
        f_ddot = 60.0 * h / (D * D) * v * (1.0 - 2.0 * u)
        f_dddot = inside * 60.0 * h / (D * D * D) * (1.0 - 6.0 * v)
        return f, f_dot, f_ddot, f_dddot


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [SmoothStep]
