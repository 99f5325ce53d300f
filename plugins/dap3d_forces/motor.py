"""Motor of a given moment or force, or one that seeks a speed or a position, in a joint."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Force, angle, hookimpl, number
from dap3d_core.kernels import dot, normals, sub, tanh, where
from dap3d_forces.axial_spring import along, pull
from dap3d_forces.torsion import pair
from dap3d_joints.motor import CoordinateFields

interface_version = 1


class Motor(CoordinateFields, Force):
    """A moment or force in the coordinate of a joint, given, or as a speed or position takes it.

    ``torque`` and ``force`` are a number, or the name of a function of time or of an input. With a
    ``limit`` they saturate. Body i is given the moment T a_j, or the force F a_j at P_i, and body j
    the opposite:

        T = min(max(torque, -limit), limit)
        F = min(max(force, -limit), limit)

    A ``speed`` needs a limit. With the coordinate q, the angle by which body i has turned against
    body j about a_j, or the length by which P_i has moved along a_j as seen from body j:

        T = limit tanh((speed - q_dot) / tolerance)

    Far from the speed it is the limit, at the speed what holds it: under a load T_0 the speed is
    missed by tolerance artanh(T_0 / limit). A small tolerance is stiff, with the time constant
    I tolerance / limit of an inertia I. A ``position`` needs k, and mostly c, as of a controller
    with proportional and derivative part; with a limit it saturates:

        T = min(max(k (position - q) + c (position_dot - q_dot), -limit), limit)

    q is zero in the poses of the scene, and counts turns. An input steps, and has no rate. Under a
    load T_0 the position is missed by T_0 / k. In ``rev`` and ``cyl`` the coordinate is the angle,
    in ``tran`` the length, and wherever ``coordinate`` says so.

    What a motor does is work; it has no energy. A speed or position held whatever it takes is a
    row: the joint ``motor``.
    """

    keyword = "motor"
    synonyms = ("rotational-motor",)
    symbol = "ring"
    example: ClassVar[Mapping[str, str]] = {"torque": "2.0"}

    torque: float = number(
        default=None, unit="N m", by_name=("function", "input"), doc="moment on body i about a_j"
    )
    force: float = number(
        default=None,
        unit="N",
        by_name=("function", "input"),
        instead_of=("torque",),
        doc="force on body i along a_j",
    )
    speed: float = number(
        default=None,
        unit="rad/s or m/s",
        by_name=("function", "input"),
        instead_of=("torque", "force"),
        doc="rate of the coordinate, up to the limit",
    )
    position: float = number(
        default=None,
        unit="rad or m",
        by_name=("function", "input"),
        instead_of=("torque", "force", "speed"),
        doc="of body i, from where it is; sought by k and c",
    )
    k: float = number(
        default=None, unit="N m/rad or N/m", minimum=0.0, doc="for the error of a position"
    )
    c: float = number(
        0.0, unit="N m s/rad or N s/m", minimum=0.0, doc="for the error of a position's rate"
    )
    limit: float = number(default=None, unit="N m or N", positive=True, doc="the largest, if any")
    tolerance: float = number(
        0.01, unit="rad/s or m/s", positive=True, doc="error of the speed that takes 3/4 of limit"
    )

    def prepare(self, bodies):
        seeks = self.speed is not None or self.position is not None
        if self.torque is None and self.force is None and not seeks:
            raise ValueError("give torque, force, speed or position")
        if self.speed is not None and self.limit is None:
            raise ValueError("a speed needs a limit here; without one it is a joint motor")
        if self.position is not None and self.k is None:
            raise ValueError("a position needs k here; one that is held exactly is a joint motor")
        if not seeks and self.torque is None and self.coordinate == "angle":
            raise ValueError("the coordinate is an angle, which a torque changes: give that")
        if not seeks and self.force is None and self.coordinate == "length":
            raise ValueError("the coordinate is a length, which a force changes: give that")
        i, j = bodies["i"], bodies["j"]
        n, _ = normals(self.a_j)
        x_0 = dot(j.to_global(self.a_j), sub(i.place(self.P_i), j.place(self.P_j)))
        numbers = {"k": self.k or 0.0, "limit": self.limit or 0.0, "x_0": x_0}
        return numbers | {"n_j": n, "u_i": i.to_local(j.to_global(n))}

    def wrench(a_j, torque, limit):
        return pair(saturated(torque, limit), a_j)


class Unlimited(Motor, force=False, speed=False, position=False, limit=False):
    """It turns about its axis, whatever the moment."""

    actuates = "torque"

    def wrench(a_j, torque):
        return pair(torque, a_j)


class UnlimitedPushing(Motor, force=True, speed=False, position=False, limit=False):
    """It pushes along its axis, whatever the force."""

    actuates = "force"

    def wrench(a_j, s_P_i, r_P_i, r_j, force):
        return pull(-force, a_j, s_P_i, r_P_i, r_j)


class Pushing(Motor, force=True, speed=False, position=False):
    """It pushes along its axis."""

    def wrench(a_j, s_P_i, r_P_i, r_j, force, limit):
        return pull(-saturated(force, limit), a_j, s_P_i, r_P_i, r_j)


class PushingAt(Motor, force=False, speed=True, position=False, coordinate="length"):
    """It moves along its axis at a speed."""

    def wrench(a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, speed, limit, tolerance):
        _, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(-limit * tanh((speed - rate) / tolerance), a_j, s_P_i, r_P_i, r_j)


class TurningAt(Motor, force=False, speed=True, position=False):
    """It turns at a speed."""

    def wrench(a_j, w_i, w_j, speed, limit, tolerance):
        error = speed - dot(a_j, sub(w_i, w_j))
        return pair(limit * tanh(error / tolerance), a_j)


class UnlimitedPushingTo(
    Motor, force=False, speed=False, position=True, coordinate="length", limit=False
):
    """It seeks a position along its axis, whatever the force."""

    def wrench(a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, x_0, position, position_dot, k, c):
        x, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        F = k * (position - (x - x_0)) + c * (position_dot - rate)
        return pull(-F, a_j, s_P_i, r_P_i, r_j)


class PushingTo(Motor, force=False, speed=False, position=True, coordinate="length"):
    """It seeks a position along its axis."""

    def wrench(
        a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, x_0, position, position_dot, k, c, limit
    ):
        x, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        F = saturated(k * (position - (x - x_0)) + c * (position_dot - rate), limit)
        return pull(-F, a_j, s_P_i, r_P_i, r_j)


class UnlimitedTurningTo(Motor, force=False, speed=False, position=True, limit=False):
    """It seeks an angle, of which it counts turns, whatever the moment."""

    theta: float = angle("n_j", "u_i", "a_j")

    def wrench(a_j, theta, theta_dot, position, position_dot, k, c):
        return pair(k * (position - theta) + c * (position_dot - theta_dot), a_j)


class TurningTo(UnlimitedTurningTo, force=False, speed=False, position=True):
    """It seeks an angle, of which it counts turns."""

    def wrench(a_j, theta, theta_dot, position, position_dot, k, c, limit):
        return pair(saturated(k * (position - theta) + c * (position_dot - theta_dot), limit), a_j)


def saturated(value, limit):
    """The value, of no more than the limit in size."""
    return where(value > limit, limit, where(value < -limit, -limit, value))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Motor]
