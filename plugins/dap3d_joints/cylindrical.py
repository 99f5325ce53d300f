"""Cylindrical joint: a body turns about an axis and slides along it."""

from dap3d_core.interface import Contact, Joint, Vector, Vector2, hookimpl, vector, vector2
from dap3d_core.kernels import add, cross, dot, neg, normals, scale, sub, tanh
from dap3d_joints.coulomb import magnitude
from dap3d_joints.relative_rows import axis_gamma, axis_rows, line_gamma, line_rows

interface_version = 1


class Cylindrical(Joint):
    """Axis a_i stays on the line of a_j; one rotation and one translation are left free.

    Manual: ``cyl``, formulation II. d runs from a point of the axis on body i
    to one on body j; n_j and m_j complete a_j to a triad on body j. Rows 1 and 2, for b = n_j, m_j,
    keep the axes parallel; rows 3 and 4 keep d along the axis:

        C     = a_i . b                                C     = d . b
        J_i   = [0, (a_i x b)^T]                       J_i   = [-b^T, -(s_i x b)^T]
        J_j   = [0, -(a_i x b)^T]                      J_j   = [b^T, ((s_j - d) x b)^T]
        gamma = (a_i_dot x b + a_i x b_dot).(w_j - w_i)
        gamma = (w_i x s_i_dot).b + (w_j x d + s_j_dot - 2 d_dot).b_dot

    Friction, on a rod of the radius given, with N = lambda_3 n_j + lambda_4 m_j: a force
    mu |N| S(v / v_tol) along a_j at P_i, against the speed v of P_i along a_j as seen from body j,
    and a moment mu radius |N| S(radius w / v_tol) about a_j, against w = a_j . (w_i - w_j).
    """

    keyword, rows = "cyl", 4
    synonyms = ("cylindrical", "sleeve")
    symbol = "sleeve"
    a_i: Vector = vector(doc="axis on body i")
    a_j: Vector = vector(doc="axis on body j")
    d: Vector2 = vector2(doc="from a point of the axis on body i to one on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(a_i, n_j, m_j, d):
        return dot(a_i, n_j), dot(a_i, m_j), dot(d, n_j), dot(d, m_j)

    def J(a_i, n_j, m_j, s_P_i, r_P_i, r_j):
        arms = s_P_i, r_P_i, r_j
        rows = (
            axis_rows(a_i, n_j),
            axis_rows(a_i, m_j),
            line_rows(n_j, *arms),
            line_rows(m_j, *arms),
        )
        return tuple(zip(*rows, strict=True))

    def gamma(a_i, n_j, m_j, d, a_i_dot, n_j_dot, m_j_dot, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j):
        motion = d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j
        return (
            axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j),
            axis_gamma(a_i, m_j, a_i_dot, m_j_dot, w_i, w_j),
            line_gamma(n_j, n_j_dot, *motion),
            line_gamma(m_j, m_j_dot, *motion),
        )

    def friction(lam, mu, v_tol, radius, a_j, s_P_i, r_P_i, v_P_i, r_j, v_j, w_i, w_j):
        load, arm = mu * magnitude((lam[2], lam[3])), sub(r_P_i, r_j)
        slow = 1.0 / v_tol
        v = slow * dot(a_j, sub(sub(v_P_i, v_j), cross(w_j, arm)))
        turning = slow * radius * dot(a_j, sub(w_i, w_j))
        F = scale(-load * tanh(v), a_j)
        moment = scale(-radius * load * tanh(turning), a_j)
        return (F, add(cross(s_P_i, F), moment)), (neg(F), neg(add(cross(arm, F), moment)))


class SleeveSliding(Contact, of=Cylindrical):
    """Friction that sticks along a rod."""

    keyword, load = "friction", (2, 3)

    def along(a_j):
        return a_j

    def at(r_P_i):
        return r_P_i


class SleeveTurning(Contact, of=Cylindrical):
    """Friction that sticks about a rod."""

    keyword, load = "friction", (2, 3)

    def along(a_j):
        return a_j


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Cylindrical]
