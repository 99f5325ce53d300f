"""Cycloidal rise of a cam."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import cos, sin, where

interface_version = 1

TURN = 6.283185307179586


class Cycloid(Function):
    """Rises from x_start to x_end with an acceleration of one sine: no jerk is infinite.

    Norton, Cam Design and Manufacturing Handbook, chapter 3. With w = x_end - x_start and
    u = (x - x_start) / w, kept in 0 to 1:

        f = rise (u - sin(2 pi u) / (2 pi))

    It dwells before and after, where f''' jumps from and to zero.
    """

    keyword = "cycloid"
    x_start: float = number(0.0, doc="where the rise begins")
    x_end: float = number(1.0, doc="where it ends")
    rise: float = number(1.0, doc="how far it goes")

    def prepare(self, bodies):
        if self.x_end <= self.x_start:
            raise ValueError(f"x_end, {self.x_end:g}, must be beyond x_start, {self.x_start:g}")
        return {}

    def breaks(self):
        """Both ends of the rise: no step passes over it."""
        return self.x_start, self.x_end

    def value(x, x_start, x_end, rise):
        w = x_end - x_start
        u = (x - x_start) / w
        a, h = TURN * u, where(u < 0.0, 0.0, where(u > 1.0, 0.0, rise))
        f = where(u > 1.0, rise, h * (u - sin(a) / TURN))
        third = TURN * TURN / w / w / w
        return f, h * (1.0 - cos(a)) / w, h * TURN * sin(a) / w / w, h * third * cos(a)


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Cycloid]
