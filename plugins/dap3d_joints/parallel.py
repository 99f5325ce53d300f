"""Parallel axes: an axis of one body keeps the direction of an axis of another."""

from dap3d_core.interface import Joint, Vector, hookimpl, vector
from dap3d_core.kernels import dot, normals
from dap3d_joints.relative_rows import axis_gamma, axis_rows

interface_version = 1


class Parallel(Joint):
    """Axis a_i stays parallel to a_j; the translations and the rotation about it are left free.

    n_j and m_j complete a_j to a triad on body j. Two rows, for b = n_j and b = m_j:

        C     = a_i . b
        J_i   = [0, (a_i x b)^T],  J_j = [0, -(a_i x b)^T]
        gamma = (a_i_dot x b + a_i x b_dot) . (w_j - w_i)
    """

    keyword, rows = "parallel", 2
    a_i: Vector = vector(doc="axis on body i")
    a_j: Vector = vector(doc="axis on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(a_i, n_j, m_j):
        return dot(a_i, n_j), dot(a_i, m_j)

    def J(a_i, n_j, m_j):
        return tuple(zip(axis_rows(a_i, n_j), axis_rows(a_i, m_j), strict=True))

    def gamma(a_i, n_j, m_j, a_i_dot, n_j_dot, m_j_dot, w_i, w_j):
        return (
            axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j),
            axis_gamma(a_i, m_j, a_i_dot, m_j_dot, w_i, w_j),
        )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Parallel]
