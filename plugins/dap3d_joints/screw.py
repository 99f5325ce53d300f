"""Screw joint: a nut that advances along an axis as it turns about it."""

from math import pi

from dap3d_core.interface import Joint, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import add, atan2, cos, dot, normals, row, scale, sin, sub
from dap3d_joints.relative_rows import (
    axis_gamma,
    axis_rows,
    offset_gamma,
    offset_rows,
    turning,
    turning_rate,
)

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Screw(Joint):
    """Body i, the nut, moves along the axis a_j of body j by ``pitch`` a turn; one freedom is left.

    With d = r_Pi - r_Pj, x = a_j . d, n_j and m_j normal to a_j, theta the angle of body i against
    body j about a_j, and x_0 the value of x in the poses as given, where theta = 0:

        C = (n_j . d,  m_j . d,  a_i . n_j,  a_i . m_j,
             pitch / (2 pi) wrapped(2 pi (x - x_0) / pitch - theta))

    u_i, fixed in body i, is n_j in the poses as given: theta = atan2(m_j . u_i, n_j . u_i), and
    with Z = a_j . u_i its rate is h . (w_i - w_j), h = (a_j - Z u_i) / (1 - Z^2). The rows of J and
    gamma are those of ``inline`` and ``parallel``, and in row 5 those of x, with pitch / (2 pi) h
    taken off. x itself says how often the nut has turned, so no turns need be counted: what is
    wrapped into (-pi, pi] is the error alone.
    """

    keyword, rows = "screw", 5
    synonyms = ("helical", "leadscrew", "nut")
    symbol = "sleeve"
    P_i: Point = point(doc="point on the axis, on the nut")
    P_j: Point = point(doc="point on the axis, on the screw")
    a_i: Vector = vector(doc="axis on the nut")
    a_j: Vector = vector(doc="axis on the screw; x grows along it")
    pitch: float = number(unit="m", doc="advance in one turn; negative for a left-handed thread")

    def prepare(self, bodies):
        if self.pitch == 0.0:
            raise ValueError("pitch is zero; a nut that does not advance is a revolute joint, rev")
        nut, thread = bodies["i"], bodies["j"]
        n, m = normals(self.a_j)
        d = sub(nut.place(self.P_i), thread.place(self.P_j))
        x_0 = dot(thread.to_global(self.a_j), d)
        u = nut.to_local(thread.to_global(n))
        return {"n_j": n, "m_j": m, "u_i": u, "x_0": x_0, "lead": self.pitch / (2.0 * pi)}

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j, u_i, x_0, lead):
        d = sub(r_P_i, r_P_j)
        turn = (dot(a_j, d) - x_0) / lead
        X, Y, c, s = dot(n_j, u_i), dot(m_j, u_i), cos(turn), sin(turn)
        error = atan2(X * s - Y * c, X * c + Y * s)
        return dot(n_j, d), dot(m_j, d), dot(a_i, n_j), dot(a_i, m_j), lead * error

    def J(r_P_i, r_j, s_P_i, a_i, a_j, n_j, m_j, u_i, lead):
        h = scale(lead, turning(a_j, u_i))
        x_i, x_j = offset_rows(a_j, s_P_i, r_P_i, r_j)
        rows = (
            offset_rows(n_j, s_P_i, r_P_i, r_j),
            offset_rows(m_j, s_P_i, r_P_i, r_j),
            axis_rows(a_i, n_j),
            axis_rows(a_i, m_j),
            (row(x_i[:3], sub(x_i[3:], h)), row(x_j[:3], add(x_j[3:], h))),
        )
        return tuple(zip(*rows, strict=True))

    def gamma(
        a_i, a_j, n_j, m_j, u_i, a_i_dot, a_j_dot, n_j_dot, m_j_dot, u_i_dot,
        r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j, lead,
    ):  # fmt: skip
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        motion = d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j
        h_dot = turning_rate(a_j, u_i, a_j_dot, u_i_dot)
        return (
            offset_gamma(n_j, n_j_dot, *motion),
            offset_gamma(m_j, m_j_dot, *motion),
            axis_gamma(a_i, n_j, a_i_dot, n_j_dot, w_i, w_j),
            axis_gamma(a_i, m_j, a_i_dot, m_j_dot, w_i, w_j),
            offset_gamma(a_j, a_j_dot, *motion) + lead * dot(h_dot, sub(w_i, w_j)),
        )


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Screw]
