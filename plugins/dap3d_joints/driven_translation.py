"""Translation driver at position level: prescribes how far one point lies beyond another."""

from dap3d_core.interface import (
    Body,
    Joint,
    Point,
    Vector,
    body,
    function,
    hookimpl,
    input_,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import add, cross, dot, scale, sub
from dap3d_joints.relative_rows import offset_rows

interface_version = 1


class DrivenTranslation(Joint):
    """Point P_i lies a prescribed distance beyond P_j along a_j.

    A growing f increases the length that a ``tran`` or ``cyl`` of the same bodies i and j reports.
    ``rel-tran`` has the opposite sign, that of the manual, and no position level; this one takes
    any two points, and is right where body j turns. Without points it takes
    the mass centres, without a function it locks the distance. With d = r_Pj - r_Pi:

        C     = -a_j . d - length - f                length given
        C     = a_j . (d(0) - d) - (f - f_0)         length left out: C = 0 in the poses as given
        J_i   = [a_j^T, (s_i x a_j)^T],  J_j = [-a_j^T, ((d - s_j) x a_j)^T],  nu = f_dot
        gamma = f_ddot - (w_i x s_i_dot) . a_j - (w_j x d + s_j_dot - 2 d_dot) . a_j_dot

    An input is the speed, held between settings: the row is then one of the velocity level alone,
    and velocities jump where it is set.
    """

    keyword, rows = "drive-tran", 1
    synonyms = ("translational-motion",)
    drives = True
    joint: str = joint_fields("P_i", "P_j", "a_j", doc="the joint whose coordinate it drives")
    body_i: Body = body(default=None, doc="body that is moved; that of P_i")
    body_j: Body = body(default=None, doc="body the motion is measured from; that of P_j and a_j")
    P_i: Point = point(default=None, doc="on body i; the mass centre when left out")
    P_j: Point = point(default=None, doc="on body j; the mass centre when left out")
    a_j: Vector = vector(doc="direction, on body j")
    function: str = function(doc="distance, m, as a function of time")
    input: str = input_(instead_of="function", unit="m/s", doc="speed of P_i along a_j")
    length: float = number(
        default=None, unit="m", doc="distance where f = 0; left out, f is counted from the start"
    )

    def prepare(self, bodies):
        if self.length is not None:
            return {"length": self.length, "counted": 0.0}
        d = sub(bodies["i"].place(self.P_i), bodies["j"].place(self.P_j))
        return {"length": dot(bodies["j"].to_global(self.a_j), d), "counted": 1.0}

    def C(a_j, r_P_i, r_P_j, length, counted, f, f_0):
        return dot(a_j, sub(r_P_i, r_P_j)) - length - (f - counted * f_0)

    def J(a_j, s_P_i, r_P_i, r_j):
        return offset_rows(a_j, s_P_i, r_P_i, r_j)

    def nu(f_dot):
        return f_dot

    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j, f_ddot):
        d, d_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        slide = sub(add(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
        return f_ddot - dot(cross(w_i, s_P_i_dot), a_j) - dot(slide, a_j_dot)


class Held(DrivenTranslation, input=True):
    """The speed is an input."""

    holonomic = False
    C = None

    def nu(input):
        return input

    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j):
        d, d_dot = sub(r_P_j, r_P_i), sub(v_P_j, v_P_i)
        slide = sub(add(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
        return -dot(cross(w_i, s_P_i_dot), a_j) - dot(slide, a_j_dot)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [DrivenTranslation]
