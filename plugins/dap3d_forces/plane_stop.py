"""Stop of a ball, or a point, at a plane."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Contact,
    Force,
    Point,
    Vector,
    choice,
    hookimpl,
    number,
    point,
    vector,
)
from dap3d_core.kernels import cross, dot, neg, scale, sub, where
from dap3d_forces.rebound import carried, rebound, reduced, stored

interface_version = 1


class PlaneStop(Force):
    """A ball of a radius about P_i at the plane through P_j with normal a_j, without friction.

    The gap is g = a_j . (r_P_i - r_P_j) - radius. Where it closes faster than v_rest an impulse
    along a_j makes g_dot of it -e g_dot, the joints of the bodies held (docs/how-to/jumps.md);
    slower contact is carried by a spring and damper, of stiffness k and of the damping ratio
    zeta, that pushes and does not pull. zeta is that of the mass ``m_c`` on the spring, by default
    of the two bodies alone. Without ``rebound`` all contact is carried. Without k the stop is
    rigid, a contact without friction (docs/concepts/contact.md): what rests at it stays there.
    """

    keyword = "plane_stop"
    synonyms = ("contact", "floor", "bumper")
    symbol = "plate"
    example: ClassVar[Mapping[str, str]] = {"k": "1e5"}
    unilateral = (0,)
    restitution = "e"
    P_i: Point = point(doc="centre of the ball")
    P_j: Point = point(default="ground.O", doc="a point of the plane")
    a_j: Vector = vector(default="ground.z", doc="normal of the plane, to the side of the ball")
    radius: float = number(default=0.0, unit="m", minimum=0.0, doc="of the ball")
    e: float = number(default=0.0, minimum=0.0, maximum=1.0, doc="coefficient of restitution")
    k: float = number(
        None, unit="N/m", positive=True, doc="stiffness of contact at rest; rigid without it"
    )
    zeta: float = number(default=1.0, minimum=0.0, doc="damping ratio of contact at rest")
    v_rest: float = number(
        default=1e-3, unit="m/s", minimum=0.0, doc="speed below which contact does not rebound"
    )
    m_c: float = number(default=0.0, unit="kg", minimum=0.0,
                        doc="mass of zeta; 0 for that of the two bodies alone")  # fmt: skip
    rebound: bool = choice((True, False), default=True, doc="whether fast contact rebounds")

    def switch(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def J(r_P_i, s_P_i, r_j, a_j):
        arm, back = sub(r_P_i, r_j), neg(a_j)  # the plane turns about its body
        return ((*a_j, *cross(s_P_i, a_j)),), ((*back, *cross(arm, back)),)

    def impulse(Jv, e, v_rest):
        return rebound(Jv, e, v_rest)

    def wrench(
        r_P_i, s_P_i, v_P_i, r_P_j, v_P_j, r_j, a_j, w_j, mass_i, mass_j, radius, k, zeta, m_c
    ):
        d = sub(r_P_i, r_P_j)
        g, g_dot = dot(a_j, d) - radius, dot(a_j, sub(sub(v_P_i, v_P_j), cross(w_j, d)))
        m = where(m_c > 0.0, m_c, reduced(mass_i, mass_j))
        F = scale(carried(g, g_dot, k, zeta, m), a_j)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(sub(r_P_i, r_j), F)))

    def energy(r_P_i, r_P_j, a_j, radius, k):
        return stored(dot(a_j, sub(r_P_i, r_P_j)) - radius, k)


class RigidPlaneStop(Contact, of=PlaneStop, k=False):
    """The plane carries, without a stiffness."""

    keyword, symbol, is_smooth = "plane_stop", "plate", True
    shared = ("P_i", "P_j", "a_j", "radius")

    def gap(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def at(r_P_i, a_j, radius):
        return sub(r_P_i, scale(radius, a_j))

    def normal(a_j):
        return a_j


class SoftPlaneStop(PlaneStop, rebound=False):
    """The spring and damper carry all contact."""

    unilateral, restitution = (), ""
    J = impulse = None


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [PlaneStop]
