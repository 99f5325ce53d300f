"""Constant force in ground axes."""

from dap3d_core.interface import Body, Force, Point, body, function, hookimpl, input_, point, vec3
from dap3d_core.kernels import cross, dot, scale

interface_version = 1


class GlobalForce(Force):
    """A force f at P_i of body i, constant in ground axes (manual: ``f``).

    Without P_i it acts at the mass centre. force = f, moment = s_i x f, energy = -f . r_Pi. A
    function of time or an input is a factor of f; there is no energy then.
    """

    keyword = "f"
    synonyms = ("force",)
    actuates = "f"
    body_i: Body = body(default=None, doc="the body it acts on")
    P_i: Point = point(default=None, doc="where it acts; the mass centre when left out")
    f: tuple = vec3(unit="N", in_ground=True, doc="components in ground axes")
    function: str = function(doc="factor of f, a function of time")
    input: str = input_(instead_of="function", doc="factor of f, an input")

    def wrench(f, s_P_i):
        return ((f, cross(s_P_i, f)),)

    def energy(f, r_P_i):
        return -dot(f, r_P_i)


class OfTime(GlobalForce, function=True):
    """The force times a function of time."""

    energy = None

    def wrench(f, function, s_P_i):
        F = scale(function, f)
        return ((F, cross(s_P_i, F)),)


class Actuated(GlobalForce, input=True):
    """The force times an input."""

    energy = None

    def wrench(f, input, s_P_i):
        F = scale(input, f)
        return ((F, cross(s_P_i, F)),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GlobalForce]
