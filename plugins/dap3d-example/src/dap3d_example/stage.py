"""Stage of a rocket that fires off."""

from dap3d_core.interface import Force, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import cross, neg, scale, sub

interface_version = 1


class Stage(Force):
    """At t_fire an impulse parts two bodies, along d_i: P on body i at P_i, -P on body j there.

    The charge burns in no time: velocities jump, positions stay. Joints between the bodies, and to
    others, hold through it. Both impulses act at P_i, so that their moments balance.
    """

    keyword = "stage"
    P_i: Point = point(doc="where the charge acts, on the body that flies on")
    P_j: Point = point(doc="a point of the body that is left behind")
    d_i: Vector = vector(doc="direction of the impulse on body i")
    t_fire: float = number(unit="s", doc="when it fires")
    charge: float = number(unit="N s", doc="impulse")

    def switch(t, t_fire):
        return t - t_fire

    def impulse(s_P_i, r_P_i, r_j, d_i, charge):
        P = scale(charge, d_i)
        return (P, cross(s_P_i, P)), (neg(P), neg(cross(sub(r_P_i, r_j), P)))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Stage]
