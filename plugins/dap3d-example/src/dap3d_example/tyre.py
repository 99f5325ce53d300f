"""Side force of a tyre with relaxation."""

from dap3d_core.interface import Force, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import abs, cross, dot, scale, tanh

interface_version = 1

UP = (0.0, 0.0, 1.0)


class Tyre(Force):
    """Side force of a tyre on level ground at P_i, which builds up over a length of way.

    Pacejka, Tyre and Vehicle Dynamics, chapter 7. v_x and v_y are the velocities of P_i along the
    heading a_i of the wheel and to its left, alpha the slip angle of the carcass, a state:

        alpha_dot = -(v_y + |v_x| alpha) / sigma
        F = mu load tanh(stiffness alpha / (mu load)),  to the left

    At constant v_x it follows -v_y / |v_x| over the relaxation length sigma; standing still is no
    special case. ``|v_x|`` has a corner where the wheel turns back, at which steps get short.
    """

    keyword = "tyre"
    states = ("alpha",)
    ground_axes = "z"
    P_i: Point = point(doc="contact point")
    a_i: Vector = vector(doc="heading of the wheel")
    load: float = number(unit="N", positive=True, doc="load of the wheel")
    stiffness: float = number(unit="N/rad", positive=True, doc="cornering stiffness")
    sigma: float = number(unit="m", positive=True, doc="relaxation length")
    mu: float = number(1.0, positive=True, doc="coefficient of friction")
    alpha_0: float = number(0.0, unit="rad", doc="initial slip angle")

    def rate(v_P_i, a_i, alpha, sigma):
        along, left = dot(v_P_i, a_i), dot(v_P_i, cross(UP, a_i))
        return -(left + abs(along) * alpha) / sigma

    def wrench(s_P_i, a_i, alpha, load, stiffness, mu):
        most = mu * load
        F = scale(most * tanh(stiffness * alpha / most), cross(UP, a_i))
        return F, cross(s_P_i, F)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Tyre]
