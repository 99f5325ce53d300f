"""Stop of the angle between two bodies."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Force, angle, choice, hookimpl, number
from dap3d_core.kernels import dot, neg, rotate, scale, where
from dap3d_forces.rebound import carried, rebound, reduced, stored
from dap3d_forces.torsion import AngleFields, marks

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class RotationStop(AngleFields, Force):
    """Limit of the angle theta of body j relative to body i about an axis u common to both.

    theta falls where the angle that a rev or cyl about u of the same bodies i and j reports grows:
    side "max" limits that angle from below. It is measured from v_i to v_j and counts whole turns;
    theta_dot = u . (w_j - w_i). The gap is g = theta - theta_stop for side "min",
    g = theta_stop - theta for side "max". Where it closes faster than w_rest an impulsive moment
    along u makes g_dot of it -e g_dot, the joints of the bodies held (docs/how-to/jumps.md); slower
    contact is carried by a spring and damper, of stiffness k and of the damping ratio zeta, that
    pushes and does not pull. zeta is that of the inertia ``J_c``, by default of the two bodies
    alone. Without ``rebound`` all contact is carried. Without k the stop is rigid, a contact
    without friction (docs/concepts/contact.md).
    """

    keyword = "rot_stop"
    body_axes = ()  # moments of inertia alone
    symbol = "ring"
    example: ClassVar[Mapping[str, str]] = {"k": "1e4"}
    unilateral = (0,)
    restitution = "e"
    energy_where = "where the bodies turn about the common axis"

    theta: float = angle("v_i", "v_j", "axis")
    theta_stop: float = number(unit="rad", doc="least or greatest angle")
    side: str = choice(("min", "max"), default="min", doc="whether it is the least or the greatest")
    e: float = number(default=0.0, minimum=0.0, maximum=1.0, doc="coefficient of restitution")
    k: float = number(
        None, unit="N m/rad", positive=True, doc="stiffness of contact at rest; rigid without it"
    )
    zeta: float = number(default=1.0, minimum=0.0, doc="damping ratio of contact at rest")
    w_rest: float = number(
        default=1e-3, unit="rad/s", minimum=0.0, doc="speed below which contact does not rebound"
    )
    J_c: float = number(default=0.0, unit="kg m^2", minimum=0.0,
                        doc="inertia of zeta; 0 for that of the two bodies alone")  # fmt: skip
    rebound: bool = choice((True, False), default=True, doc="whether fast contact rebounds")

    def prepare(self, bodies):
        return {"way": 1.0 if self.side == "min" else -1.0} | marks(self, bodies)

    def switch(theta, theta_stop, way):
        return way * (theta - theta_stop)

    def J(axis, way):
        u = scale(way, axis)
        return ((*ZERO, *neg(u)),), ((*ZERO, *u),)

    def impulse(Jv, e, w_rest):
        return rebound(Jv, e, w_rest)

    def wrench(axis, theta, theta_dot, A_i, A_j, Jp_i, Jp_j, theta_stop, way, k, zeta, J_c):
        two = reduced(inertia(A_i, Jp_i, axis), inertia(A_j, Jp_j, axis))
        m = where(J_c > 0.0, J_c, two)
        g = way * (theta - theta_stop)
        moment = scale(way * carried(g, way * theta_dot, k, zeta, m), axis)
        return (ZERO, neg(moment)), (ZERO, moment)

    def energy(theta, theta_stop, way, k):
        return stored(way * (theta - theta_stop), k)


class RigidRotationStop(Contact, of=RotationStop, k=False):
    """The stop carries, without a stiffness."""

    keyword, symbol, is_smooth = "rot_stop", "ring", True
    shared = ("joint", "body_i", "body_j", "v_i", "v_j", "axis", "theta", "theta_stop", "side")

    def prepare(self, bodies):
        return {"sense": 1.0 if self.side == "min" else -1.0} | marks(self, bodies)

    def gap(theta, theta_stop, sense):
        return sense * (theta - theta_stop)

    def normal(axis, sense):
        return scale(-sense, axis)


class SoftRotationStop(RotationStop, rebound=False):
    """The spring and damper carry all contact."""

    unilateral, restitution = (), ""
    J = impulse = None


def inertia(A, Jp, u):
    """The moment of inertia about u of a body with inertia matrix Jp in its axes."""
    x = tuple(A[0][k] * u[0] + A[1][k] * u[1] + A[2][k] * u[2] for k in range(3))
    return dot(x, rotate(Jp, x))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [RotationStop]
