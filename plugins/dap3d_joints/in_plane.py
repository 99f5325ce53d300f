"""Point in a plane of another body, which may move."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import dot, sub
from dap3d_joints.relative_rows import offset_gamma, offset_rows

interface_version = 1


class InPlane(Joint):
    """P_i stays in the plane of body j through P_j normal to a_j, or at a distance from it.

    ``rP`` has its plane on ground; this one moves with its body. One row, with d = r_Pi - r_Pj:

        C     = a_j . d - distance
        J_i   = [a_j^T, (s_i x a_j)^T],  J_j = [-a_j^T, -((s_j + d) x a_j)^T]
        gamma = (w_j x d - s_j_dot - 2 d_dot) . a_j_dot - (w_i x s_i_dot) . a_j
    """

    keyword, rows = "inplane", 1
    synonyms = ("pointonplane",)
    symbol = "plate"
    P_i: Point = point(doc="the point that slides, on body i")
    P_j: Point = point(doc="point of the plane, on body j")
    a_j: Vector = vector(doc="normal of the plane, on body j")
    distance: float = number(default=0.0, unit="m", doc="height above the plane, of either sign")

    def C(r_P_i, r_P_j, a_j, distance):
        return dot(a_j, sub(r_P_i, r_P_j)) - distance

    def J(a_j, s_P_i, r_P_i, r_j):
        return offset_rows(a_j, s_P_i, r_P_i, r_j)

    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j):
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        return offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [InPlane]
