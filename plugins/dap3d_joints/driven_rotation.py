"""Rotation driver at position level: prescribes the angle of one body against another."""

from dap3d_core.interface import (
    Body,
    Joint,
    Vector,
    body,
    function,
    hookimpl,
    input_,
    joint_fields,
    vector,
)
from dap3d_core.kernels import atan2, cos, dot, neg, normals, row, sin, sub
from dap3d_joints.relative_rows import turning, turning_rate

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class DrivenRotation(Joint):
    """Body i has turned against body j about a_j, since the start, by theta = f(t) - f(0).

    A growing f increases the angle that a ``rev`` or ``cyl`` of the same bodies i and j reports.
    ``rel-rot`` has the opposite sign, that of the manual, and no position level: there the angle
    drifts. Without a function it locks the angle. n_j and m_j complete a_j to a triad on
    body j; u_i, fixed in body i, is n_j in the poses as given. With X = n_j . u_i, Y = m_j . u_i
    and Z = a_j . u_i, theta = atan2(Y, X), and C is brought into (-pi, pi]:

        C     = theta - (f - f_0)
        h     = a_j - Z (X n_j + Y m_j) / (X^2 + Y^2) = (a_j - Z u_i) / (1 - Z^2)
        J_i   = [0, h^T],  J_j = [0, -h^T],  nu = f_dot
        gamma = f_ddot - h_dot . (w_i - w_j)

    h = a_j where a revolute or cylindrical joint holds a_j along the same axis of body i. Turns
    are not counted, nor need they be. An input is the rate, held between settings: the row is then
    one of the velocity level alone, and velocities jump where it is set.
    """

    keyword, rows = "drive-rot", 1
    synonyms = ("motion", "rotational-motion", "driver")
    symbol = "ring"
    drives = True
    joint: str = joint_fields("body_i", "body_j", "a_j", doc="the joint whose coordinate it drives")
    body_i: Body = body(doc="body that is turned")
    body_j: Body = body(default="ground", doc="body that the rotation is measured from")
    a_j: Vector = vector(doc="axis, on body j")
    function: str = function(doc="angle, rad, as a function of time; counted from f(0)")
    input: str = input_(instead_of="function", unit="rad/s", doc="rate of rotation")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        u = bodies["i"].to_local(bodies["j"].to_global(n))
        return {"n_j": n, "m_j": m, "u_i": u}

    def C(n_j, m_j, u_i, f, f_0):
        X, Y = dot(n_j, u_i), dot(m_j, u_i)
        c, s = cos(f - f_0), sin(f - f_0)
        return atan2(Y * c - X * s, X * c + Y * s)

    def J(a_j, u_i):
        h = turning(a_j, u_i)
        return row(ZERO, h), row(ZERO, neg(h))

    def nu(f_dot):
        return f_dot

    def gamma(a_j, u_i, a_j_dot, u_i_dot, w_i, w_j, f_ddot):
        h_dot = turning_rate(a_j, u_i, a_j_dot, u_i_dot)
        return f_ddot - dot(h_dot, sub(w_i, w_j))


class Held(DrivenRotation, input=True):
    """The rate is an input."""

    holonomic = False
    C = None

    def nu(input):
        return input

    def gamma(a_j, u_i, a_j_dot, u_i_dot, w_i, w_j):
        return -dot(turning_rate(a_j, u_i, a_j_dot, u_i_dot), sub(w_i, w_j))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [DrivenRotation]
