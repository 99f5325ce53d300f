"""Constant force in ground axes."""

from dap3d_core.interface import Body, Force, Point, body, hookimpl, point, vec3
from dap3d_core.kernels import cross, dot

interface_version = 1


class GlobalForce(Force):
    """A force f at P_i of body i, constant in ground axes (manual: ``f``; spec 6).

    Without P_i it acts at the mass centre. force = f, moment = s_i x f, energy = -f . r_Pi
    """

    keyword = "f"
    actuates = "f"
    body_i: Body = body(default=None, doc="the body it acts on")
    P_i: Point = point(default=None, doc="where it acts; the mass centre when left out")
    f: tuple = vec3(unit="N", doc="components in ground axes")

    def wrench(f, s_P_i):
        return ((f, cross(s_P_i, f)),)

    def energy(f, r_P_i):
        return -dot(f, r_P_i)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [GlobalForce]
