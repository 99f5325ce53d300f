"""Constant moment in body axes."""

from dap3d_core.interface import Body, Force, body, function, hookimpl, input_, number, vec3
from dap3d_core.kernels import rotate, scale
from dap3d_forces.bounds import bounds, within

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class BodyMoment(Force):
    """A moment A_i np on body i, constant in its axes (manual: ``np``).

    A function of time or an input is a factor of np.
    """

    keyword = "np"
    actuates = "np"
    body_i: Body = body(doc="the body it acts on")
    np: tuple = vec3(unit="N m", doc="components in body axes")
    function: str = function(doc="factor of np, a function of time")
    input: str = input_(instead_of="function", doc="factor of np, an input")
    input_min: float = number(None, doc="least factor that an input gives, if any")
    input_max: float = number(None, doc="greatest factor that it gives, if any")

    def prepare(self, bodies):
        return bounds(self, "input")

    def wrench(A_i, np):
        return ((ZERO, rotate(A_i, np)),)


class OfTime(BodyMoment, function=True):
    """The moment times a function of time."""

    def wrench(A_i, np, f):
        return ((ZERO, rotate(A_i, scale(f, np))),)


class Unbounded(BodyMoment, input=True, input_min=False, input_max=False):
    """The moment times an input."""

    def wrench(A_i, np, input):
        return ((ZERO, rotate(A_i, scale(input, np))),)


class Actuated(BodyMoment, input=True):
    """The moment times an input within its bounds."""

    def wrench(A_i, np, input, input_min, input_max):
        return ((ZERO, rotate(A_i, scale(within(input, input_min, input_max), np))),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BodyMoment]
