"""Actuator in a joint: a control and a force within their ranges, servo laws, activation."""

from typing import ClassVar

from dap3d_core.interface import Force, angle, choice, hookimpl, number
from dap3d_core.kernels import dot, normals, sub, where
from dap3d_forces.axial_spring import along, pull
from dap3d_forces.bounds import bounds, within
from dap3d_forces.torsion import pair
from dap3d_joints.motor import CoordinateFields

interface_version = 1


class Actuator(CoordinateFields, Force):
    """A moment or force in the coordinate q of a joint, as actuators of MJCF give it.

    With the control u, a number or the name of a function of time or of an input, kept within its
    bounds, body i is given the moment F a_j, or the force F a_j at P_i, and body j the opposite:

        F = gain u + bias - k q - c q_dot,  kept within force_min and force_max

    With ``activation`` u is replaced by a state z that follows it, within its bounds, too:

        lag:       z_dot = (u - z) / time
        integral:  z_dot = u / time

    q is the angle by which body i has turned against body j about a_j, or the length by which P_i
    has moved along a_j as seen from body j, zero in the poses of the scene; it counts turns.

    What an actuator does is work; it has no energy.
    """

    keyword = "actuator"
    symbol = "ring"
    example: ClassVar[dict[str, str]] = {"control": "2.0"}

    control: float = number(by_name=("function", "input"), doc="u")
    gain: float = number(1.0, unit="N m or N", doc="force for a control of 1")
    bias: float = number(0.0, unit="N m or N", doc="force without control where q is zero")
    k: float = number(0.0, unit="N m/rad or N/m", doc="by which the force falls with q")
    c: float = number(0.0, unit="N m s/rad or N s/m", doc="by which it falls with the rate of q")
    control_min: float = number(None, doc="least control, if any")
    control_max: float = number(None, doc="greatest control, if any")
    force_min: float = number(None, unit="N m or N", doc="least force, if any")
    force_max: float = number(None, unit="N m or N", doc="greatest force, if any")
    activation: str = choice(("none", "lag", "integral"), "none", doc="how u acts")
    activation_min: float = number(None, doc="least activation, if any")
    activation_max: float = number(None, doc="greatest activation, if any")
    time: float = number(1.0, unit="s", positive=True, doc="time constant of the activation")
    z_0: float = number(0.0, doc="initial activation")

    def prepare(self, bodies):
        numbers = bounds(self, "control", "force", "activation")
        i, j = bodies["i"], bodies["j"]
        n, _ = normals(self.a_j)
        x_0 = dot(j.to_global(self.a_j), sub(i.place(self.P_i), j.place(self.P_j)))
        return numbers | {"x_0": x_0, "n_j": n, "u_i": i.to_local(j.to_global(n))}


class Sliding(Actuator, activation="none", coordinate="length"):
    """A force along the axis of a slider."""

    def wrench(a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, x_0, control, gain, bias, k, c,
               control_min, control_max, force_min, force_max):  # fmt: skip
        x, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        u = within(control, control_min, control_max)
        F = within(gain * u + bias - k * (x - x_0) - c * rate, force_min, force_max)
        return pull(-F, a_j, s_P_i, r_P_i, r_j)


class SlidingLater(Actuator, activation="lag", coordinate="length"):
    """A force by a control that acts with a lag."""

    states = ("z",)

    def rate(control, control_min, control_max, activation_min, activation_max, time, z):
        z_dot = (within(control, control_min, control_max) - z) / time
        return kept(z_dot, z, activation_min, activation_max)

    def wrench(a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, x_0, z, gain, bias, k, c,
               force_min, force_max):  # fmt: skip
        x, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        F = within(gain * z + bias - k * (x - x_0) - c * rate, force_min, force_max)
        return pull(-F, a_j, s_P_i, r_P_i, r_j)


class SlidingOn(SlidingLater, activation="integral", coordinate="length"):
    """A force by the integral of a control."""

    def rate(control, control_min, control_max, activation_min, activation_max, time, z):
        z_dot = within(control, control_min, control_max) / time
        return kept(z_dot, z, activation_min, activation_max)


class Turning(Actuator, activation="none"):
    """A moment about the axis of a hinge."""

    theta: float = angle("n_j", "u_i", "a_j")

    def wrench(a_j, theta, theta_dot, control, gain, bias, k, c, control_min, control_max,
               force_min, force_max):  # fmt: skip
        u = within(control, control_min, control_max)
        return pair(within(gain * u + bias - k * theta - c * theta_dot, force_min, force_max), a_j)


class TurningLater(Turning, activation="lag"):
    """A moment by a control that acts with a lag."""

    states = ("z",)

    rate = SlidingLater.rate

    def wrench(a_j, theta, theta_dot, z, gain, bias, k, c, force_min, force_max):
        return pair(within(gain * z + bias - k * theta - c * theta_dot, force_min, force_max), a_j)


class TurningOn(TurningLater, activation="integral"):
    """A moment by the integral of a control."""

    rate = SlidingOn.rate


def kept(z_dot, z, least, most):
    """The rate of a state that stays within its bounds."""
    leaves = where(z >= most, z_dot > 0.0, where(z <= least, z_dot < 0.0, 0.0 > 1.0))
    return where(leaves, 0.0, z_dot)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Actuator]
