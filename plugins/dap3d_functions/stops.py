"""Two elastic stops with free play between them."""

from dap3d_core.interface import Function, hookimpl, number
from dap3d_core.kernels import where

interface_version = 1


class Stops(Function):
    """Zero between two stops, and a spring of stiffness k beyond each.

        f = k (x - lower) for x < lower,  k (x - upper) for x > upper,  0 between

    As the function of a spring, ``ptp``, ``rot_sda`` or ``tran_sda``, it keeps a length or an angle
    between limits: what comes in leaves with the same speed. Its derivative jumps at both stops.
    """

    keyword = "stops"
    lower: float = number(doc="where the lower stop begins")
    upper: float = number(doc="where the upper stop begins")
    k: float = number(positive=True, doc="stiffness of the stops")

    def prepare(self, bodies):
        if not self.upper >= self.lower:
            raise ValueError(f"upper = {self.upper:g} must not lie below lower = {self.lower:g}")
        return {}

    def breaks(self):
        return self.lower, self.upper

    def value(x, lower, upper, k):
        below, above = x < lower, x > upper
        f = where(below, k * (x - lower), where(above, k * (x - upper), 0.0))
        return f, where(below, k, where(above, k, 0.0)), 0.0, 0.0


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Stops]
