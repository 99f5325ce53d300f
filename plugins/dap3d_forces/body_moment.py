"""Constant moment in body axes."""

from dap3d_core.interface import Body, Force, body, function, hookimpl, input_, vec3
from dap3d_core.kernels import rotate, scale

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class BodyMoment(Force):
    """A moment A_i np on body i, constant in its axes (manual: ``np``; spec 6).

    A function of time or an input is a factor of np.
    """

    keyword = "np"
    actuates = "np"
    body_i: Body = body(doc="the body it acts on")
    np: tuple = vec3(unit="N m", doc="components in body axes")
    function: str = function(doc="factor of np, a function of time")
    input: str = input_(instead_of="function", doc="factor of np, an input")

    def wrench(A_i, np):
        return ((ZERO, rotate(A_i, np)),)


class OfTime(BodyMoment, function=True):
    """The moment times a function of time."""

    def wrench(A_i, np, f):
        return ((ZERO, rotate(A_i, scale(f, np))),)


class Actuated(BodyMoment, input=True):
    """The moment times an input."""

    def wrench(A_i, np, input):
        return ((ZERO, rotate(A_i, scale(input, np))),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BodyMoment]
