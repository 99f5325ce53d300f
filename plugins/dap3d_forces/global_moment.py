"""Constant moment in ground axes."""

from dap3d_core.interface import Body, Force, body, function, hookimpl, input_, vec3
from dap3d_core.kernels import scale

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class GlobalMoment(Force):
    """A moment n on body i, constant in ground axes (manual: ``n``).

    A function of time or an input is a factor of n.
    """

    keyword = "n"
    synonyms = ("torque", "moment")
    actuates = "n"
    body_i: Body = body(doc="the body it acts on")
    n: tuple = vec3(unit="N m", in_ground=True, doc="components in ground axes")
    function: str = function(doc="factor of n, a function of time")
    input: str = input_(instead_of="function", doc="factor of n, an input")

    def wrench(n):
        return ((ZERO, n),)


class OfTime(GlobalMoment, function=True):
    """The moment times a function of time."""

    def wrench(n, f):
        return ((ZERO, scale(f, n)),)


class Actuated(GlobalMoment, input=True):
    """The moment times an input."""

    def wrench(n, input):
        return ((ZERO, scale(input, n)),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GlobalMoment]
