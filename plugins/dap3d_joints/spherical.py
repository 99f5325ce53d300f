"""Spherical joint: point P_i of body i and point P_j of body j stay together."""

from dap3d_core.interface import Contact, Joint, Point, hookimpl, point
from dap3d_core.kernels import neg, scale, sub
from dap3d_joints.coulomb import against, magnitude
from dap3d_joints.relative_rows import ZERO, point_gamma, point_rows

interface_version = 1


class Spherical(Joint):
    """Point P_i stays on point P_j; the three rotations are left free (manual: ``sph``).

    Rows 1 to 3, with s the arms from the mass centres to the points:

        C     = r_Pj - r_Pi
        J_i   = [-I, s_i~],  J_j = [I, -s_j~]
        gamma = w_i x (w_i x s_i) - w_j x (w_j x s_j)

    Friction, on a ball of the radius given: a moment mu radius |lambda| S(radius |w| / v_tol)
    against the relative angular velocity w = w_i - w_j.
    """

    keyword, rows = "sph", 3
    synonyms = ("spherical", "ball", "socket", "ball-and-socket")
    symbol = "ball"
    P_i: Point = point(doc="point on body i")
    P_j: Point = point(doc="point on body j")

    def C(r_P_i, r_P_j):
        return sub(r_P_j, r_P_i)

    def J(s_P_i, s_P_j):
        return point_rows(s_P_i, s_P_j)

    def gamma(s_P_i, s_P_j, w_i, w_j):
        return point_gamma(s_P_i, s_P_j, w_i, w_j)

    def friction(lam, mu, v_tol, radius, w_i, w_j):
        sliding = scale(radius, sub(w_i, w_j))
        moment = scale(radius, against(sliding, mu * magnitude(lam), v_tol))
        return (ZERO, moment), (ZERO, neg(moment))


class BallFriction(Contact, of=Spherical):
    """Friction that sticks, of a ball: it slides in every direction."""

    keyword, load = "friction", (0, 1, 2)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Spherical]
