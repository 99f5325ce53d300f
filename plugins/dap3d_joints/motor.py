"""Motor that holds the speed or the position of a joint, whatever moment or force that takes."""

from collections.abc import Mapping
from typing import ClassVar

import attrs

from dap3d_core.interface import (
    Body,
    Joint,
    Point,
    Vector,
    angle,
    body,
    choice,
    hookimpl,
    joint_fields,
    number,
    point,
    vector,
)
from dap3d_core.kernels import atan2, cos, dot, neg, normals, row, sin, sub
from dap3d_joints.relative_rows import offset_gamma, offset_rows, turning, turning_rate

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class CoordinateFields:
    """Fields of what moves the coordinate of a joint."""

    joint: str = joint_fields(
        "body_i", "body_j", "P_i", "P_j", "a_j", facts=("coordinate",), doc="joint that it moves"
    )
    body_i: Body = body(default=None, doc="body that is moved; that of P_i")
    body_j: Body = body(default=None, doc="body that holds what moves it; that of P_j and a_j")
    P_i: Point = point(default=None, doc="on body i; the mass centre when left out")
    P_j: Point = point(default=None, doc="on body j; the mass centre when left out")
    a_j: Vector = vector(doc="axis, on body j")
    coordinate: str = choice(("angle", "length"), None, doc="the joint's when left out, else angle")


attrs.define(CoordinateFields, slots=False, kw_only=True)


class Motor(CoordinateFields, Joint):
    """A motor in a joint prescribes its coordinate q, or the rate of it.

    q is the angle theta by which body i has turned against body j about a_j, or the length x by
    which P_i has moved along a_j as seen from body j, as the joint reports them: zero in the poses
    of the scene. A motor in ``rev`` and ``cyl`` acts on the angle, in ``tran`` on the length; else
    ``coordinate`` says on which. The rows are those of ``drive-rot`` and ``drive-tran``:

        C  = q - position,  nu = position_dot
        nu = speed

    C of an angle is brought into (-pi, pi]; of a speed there is no C, the row is one of the
    velocity level alone. Both are a number, or the name of a function of time or of an input, held
    between settings. Where a speed is set velocities jump. Where a position is set bodies do not:
    the motor takes them there as a servo does, without an error that stays, critically damped by
    the time constant ``lag``; its ``pace`` is a state:

        nu = pace,  pace_dot = (position - q) / lag^2 - 2 pace / lag

    q then counts turns. The multiplier is the moment or force of the motor on body i, of any size.
    One with a largest moment is the force ``motor``, with a ``limit``.
    """

    keyword, rows = "motor", 1
    synonyms = ("rotational-motor",)
    symbol = "ring"
    drives = True
    example: ClassVar[Mapping[str, str]] = {"position": "0.5"}

    position: float = number(
        default=None,
        unit="rad or m",
        by_name=("function", "input"),
        doc="of body i, from where it is",
    )
    speed: float = number(
        default=None,
        unit="rad/s or m/s",
        by_name=("function", "input"),
        instead_of=("position",),
        doc="rate of the coordinate",
    )
    lag: float = number(
        0.05, unit="s", positive=True, doc="time constant of a position that is an input"
    )

    def prepare(self, bodies):
        if self.position is None and self.speed is None:
            raise ValueError("give position or speed; a motor of a given torque is a force motor")
        i, j = bodies["i"], bodies["j"]
        n, m = normals(self.a_j)
        x_0 = dot(j.to_global(self.a_j), sub(i.place(self.P_i), j.place(self.P_j)))
        return {"n_j": n, "m_j": m, "u_i": i.to_local(j.to_global(n)), "x_0": x_0}

    def C(n_j, m_j, u_i, position):
        X, Y, c, s = dot(n_j, u_i), dot(m_j, u_i), cos(position), sin(position)
        return atan2(Y * c - X * s, X * c + Y * s)

    def J(a_j, u_i):
        h = turning(a_j, u_i)
        return row(ZERO, h), row(ZERO, neg(h))

    def nu(position_dot):
        return position_dot

    def gamma(a_j, u_i, a_j_dot, u_i_dot, w_i, w_j, position_ddot):
        return position_ddot - dot(turning_rate(a_j, u_i, a_j_dot, u_i_dot), sub(w_i, w_j))


class MovedTo(Motor, position="input", coordinate="length"):
    """It moves along its axis to a place that is set."""

    holonomic = False
    C = None
    states = ("pace",)

    def J(a_j, s_P_i, r_P_i, r_j):
        return offset_rows(a_j, s_P_i, r_P_i, r_j)

    def nu(pace):
        return pace

    def gamma(
        a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j, x_0, position,
        lag, pace,
    ):  # fmt: skip
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        bend = offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j)
        return quickening(position + x_0 - dot(a_j, d), pace, lag) + bend

    def rate(a_j, r_P_i, r_P_j, x_0, position, lag, pace):
        return quickening(position + x_0 - dot(a_j, sub(r_P_i, r_P_j)), pace, lag)


class TurnedTo(Motor, position="input"):
    """It turns to an angle that is set."""

    holonomic = False
    C = None
    states = ("pace",)
    theta: float = angle("n_j", "u_i", "a_j")

    def nu(pace):
        return pace

    def gamma(a_j, u_i, a_j_dot, u_i_dot, w_i, w_j, theta, position, lag, pace):
        bend = dot(turning_rate(a_j, u_i, a_j_dot, u_i_dot), sub(w_i, w_j))
        return quickening(position - theta, pace, lag) - bend

    def rate(theta, position, lag, pace):
        return quickening(position - theta, pace, lag)


class Moved(Motor, speed=False, coordinate="length"):
    """It moves along its axis."""

    def C(a_j, r_P_i, r_P_j, x_0, position):
        return dot(a_j, sub(r_P_i, r_P_j)) - x_0 - position

    def J(a_j, s_P_i, r_P_i, r_j):
        return offset_rows(a_j, s_P_i, r_P_i, r_j)

    def gamma(
        a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j, position_ddot
    ):
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        return position_ddot + offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j)


class MovedAt(Moved, speed=True, coordinate="length"):
    """It moves along its axis at a speed."""

    holonomic = False
    C = None

    def nu(speed):
        return speed

    def gamma(a_j, a_j_dot, r_P_i, r_P_j, v_P_i, v_P_j, s_P_i_dot, s_P_j_dot, w_i, w_j, speed_dot):
        d, d_dot = sub(r_P_i, r_P_j), sub(v_P_i, v_P_j)
        return speed_dot + offset_gamma(a_j, a_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j)


class TurningAt(Motor, speed=True):
    """It turns at a speed."""

    holonomic = False
    C = None

    def nu(speed):
        return speed

    def gamma(a_j, u_i, a_j_dot, u_i_dot, w_i, w_j, speed_dot):
        return speed_dot - dot(turning_rate(a_j, u_i, a_j_dot, u_i_dot), sub(w_i, w_j))


def quickening(error, pace, lag):
    """The rate of the pace of a servo, critically damped."""
    return (error / lag - 2.0 * pace) / lag


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Motor]
