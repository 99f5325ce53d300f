"""Stop of the turn between two bodies, about any axis."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Body, Contact, Force, body, hookimpl, number, numbers
from dap3d_core.kernels import (
    add,
    atan2,
    cross,
    dot,
    neg,
    norm2,
    rotate,
    rotation_matrix,
    rotation_vector,
    scale,
    sqrt,
    sub,
    transpose,
    where,
)
from dap3d_forces.ball_spring import BallSpring, turned
from dap3d_forces.rebound import carried, reduced, stored
from dap3d_forces.rotation_stop import inertia

interface_version = 1

ZERO = (0.0, 0.0, 0.0)
#: Square of a sine below which the axis of a turn is not known; no stop is there.
SMALL = 1e-12


class BallStop(Force):
    """Limit of the angle by which body j is turned from body i, about whatever axis.

    The turn phi u, with the angle phi in [0, pi] and the axis u, is that of ``sph_sd``: from the
    orientation p_i o p_c of body j, where it is zero. With the gap g = phi_stop - phi and its rate
    g_dot = -u . (w_j - w_i), a spring and damper carry where g < 0; they push, and do not pull:

        M = max(0, -k g - 2 zeta sqrt(k m) g_dot), moment M u on body i and -M u on body j

    m is ``J_c``, by default the reduced inertia of the two bodies about u. Without k the stop is
    rigid, a contact without friction (docs/concepts/contact.md).
    """

    keyword = "sph_stop"
    symbol = "ball"
    example: ClassVar[Mapping[str, str]] = {"k": "1e4"}

    body_i: Body = body(doc="body from which the turn is measured")
    body_j: Body = body(doc="body that turns")
    phi_stop: float = number(unit="rad", minimum=1e-3, maximum=3.0, doc="greatest angle")
    p_c: tuple = numbers(
        4, (1.0, 0.0, 0.0, 0.0), doc="orientation of body j in body i without turn, scaled to 1"
    )
    k: float = number(None, unit="N m/rad", positive=True, doc="stiffness; rigid without it")
    zeta: float = number(default=1.0, minimum=0.0, doc="damping ratio")
    J_c: float = number(default=0.0, unit="kg m^2", minimum=0.0,
                        doc="inertia of zeta; 0 for that of the two bodies alone")  # fmt: skip

    def prepare(self, bodies):
        p_c = BallSpring.prepare(self, bodies)["p_c"]
        return {"p_c": p_c, "axes": transpose(rotation_matrix(rotation_vector(p_c)))}

    def wrench(p_i, p_j, p_c, A_i, A_j, w_i, w_j, Jp_i, Jp_j, phi_stop, k, zeta, J_c):
        phi, u = half_turns(p_i, p_j, p_c)
        m = where(J_c > 0.0, J_c, reduced(inertia(A_i, Jp_i, u), inertia(A_j, Jp_j, u)))
        M = scale(carried(phi_stop - phi, -dot(u, sub(w_j, w_i)), k, zeta, m), u)
        return (ZERO, M), (ZERO, neg(M))

    def energy(p_i, p_j, p_c, phi_stop, k):
        return stored(phi_stop - half_turns(p_i, p_j, p_c)[0], k)

    def switch(p_i, p_j, p_c, phi_stop):
        # the second is zero at half a turn, where u jumps
        return phi_stop - half_turns(p_i, p_j, p_c)[0], turned(p_i, p_j, p_c)[0]


class RigidBallStop(Contact, of=BallStop, k=False):
    """The stop carries, without a stiffness."""

    keyword, symbol, is_smooth = "sph_stop", "ball", True
    shared = ("body_i", "body_j", "phi_stop", "p_c")

    prepare = BallStop.prepare

    def gap(A_i, A_j, axes, phi_stop):
        return phi_stop - turns(A_i, A_j, axes)[0]

    def normal(A_i, A_j, axes):
        return turns(A_i, A_j, axes)[1]


def half_turns(p_i, p_j, p_c):
    """Angle and axis of the turn, of Euler parameters: of half of it sine and cosine."""
    q, *e = turned(p_i, p_j, p_c)
    sense = where(q < 0.0, -1.0, 1.0)
    half, u = angle_axis(sense * q, scale(sense, e))
    return 2.0 * half, u


def turns(A_i, A_j, axes):
    """Angle and axis of the turn from axes on body i to those of body j, whose rates are known."""
    pairs = [(rotate(A_i, one), other) for one, other in zip(axes, transpose(A_j), strict=True)]
    x, y, z = (cross(*pair) for pair in pairs)
    e, cosine = add(add(x, y), z), sum(dot(*pair) for pair in pairs) - 1.0  # both doubled
    return angle_axis(cosine, e)


def angle_axis(cosine, e):
    """An angle and its axis, of multiples of its cosine and its sine, the latter along the axis."""
    small = norm2(e) < SMALL
    sine = sqrt(where(small, 1.0, norm2(e)))
    u = tuple(where(small, w, x / sine) for x, w in zip(e, (0.0, 0.0, 1.0), strict=True))
    return atan2(where(small, 0.0, sine), cosine), u


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [BallStop]
