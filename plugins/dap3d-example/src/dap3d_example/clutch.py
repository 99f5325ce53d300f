"""Clutch between two shafts."""

from dap3d_core.interface import Body, Force, Vector, body, hookimpl, number, vector
from dap3d_core.kernels import dot, neg, scale, sub, where

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Clutch(Force):
    """At t_on it locks bodies i and j together, as far as they turn about the axis a_j of body j.

    There an impulsive moment makes the relative speed w = a_j . (w_i - w_j) zero, with what the
    joints of the shafts hold (dap3d's page on jumps). From then on it carries the moment by a
    stiff shaft, whose twist is a state that begins at zero:

        twist_dot = w,  T = -(k twist + c w),  moment T a_j on body i, its opposite on body j
    """

    keyword = "clutch"
    states = ("twist",)
    body_i: Body = body(doc="the one shaft")
    a_j: Vector = vector(doc="axis, on the other shaft")
    t_on: float = number(unit="s", doc="when it engages")
    k: float = number(unit="N m/rad", positive=True, doc="stiffness of the engaged clutch")
    c: float = number(0.0, unit="N m s/rad", minimum=0.0, doc="damping of the engaged clutch")

    def switch(t, t_on):
        return t - t_on

    def J(a_j):
        return ((*ZERO, *a_j),), ((*ZERO, *neg(a_j)),)

    def impulse(Jv, crossing):
        return where(crossing > 0.0, -Jv, 0.0)

    def rate(t, t_on, a_j, w_i, w_j):
        return where(t < t_on, 0.0, dot(a_j, sub(w_i, w_j)))

    def reset():
        return 0.0

    def wrench(t, t_on, a_j, w_i, w_j, twist, k, c):
        torque = where(t < t_on, 0.0, -k * twist - c * dot(a_j, sub(w_i, w_j)))
        moment = scale(torque, a_j)
        return (ZERO, moment), (ZERO, neg(moment))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Clutch]
