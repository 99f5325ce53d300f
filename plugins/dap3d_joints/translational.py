"""Translational joint: a body slides along an axis without turning against the other."""

from dap3d_core.interface import Contact, Joint, Vector, Vector2, hookimpl, matrix, vector, vector2
from dap3d_core.kernels import (
    add,
    cross,
    dot,
    euler_parameters,
    eye,
    hstack,
    neg,
    normals,
    scale,
    sub,
    tanh,
)
from dap3d_joints.coulomb import magnitude
from dap3d_joints.orientation import error, error_rate, turn
from dap3d_joints.relative_rows import line_gamma, line_rows

interface_version = 1

NO_TURN = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Translational(Joint):
    """A_i^T A_j stays A_c, and d along a_j; one translation is left free.

    Manual: ``tran``, formulation II. With the error quaternion
    q = p_j o conj(p_c) o conj(p_i) = (q0, e), rows 1 to 3:

        C     = 2 e
        J_i   = [0, -(q0 I + e~)],  J_j = [0, q0 I - e~]
        gamma = -q0_dot (w_j - w_i) + e_dot x (w_i + w_j)

    Rows 4 and 5, for b = n_j and m_j, which complete a_j to a triad on body j:

        C     = d . b
        J_i   = [-b^T, -(s_i x b)^T],  J_j = [b^T, ((s_j - d) x b)^T]
        gamma = (w_i x s_i_dot) . b + (w_j x d + s_j_dot - 2 d_dot) . b_dot

    On the constraints these are the manual's; it prints J = [0, -I], [0, I] and gamma = 0 for rows
    1 to 3. Friction, with N = lambda_4 n_j + lambda_5 m_j: a force mu |N| S(v / v_tol)
    along a_j at P_i, against the speed v of P_i along a_j as seen from body j; without v_tol it
    sticks.
    """

    keyword, rows = "tran", 5
    body_axes = ()  # A_c says how they lie
    synonyms = ("translational", "prismatic", "slider", "slide")
    coordinate, limit = "length", "joint_limit"
    symbol = "slider"
    a_j: Vector = vector(doc="direction of sliding, on body j")
    d: Vector2 = vector2(doc="from a point of the axis on body i to one on body j")
    A_c: tuple = matrix(default=NO_TURN, doc="constant orientation A_i^T A_j, a rotation")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        check_rotation(self.A_c)
        return {"n_j": n, "m_j": m, "p_c": euler_parameters(self.A_c)}

    def C(p_i, p_j, p_c, d, n_j, m_j):
        _, e = error(p_j, p_c, p_i)
        return (*scale(2.0, e), dot(d, n_j), dot(d, m_j))

    def J(p_i, p_j, p_c, n_j, m_j, s_P_i, r_P_i, r_j):
        q0, e = error(p_j, p_c, p_i)
        n, m = line_rows(n_j, s_P_i, r_P_i, r_j), line_rows(m_j, s_P_i, r_P_i, r_j)
        return (
            (*hstack(eye(0.0), turn(-q0, e)), n[0], m[0]),
            (*hstack(eye(0.0), turn(q0, e)), n[1], m[1]),
        )

    def gamma(p_i, p_j, p_c, d, d_dot, n_j, m_j, n_j_dot, m_j_dot, s_P_i_dot, s_P_j_dot, w_i, w_j):
        q0, e = error(p_j, p_c, p_i)
        q0_dot, e_dot = error_rate(q0, e, w_i, w_j)
        turning = add(scale(-q0_dot, sub(w_j, w_i)), cross(e_dot, add(w_i, w_j)))
        motion = d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j
        return (*turning, line_gamma(n_j, n_j_dot, *motion), line_gamma(m_j, m_j_dot, *motion))

    def friction(lam, mu, v_tol, a_j, s_P_i, r_P_i, v_P_i, r_j, v_j, w_j):
        arm = sub(r_P_i, r_j)
        v = dot(a_j, sub(sub(v_P_i, v_j), cross(w_j, arm)))
        F = scale(-mu * magnitude((lam[3], lam[4])) * tanh(v / v_tol), a_j)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(arm, F)))


class SliderFriction(Contact, of=Translational):
    """Friction that sticks, of a guide."""

    keyword, load = "friction", (3, 4)

    def along(a_j):
        return a_j

    def at(r_P_i):
        return r_P_i


def check_rotation(A):
    """Refuse a matrix that is no rotation: A^T A = I and det A = 1, to 1e-6."""
    x, y, z = A
    worst = max(abs(dot(a, b) - (a is b)) for a in A for b in A)
    if worst > 1e-6 or abs(dot(x, cross(y, z)) - 1.0) > 1e-6:
        raise ValueError("A_c is not a rotation matrix; give A_i^T A_j, with orthonormal rows")


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Translational]
