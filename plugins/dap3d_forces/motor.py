"""Motor of a given moment, force, or speed up to a limit, in a joint."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Body,
    Force,
    Point,
    Vector,
    body,
    choice,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import dot, sub, tanh, where
from dap3d_forces.axial_spring import along, pull
from dap3d_forces.torsion import pair

interface_version = 1

#: A limit that is none.
UNLIMITED = 1e100


class Motor(Force):
    """A moment or force in the coordinate of a joint, given, or as a speed takes it.

    ``torque`` and ``force`` are a number, or the name of a function of time or of an input. With a
    ``limit`` they saturate. Body i is given the moment T a_j, or the force F a_j at P_i, and body j
    the opposite:

        T = min(max(torque, -limit), limit)
        F = min(max(force, -limit), limit)

    A ``speed`` needs a limit. With the rate q_dot of the coordinate, the angle of body i against
    body j about a_j, or how far P_i is along a_j as seen from body j:

        T = limit tanh((speed - q_dot) / tolerance)

    Far from the speed it is the limit, at the speed what holds it: under a load T_0 the speed is
    missed by tolerance artanh(T_0 / limit). A small tolerance is stiff, with the time constant
    I tolerance / limit of an inertia I. In ``rev`` and ``cyl`` the coordinate is the angle, in
    ``tran`` the length, and wherever ``coordinate`` says so.

    What a motor does is work; it has no energy. Without a limit a speed, and a position, are rows:
    the joint ``motor``. A position within a limit takes a controller that sets the torque.
    """

    keyword = "motor"
    synonyms = ("actuator", "rotational-motor")
    symbol = "ring"
    example: ClassVar[Mapping[str, str]] = {"torque": "2.0"}
    joint: str = joint_fields(
        "body_i", "body_j", "P_i", "P_j", "a_j", facts=("coordinate",), doc="joint that it moves"
    )
    body_i: Body = body(default=None, doc="body that is moved; that of P_i")
    body_j: Body = body(default=None, doc="body that holds the motor; that of P_j and a_j")
    P_i: Point = point(default=None, doc="on body i; the mass centre when left out")
    P_j: Point = point(default=None, doc="on body j; the mass centre when left out")
    a_j: Vector = vector(doc="axis, on body j")
    coordinate: str = choice(("angle", "length"), None, doc="the joint's when left out, else angle")
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
    limit: float = number(default=None, unit="N m or N", positive=True, doc="the largest, if any")
    tolerance: float = number(
        0.01, unit="rad/s or m/s", positive=True, doc="error of the speed that takes 3/4 of limit"
    )

    def prepare(self, bodies):
        if self.torque is None and self.force is None and self.speed is None:
            raise ValueError("give torque, force or speed; a position is held by a joint motor")
        if self.speed is not None and self.limit is None:
            raise ValueError("a speed needs a limit here; without one it is a joint motor")
        if self.speed is None and self.torque is None and self.coordinate == "angle":
            raise ValueError("the coordinate is an angle, which a torque changes: give that")
        if self.speed is None and self.force is None and self.coordinate == "length":
            raise ValueError("the coordinate is a length, which a force changes: give that")
        return {"limit": UNLIMITED if self.limit is None else self.limit}

    def wrench(a_j, torque, limit):
        return pair(saturated(torque, limit), a_j)


class Pushing(Motor, force=True, speed=False):
    """It pushes along its axis."""

    def wrench(a_j, s_P_i, r_P_i, r_j, force, limit):
        return pull(-saturated(force, limit), a_j, s_P_i, r_P_i, r_j)


class PushingAt(Motor, force=False, speed=True, coordinate="length"):
    """It moves along its axis at a speed."""

    def wrench(
        a_j, s_P_i, r_P_i, r_P_j, v_P_i, v_P_j, r_j, w_j, speed, limit, tolerance
    ):  # fmt: skip
        _, rate = along(a_j, r_P_i, r_P_j, v_P_i, v_P_j, w_j)
        return pull(-limit * tanh((speed - rate) / tolerance), a_j, s_P_i, r_P_i, r_j)


class TurningAt(Motor, force=False, speed=True):
    """It turns at a speed."""

    def wrench(a_j, w_i, w_j, speed, limit, tolerance):
        error = speed - dot(a_j, sub(w_i, w_j))
        return pair(limit * tanh(error / tolerance), a_j)


def saturated(value, limit):
    """The value, of no more than the limit in size."""
    return where(value > limit, limit, where(value < -limit, -limit, value))


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Motor]
