"""Universal joint: two bodies share a point, and the arms of a cross stay perpendicular."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import add, cross, dot, eye, hstack, neg, row, skew, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Universal(Joint):
    """Point P_i stays on P_j and arm a_i perpendicular to arm n_j; two rotations are left free.

    The manual names it and does not implement it. Rows 1 to 3 are those of the
    spherical joint; row 4:

        C     = a_i . n_j
        J_i   = [0, (a_i x n_j)^T],  J_j = [0, -(a_i x n_j)^T]
        gamma = (a_i_dot x n_j + a_i x n_j_dot) . (w_j - w_i)
    """

    keyword, rows = "univ", 4
    synonyms = ("universal", "cardan", "hooke", "u-joint")
    symbol = "cross"
    P_i: Point = point(doc="centre of the cross, on body i")
    P_j: Point = point(doc="centre of the cross, on body j")
    a_i: Vector = vector(doc="arm of the cross that is fixed in body i")
    n_j: Vector = vector(doc="arm of the cross that is fixed in body j")

    def C(r_P_i, r_P_j, a_i, n_j):
        return (*sub(r_P_j, r_P_i), dot(a_i, n_j))

    def J(s_P_i, s_P_j, a_i, n_j):
        c = cross(a_i, n_j)
        return (
            (*hstack(eye(-1.0), skew(s_P_i)), row(ZERO, c)),
            (*hstack(eye(1.0), skew(neg(s_P_j))), row(ZERO, neg(c))),
        )

    def gamma(s_P_i, s_P_j, a_i, n_j, a_i_dot, n_j_dot, w_i, w_j):
        c_dot = add(cross(a_i_dot, n_j), cross(a_i, n_j_dot))
        point_rows = sub(cross(w_i, cross(w_i, s_P_i)), cross(w_j, cross(w_j, s_P_j)))
        return (*point_rows, dot(c_dot, sub(w_j, w_i)))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Universal]
