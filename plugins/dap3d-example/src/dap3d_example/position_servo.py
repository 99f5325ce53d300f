"""Motor with a controller of its speed and angle."""

from dap3d_core.interface import (
    Body,
    Force,
    Vector,
    angle,
    body,
    function,
    hookimpl,
    number,
    vector,
)
from dap3d_core.kernels import neg, normals, scale, tanh

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class PositionServo(Force):
    """A torque on body i, the rotor, about the axis a_j of body j, which follows a prescribed turn.

    theta is the angle of the rotor against body j about a_j, counted over whole turns from the
    poses as given, f the prescribed angle as a function of time:

        u = gain (f_dot - theta_dot) + integral (f - f(0) - theta)
        T = torque_max tanh(u / torque_max),  moment T a_j on body i, its opposite on body j

    f_dot is the prescribed speed, and the integral of its error is the error of the angle: this is
    a controller with proportional and integral part. No more than torque_max comes out of it, and
    near that smoothly, so that no step of the integration meets a corner. What the torque does is
    work; there is no energy.
    """

    keyword = "position-servo"
    body_i: Body = body(doc="the rotor")
    a_j: Vector = vector(doc="axis, on the body that holds the motor")
    gain: float = number(unit="N m s/rad", minimum=0.0, doc="torque for an error of the speed")
    integral: float = number(0.0, unit="N m/rad", minimum=0.0, doc="torque for one of the angle")
    torque_max: float = number(unit="N m", positive=True, doc="the largest torque")
    function: str = function(doc="prescribed angle, rad, of time; without one: stand still")
    theta: float = angle("n_j", "u_i", "a_j")

    def prepare(self, bodies):
        n, _ = normals(self.a_j)
        return {"n_j": n, "u_i": bodies["i"].to_local(bodies["j"].to_global(n))}

    def wrench(a_j, theta, theta_dot, f, f_0, f_dot, gain, integral, torque_max):
        u = gain * (f_dot - theta_dot) + integral * (f - f_0 - theta)
        moment = scale(torque_max * tanh(u / torque_max), a_j)
        return (ZERO, moment), (ZERO, neg(moment))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [PositionServo]
