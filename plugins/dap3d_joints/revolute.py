"""Revolute joint: two bodies share a point and an axis through it."""

from dap3d_core.interface import Contact, Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import dot, neg, normals, scale, sub, tanh
from dap3d_joints.coulomb import magnitude
from dap3d_joints.relative_rows import ZERO, axis_gamma, axis_rows, point_gamma, point_rows

interface_version = 1


class Revolute(Joint):
    """Point P_i stays on P_j and axis a_i along a_j; one rotation is left free (manual: ``rev``).

    n_j and m_j complete a_j to a triad on body j. Rows 1 to 3 are those of the
    spherical joint; rows 4 and 5, for b = n_j and b = m_j, keep the axes parallel:

        C     = a_i . b
        J_i   = [0, (a_i x b)^T],  J_j = [0, -(a_i x b)^T]
        gamma = (a_i_dot x b + a_i x b_dot) . (w_j - w_i)

    The manual writes a_j for a_i in rows 4 and 5, the same on the constraint manifold only; these
    are exact everywhere. Friction, on a pin of the radius given: a moment about a_j,
    mu radius |lambda_1..3| S(radius w / v_tol) against w = a_j . (w_i - w_j); without
    v_tol it sticks.
    """

    keyword, rows = "rev", 5
    synonyms = ("revolute", "hinge", "pin")
    coordinate, limit = "angle", "joint_limit"
    symbol = "hinge"
    P_i: Point = point(doc="point on the axis, on body i")
    P_j: Point = point(doc="point on the axis, on body j")
    a_i: Vector = vector(doc="axis on body i")
    a_j: Vector = vector(doc="axis on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(r_P_i, r_P_j, a_i, n_j, m_j):
        return (*sub(r_P_j, r_P_i), dot(a_i, n_j), dot(a_i, m_j))

    def J(s_P_i, s_P_j, a_i, n_j, m_j):
        i, j = point_rows(s_P_i, s_P_j)
        n, m = axis_rows(a_i, n_j), axis_rows(a_i, m_j)
        return (*i, n[0], m[0]), (*j, n[1], m[1])

    def gamma(s_P_i, s_P_j, a_i, n_j, m_j, a_i_dot, n_j_dot, m_j_dot, w_i, w_j):
        n = axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j)
        m = axis_gamma(a_i, m_j, a_i_dot, m_j_dot, w_i, w_j)
        return (*point_gamma(s_P_i, s_P_j, w_i, w_j), n, m)

    def friction(lam, mu, v_tol, radius, a_j, w_i, w_j):
        load = mu * magnitude((lam[0], lam[1], lam[2]))
        sliding = radius * dot(a_j, sub(w_i, w_j))
        moment = scale(-radius * load * tanh(sliding / v_tol), a_j)
        return (ZERO, moment), (ZERO, neg(moment))


class HingeFriction(Contact, of=Revolute):
    """Friction that sticks, of a pin."""

    keyword, load = "friction", (0, 1, 2)

    def along(a_j):
        return a_j


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Revolute]
