"""Constant force in body axes."""

from dap3d_core.interface import (
    Body,
    Force,
    Point,
    body,
    function,
    hookimpl,
    input_,
    number,
    point,
    vec3,
)
from dap3d_core.kernels import cross, rotate, scale
from dap3d_forces.bounds import bounds, within

interface_version = 1


class BodyForce(Force):
    """A force at P_i of body i, constant in its axes (manual: ``fp``).

    Without P_i it acts at the mass centre. force = A_i fp, moment = s_i x A_i fp. A function of
    time or an input is a factor of fp.
    """

    keyword = "fp"
    actuates = "fp"
    body_i: Body = body(default=None, doc="the body it acts on")
    P_i: Point = point(default=None, doc="where it acts; the mass centre when left out")
    fp: tuple = vec3(unit="N", doc="components in body axes")
    function: str = function(doc="factor of fp, a function of time")
    input: str = input_(instead_of="function", doc="factor of fp, an input")
    input_min: float = number(None, doc="least factor that an input gives, if any")
    input_max: float = number(None, doc="greatest factor that it gives, if any")

    def prepare(self, bodies):
        return bounds(self, "input")

    def wrench(A_i, fp, s_P_i):
        F = rotate(A_i, fp)
        return ((F, cross(s_P_i, F)),)


class OfTime(BodyForce, function=True):
    """The force times a function of time."""

    def wrench(A_i, fp, f, s_P_i):
        F = rotate(A_i, scale(f, fp))
        return ((F, cross(s_P_i, F)),)


class Unbounded(BodyForce, input=True, input_min=False, input_max=False):
    """The force times an input."""

    def wrench(A_i, fp, input, s_P_i):
        F = rotate(A_i, scale(input, fp))
        return ((F, cross(s_P_i, F)),)


class Actuated(BodyForce, input=True):
    """The force times an input within its bounds."""

    def wrench(A_i, fp, input, input_min, input_max, s_P_i):
        F = rotate(A_i, scale(within(input, input_min, input_max), fp))
        return ((F, cross(s_P_i, F)),)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BodyForce]
