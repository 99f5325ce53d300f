"""A point that stays on a curve: beads on wires, pins in slots."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import REQUIRED, Joint, Point, function, hookimpl, number, point
from dap3d_core.kernels import add, cross, rotate, row, scale, sub, transpose

interface_version = 1


class OnCurve(Joint):
    """P_i stays on the curve x(s), y(s), z(s), in axes of body j, from P_j.

    With d = A_j^T (r_Pi - r_Pj) two rows remain of three, as s is an unknown of the joint:

        C     = (d_x - x(s), d_y - y(s), d_z - z(s)),   G = dC/ds = -(x'(s), y'(s), z'(s))
        J_i   = [e_k^T, (s_i x e_k)^T],  J_j = -[e_k^T, (R x e_k)^T],  R = r_Pi - r_j, e_k axes of j
        gamma = e_k . (w_j x (w_j x R) + 2 w_j x (r_Pi_dot - r_j_dot - w_j x R) - w_i x s_i_dot)
                + (x''(s), y''(s), z''(s))_k s_dot^2,   J v_dot + G s_ddot = gamma

    Without ``z`` it is a slot in a plate: where P_i is along z has no part, and one row remains of
    d_x and d_y. The joint pulls as well as it pushes, without friction; what may lift off is the
    contact ``point_curve``. Where s passes ``s_min`` or ``s_max`` the run ends; without bounds s
    goes on as far as the functions do, and of a closed curve, of periodic functions, counts turns.
    x, y and z are smooth, and never stand still all at once.
    """

    keyword, rows, unknowns = "oncurve", 2, ("s",)
    synonyms = ("slot", "wire", "bead-on-wire")
    symbol = "block"
    example: ClassVar[Mapping[str, str]] = {"s_0": "0.5"}
    P_i: Point = point(doc="the point that stays on the curve")
    P_j: Point = point("ground.O", doc="origin of the curve")
    x: str = function(REQUIRED, argument="s", doc="x of the curve, m")
    y: str = function(REQUIRED, argument="s", doc="y of the curve, m")
    z: str = function(argument="s", doc="z of a curve in space, m")
    s_0: float = number(0.0, doc="value near which s is sought at the start")

    def C(r_P_i, r_P_j, A_j, s, x, y):
        X, Y, _ = seen_from(A_j, r_P_i, r_P_j)
        return X - x(s), Y - y(s)

    def G(s, x_dot, y_dot):
        return (-x_dot(s),), (-y_dot(s),)

    def J(r_P_i, s_P_i, r_j, A_j):
        return rows_of(A_j, s_P_i)[:2], rows_of(A_j, sub(r_P_i, r_j), -1.0)[:2]

    def gamma(r_P_i, v_P_i, s_P_i_dot, w_i, r_j, v_j, w_j, A_j, s, s_dot, x_ddot, y_ddot):
        X, Y, _ = bent(r_P_i, v_P_i, s_P_i_dot, w_i, r_j, v_j, w_j, A_j)
        return X + x_ddot(s) * s_dot * s_dot, Y + y_ddot(s) * s_dot * s_dot


class InSpace(OnCurve, z=True):
    """The curve is in space."""

    rows = 3

    def C(r_P_i, r_P_j, A_j, s, x, y, z):
        return sub(seen_from(A_j, r_P_i, r_P_j), (x(s), y(s), z(s)))

    def G(s, x_dot, y_dot, z_dot):
        return (-x_dot(s),), (-y_dot(s),), (-z_dot(s),)

    def J(r_P_i, s_P_i, r_j, A_j):
        return rows_of(A_j, s_P_i), rows_of(A_j, sub(r_P_i, r_j), -1.0)

    def gamma(r_P_i, v_P_i, s_P_i_dot, w_i, r_j, v_j, w_j, A_j, s, s_dot, x_ddot, y_ddot, z_ddot):
        bend = scale(s_dot * s_dot, (x_ddot(s), y_ddot(s), z_ddot(s)))
        return add(bent(r_P_i, v_P_i, s_P_i_dot, w_i, r_j, v_j, w_j, A_j), bend)


def seen_from(A, r, origin):
    """A place from an origin, in the axes of a body."""
    return rotate(transpose(A), sub(r, origin))


def rows_of(A, arm, sign=1.0):
    """Rows of the velocity of a point along the axes of a body."""
    return tuple(row(scale(sign, e), scale(sign, cross(arm, e))) for e in transpose(A))


def bent(r_P_i, v_P_i, s_P_i_dot, w_i, r_j, v_j, w_j, A_j):
    """Less the acceleration of P_i as seen from body j, but for that of the bodies."""
    R = sub(r_P_i, r_j)
    seen = sub(v_P_i, add(v_j, cross(w_j, R)))
    turning = add(cross(w_j, cross(w_j, R)), scale(2.0, cross(w_j, seen)))
    return rotate(transpose(A_j), sub(turning, cross(w_i, s_P_i_dot)))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [OnCurve]
