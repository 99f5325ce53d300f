"""Stop of the distance between two points."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Force, Vector2, choice, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, neg, scale, sqrt
from dap3d_forces.rebound import carried, rebound, reduced, stored

interface_version = 1


class PointToPointStop(Force):
    """Limit of the distance l = |d| from P_i to P_j: balls that collide, a rope that jerks.

    With u = d / l the gap is g = l - l_stop for side "min", g = l_stop - l for side "max". Where it
    closes faster than v_rest an impulse along u makes g_dot of it -e g_dot, the joints of the
    bodies held (docs/how-to/jumps.md); slower
    contact is carried by a spring and damper, of stiffness k
    and of the damping ratio zeta for the two bodies alone, that pushes and does not pull. Without k
    the stop is rigid, a contact without friction (docs/concepts/contact.md).
    """

    keyword = "ptp_stop"
    symbol = "spring"
    example: ClassVar[Mapping[str, str]] = {"k": "1e5"}
    unilateral = (0,)
    restitution = "e"
    d: Vector2 = vector2(direction=True, doc="from the end on body i to the end on body j")
    l_stop: float = number(unit="m", positive=True, doc="least or greatest distance")
    side: str = choice(("min", "max"), default="min", doc="whether it is the least or the greatest")
    e: float = number(default=0.0, minimum=0.0, maximum=1.0, doc="coefficient of restitution")
    k: float = number(
        None, unit="N/m", positive=True, doc="stiffness of contact at rest; rigid without it"
    )
    zeta: float = number(default=1.0, minimum=0.0, doc="damping ratio of contact at rest")
    v_rest: float = number(
        default=1e-3, unit="m/s", minimum=0.0, doc="speed below which contact does not rebound"
    )

    def prepare(self, bodies):
        return {"way": 1.0 if self.side == "min" else -1.0}

    def switch(d, l_stop, way):
        return way * (sqrt(dot(d, d)) - l_stop)

    def J(d, s_P_i, s_P_j, way):
        u = scale(way / sqrt(dot(d, d)), d)
        back = neg(u)
        return ((*back, *cross(s_P_i, back)),), ((*u, *cross(s_P_j, u)),)

    def impulse(Jv, e, v_rest):
        return rebound(Jv, e, v_rest)

    def wrench(d, d_dot, s_P_i, s_P_j, mass_i, mass_j, l_stop, way, k, zeta):
        length = sqrt(dot(d, d))
        u = scale(way / length, d)
        g = way * (length - l_stop)
        F = scale(carried(g, dot(u, d_dot), k, zeta, reduced(mass_i, mass_j)), u)
        return (neg(F), neg(cross(s_P_i, F))), (F, cross(s_P_j, F))

    def energy(d, l_stop, way, k):
        return stored(way * (sqrt(dot(d, d)) - l_stop), k)


class RigidPointToPointStop(Contact, of=PointToPointStop, k=False):
    """The stop carries, without a stiffness."""

    keyword, symbol, is_smooth = "ptp_stop", "spring", True
    shared = ("d", "l_stop", "side")

    def prepare(self, bodies):
        return {"sense": 1.0 if self.side == "min" else -1.0}

    def gap(d, l_stop, sense):
        return sense * (sqrt(dot(d, d)) - l_stop)

    def at(r_P_i):
        return r_P_i

    def normal(d, sense):
        return scale(-sense / sqrt(dot(d, d)), d)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [PointToPointStop]
