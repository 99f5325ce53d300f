"""Point on a line of another body, which may move."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import dot, normals, sub
from dap3d_joints.relative_rows import offset_gamma, offset_rows

interface_version = 1


class InLine(Joint):
    """P_i stays on the line of body j through P_j along a_j; the rotations are left free.

    A bead on a rod. n_j and m_j complete a_j to a triad on body j. Two rows, with d = r_Pi - r_Pj,
    for b = n_j and b = m_j:

        C     = b . d
        J_i   = [b^T, (s_i x b)^T],  J_j = [-b^T, -((s_j + d) x b)^T]
        gamma = (w_j x d - s_j_dot - 2 d_dot) . b_dot - (w_i x s_i_dot) . b
    """

    keyword, rows = "inline", 2
    synonyms = ("point-on-line", "pointonline", "bead")
    symbol = "ball"
    P_i: Point = point(doc="the point that slides, on body i")
    P_j: Point = point(doc="point of the line, on body j")
    a_j: Vector = vector(doc="direction of the line, on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(r_P_i, r_P_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(n_j, d), dot(m_j, d)

    def J(n_j, m_j, s_P_i, r_P_i, r_j):
        first, second = offset_rows(n_j, s_P_i, r_P_i, r_j), offset_rows(m_j, s_P_i, r_P_i, r_j)
        return tuple(zip(first, second, strict=True))

    def gamma(
        n_j, m_j, n_j_dot, m_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j
    ):
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        return (
            offset_gamma(n_j, n_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j),
            offset_gamma(m_j, m_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j),
        )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [InLine]
