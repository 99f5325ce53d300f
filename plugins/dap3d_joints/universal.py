"""Universal joint: two bodies share a point, and the arms of a cross stay perpendicular."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import dot, sub
from dap3d_joints.relative_rows import axis_gamma, axis_rows, point_gamma, point_rows

interface_version = 1


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
        (i, j), n = point_rows(s_P_i, s_P_j), axis_rows(a_i, n_j)
        return (*i, n[0]), (*j, n[1])

    def gamma(s_P_i, s_P_j, a_i, n_j, a_i_dot, n_j_dot, w_i, w_j):
        n = axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j)
        return (*point_gamma(s_P_i, s_P_j, w_i, w_j), n)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Universal]
