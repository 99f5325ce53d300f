"""Constant velocity joint: two shafts meet in a point and turn at the same rate."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import add, cross, dot, neg, normals, row, sub
from dap3d_joints.relative_rows import ZERO, point_gamma, point_rows

interface_version = 1


class ConstantVelocity(Joint):
    """Point P_i stays on P_j and the shafts turn equally about a_i and a_j; two rotations are free.

    n_j and m_j complete a_j to a triad on body j; n_i and m_i are what the shortest rotation from
    a_j to a_i makes of them in the poses as given. Rows 1 to 3 are those of the spherical joint;
    row 4 says that body i differs from body j by a rotation without a part along the shaft, so
    that any angle between the shafts is crossed at equal rates:

        C     = n_i . m_j - m_i . n_j
        c     = n_i x m_j - m_i x n_j,  J_i = [0, c^T],  J_j = [0, -c^T]
        gamma = c_dot . (w_j - w_i)

    The angle between the shafts must stay below a straight one, 180 deg.
    """

    keyword, rows = "cv", 4
    synonyms = ("convel", "homokinetic")
    symbol = "ball"
    P_i: Point = point(doc="where the shafts meet, on body i")
    P_j: Point = point(doc="where the shafts meet, on body j")
    a_i: Vector = vector(doc="axis of shaft i, pointing as a_j does where both are in line")
    a_j: Vector = vector(doc="axis of shaft j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        u = bodies["i"].to_global(self.a_i)
        v, a, b = (bodies["j"].to_global(x) for x in (self.a_j, n, m))
        if 1.0 + dot(u, v) < 1e-6:
            raise ValueError("a_i and a_j point in opposite directions; turn one of them round")
        n_i, m_i = (bodies["i"].to_local(carried(x, v, u)) for x in (a, b))
        return {"n_j": n, "m_j": m, "n_i": n_i, "m_i": m_i}

    def C(r_P_i, r_P_j, n_i, m_i, n_j, m_j):
        return (*sub(r_P_j, r_P_i), dot(n_i, m_j) - dot(m_i, n_j))

    def J(s_P_i, s_P_j, n_i, m_i, n_j, m_j):
        c = sub(cross(n_i, m_j), cross(m_i, n_j))
        i, j = point_rows(s_P_i, s_P_j)
        return (*i, row(ZERO, c)), (*j, row(ZERO, neg(c)))

    def gamma(s_P_i, s_P_j, n_i, m_i, n_j, m_j, n_i_dot, m_i_dot, n_j_dot, m_j_dot, w_i, w_j):
        first = add(cross(n_i_dot, m_j), cross(n_i, m_j_dot))
        second = add(cross(m_i_dot, n_j), cross(m_i, n_j_dot))
        turning = dot(sub(first, second), sub(w_j, w_i))
        return (*point_gamma(s_P_i, s_P_j, w_i, w_j), turning)


def carried(x, v, u):
    """The vector x, carried along by the shortest rotation from the unit vector v to u."""
    axis = cross(v, u)
    twice = cross(axis, cross(axis, x))
    part = 1.0 / (1.0 + dot(v, u))
    return tuple(a + b + part * c for a, b, c in zip(x, cross(axis, x), twice, strict=True))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [ConstantVelocity]
