"""A limit of the coordinate of a joint."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Body,
    Contact,
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
from dap3d_core.kernels import dot, normals, scale, sub

interface_version = 1


class JointLimit(Contact):
    """The coordinate q of a joint stays on one side of a bound, without friction.

    q is the length by which P_i has moved along a_j as seen from body j, or the angle by which body
    i has turned against body j about a_j, and counts turns; it is zero in the poses of the scene.
    ``lower`` and ``upper`` of a joint make such limits, NAME_lower and NAME_upper.

        gap = q - bound,   side "upper": bound - q
    """

    keyword, is_smooth = "joint_limit", True
    symbol = "ring"
    example: ClassVar[Mapping[str, str]] = {"bound": "-1.0"}
    joint: str = joint_fields(
        "body_i", "body_j", "P_i", "P_j", "a_j", facts=("coordinate",), doc="joint that it limits"
    )
    body_i: Body = body(default=None, doc="body that moves; that of P_i")
    body_j: Body = body(default=None, doc="the other; that of P_j and a_j")
    P_i: Point = point(default=None, doc="on body i; the mass centre when left out")
    P_j: Point = point(default=None, doc="on body j; the mass centre when left out")
    a_j: Vector = vector(doc="axis, on body j")
    coordinate: str = choice(("angle", "length"), None, doc="the joint's when left out, else angle")
    bound: float = number(unit="rad or m", doc="least or greatest value of the coordinate")
    side: str = choice(("lower", "upper"), "lower", doc="whether it is the least or the greatest")

    def prepare(self, bodies):
        """The poses in which q is zero, and the sign of the gap."""
        i, j = bodies["i"], bodies["j"]
        n, _ = normals(self.a_j)
        x_0 = dot(j.to_global(self.a_j), sub(i.place(self.P_i), j.place(self.P_j)))
        sense = 1.0 if self.side == "lower" else -1.0
        return {"sense": sense, "x_0": x_0, "n_j": n, "u_i": i.to_local(j.to_global(n))}

    theta: float = angle("n_j", "u_i", "a_j")

    def gap(theta, bound, sense):
        return sense * (theta - bound)

    def normal(a_j, sense):
        return scale(sense, a_j)


class LengthLimit(JointLimit, coordinate="length"):
    """The coordinate is a length."""

    def gap(r_P_i, r_P_j, a_j, x_0, bound, sense):
        return sense * (dot(a_j, sub(r_P_i, r_P_j)) - x_0 - bound)

    def at(r_P_i):
        return r_P_i


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [JointLimit]
