"""Planar joint: a plane of one body slides on a plane of another."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import dot, normals, sub
from dap3d_joints.relative_rows import axis_gamma, axis_rows, offset_gamma, offset_rows

interface_version = 1


class Planar(Joint):
    """The plane of body i slides on that of body j; two translations and one rotation are free.

    The plane of body i goes through P_i normal to a_i, that of body j through P_j normal to a_j.
    n_j and m_j complete a_j to a triad on body j. Rows 1 and 2, for b = n_j and b = m_j, keep the
    normals parallel; row 3 keeps P_i in the plane, with d = r_Pi - r_Pj:

        C     = a_i . b                                 C     = a_j . d
        J_i   = [0, (a_i x b)^T]                        J_i   = [a_j^T, (s_i x a_j)^T]
        J_j   = [0, -(a_i x b)^T]                       J_j   = [-a_j^T, -((s_j + d) x a_j)^T]
        gamma = (a_i_dot x b + a_i x b_dot).(w_j - w_i)
        gamma = (w_j x d - s_j_dot - 2 d_dot).a_j_dot - (w_i x s_i_dot).a_j
    """

    keyword, rows = "planar", 3
    symbol = "plate"
    P_i: Point = point(doc="point of the plane of body i")
    P_j: Point = point(doc="point of the plane of body j")
    a_i: Vector = vector(doc="normal of the plane, on body i")
    a_j: Vector = vector(doc="normal of the plane, on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(a_i, a_j, n_j, m_j, r_P_i, r_P_j):
        return dot(a_i, n_j), dot(a_i, m_j), dot(a_j, sub(r_P_i, r_P_j))

    def J(a_i, a_j, n_j, m_j, s_P_i, r_P_i, r_j):
        rows = axis_rows(a_i, n_j), axis_rows(a_i, m_j), offset_rows(a_j, s_P_i, r_P_i, r_j)
        return tuple(zip(*rows, strict=True))

    def gamma(
        a_i, a_j, n_j, m_j, a_i_dot, a_j_dot, n_j_dot, m_j_dot,
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j,
    ):  # fmt: skip
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        return (
            axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j),
            axis_gamma(a_i, m_j, a_i_dot, m_j_dot, w_i, w_j),
            offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j),
        )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Planar]
