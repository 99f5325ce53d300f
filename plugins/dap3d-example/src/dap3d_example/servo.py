"""PI controller of a speed."""

from dap3d_core.interface import Body, Force, Vector, body, function, hookimpl, number, vector
from dap3d_core.kernels import dot, neg, scale, sub

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class Servo(Force):
    """A torque on body i about the axis a_j of body j that holds a speed, by a PI controller.

    With the error e = f(t) - a_j . (w_i - w_j) of the speed, and its integral z, a state:

        z_dot = e
        T = gain e + integral z,  moment T a_j on body i, its opposite on body j

    Unlike a controller of the angle it forgets where it began.
    """

    keyword = "servo"
    states = ("z",)
    body_i: Body = body(doc="the rotor")
    a_j: Vector = vector(doc="axis, on the body that holds the motor")
    gain: float = number(unit="N m s/rad", minimum=0.0, doc="torque for an error of the speed")
    integral: float = number(unit="N m/rad", minimum=0.0, doc="torque for its integral")
    function: str = function(doc="prescribed speed, rad/s, of time; without one: stand still")
    z_0: float = number(0.0, unit="rad", doc="initial value of the integral")

    def rate(w_i, w_j, a_j, f):
        return f - dot(a_j, sub(w_i, w_j))

    def wrench(w_i, w_j, a_j, f, z, gain, integral):
        e = f - dot(a_j, sub(w_i, w_j))
        moment = scale(gain * e + integral * z, a_j)
        return (ZERO, moment), (ZERO, neg(moment))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Servo]
