"""Step function: a cubic transition between two values."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import where

interface_version = 1


class Step(Function):
    """From f_start to f_end on a cubic, at rest at both ends (STEP of other multibody programs).

    With D = x_end - x_start, u = (x - x_start) / D and h = f_end - f_start:

        f = f_start + h (3 u^2 - 2 u^3),  constant before x_start and after x_end

    Its second derivative jumps at both ends, and with it the acceleration of what it drives; that
    of type ``b`` does not.
    """

    keyword = "step"
    x_start: float = number(default=0.0, doc="where the transition begins")
    x_end: float = number(default=1.0, doc="where it ends")
    f_start: float = number(default=0.0, doc="value before")
    f_end: float = number(default=1.0, doc="value after")

    def prepare(self, bodies):
        if not self.x_end > self.x_start:
            raise ValueError(f"x_end = {self.x_end:g} must lie beyond x_start = {self.x_start:g}")
        return {}

    def breaks(self):
        return self.x_start, self.x_end

    def value(x, x_start, x_end, f_start, f_end):
        D, h = x_end - x_start, f_end - f_start
        u = (x - x_start) / D
        inside = where(u < 0.0, 0.0, where(u > 1.0, 0.0, 1.0))
        u = where(u < 0.0, 0.0, where(u > 1.0, 1.0, u))
        f = f_start + h * u * u * (3.0 - 2.0 * u)
        f_dot = 6.0 * h / D * u * (1.0 - u)
        f_ddot = inside * 6.0 * h / (D * D) * (1.0 - 2.0 * u)
        return f, f_dot, f_ddot, -inside * 12.0 * h / (D * D * D)


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Step]
