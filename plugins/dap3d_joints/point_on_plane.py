"""Point on a plane: one coordinate of a point, along a direction fixed in ground, is prescribed."""

from dap3d_core.interface import (
    Body,
    Joint,
    Point,
    Vector,
    body,
    function,
    hookimpl,
    input_,
    number,
    point,
    vector,
)
from dap3d_core.kernels import cross, dot, row

interface_version = 1


class PointOnPlane(Joint):
    """The coordinate of P_i along a_j, a vector of ground, is length + f(t) (manual: ``rP``).

    A growing f moves the point along a_j: it increases the length of a ``tran`` of body i and
    ground. Without P_i it is the mass centre; without a function the point stays on a
    plane. One row, on body i alone:

        C     = a_j . r_Pi - length - f
        J_i   = [a_j^T, (s_i x a_j)^T],  nu = f_dot
        gamma = -a_j . (w_i x s_i_dot) + f_ddot

    The manual's gamma lacks the dot on s_i. An input is the speed along a_j, held between settings:
    the row is then one of the velocity level alone, without ``length``, and velocities jump where
    it is set.
    """

    keyword, rows = "rP", 1
    ground_axes = "a_j"
    symbol = "plate"
    body_i: Body = body(default=None, doc="the body; that of P_i when left out")
    P_i: Point = point(default=None, doc="point on body i; the mass centre when left out")
    a_j: Vector = vector(ground=True, doc="normal of the plane, on ground")
    length: float = number(unit="m", doc="coordinate along a_j where f = 0; of either sign")
    function: str = function(doc="how far the plane moves along a_j, m, as a function of time")
    input: str = input_(instead_of="function", unit="m/s", doc="speed of the plane along a_j")

    def C(a_j, r_P_i, length, f):
        return dot(a_j, r_P_i) - length - f

    def J(a_j, s_P_i):
        return (row(a_j, cross(s_P_i, a_j)),)

    def nu(f_dot):
        return f_dot

    def gamma(a_j, w_i, s_P_i_dot, f_ddot):
        return f_ddot - dot(a_j, cross(w_i, s_P_i_dot))


class Held(PointOnPlane, input=True):
    """The speed is an input."""

    holonomic = False
    C = None

    def nu(input):
        return input

    def gamma(a_j, w_i, s_P_i_dot):
        return -dot(a_j, cross(w_i, s_P_i_dot))


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [PointOnPlane]
