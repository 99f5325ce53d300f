"""Two balls, or a ball in a hollow one."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, choice, hookimpl, number, point
from dap3d_core.kernels import dot, scale, sqrt, sub, where

interface_version = 1


def outwards(r_P_i, r_P_j):
    """The unit vector from P_j to P_i; z where they coincide, as of a ball in a hollow one."""
    d = sub(r_P_i, r_P_j)
    apart = dot(d, d) > 0.0
    d = where(apart, d, (0.0, 0.0, 1.0))
    return scale(1.0 / sqrt(dot(d, d)), d)


class BallBall(Contact):
    """The ball about P_i at that about P_j; with ``inside`` in a hollow one about P_j.

    gap = |r_Pi - r_Pj| - radius_i - radius_j,   inside: radius_j - radius_i - |r_Pi - r_Pj|
    """

    keyword = "ball_ball"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere", "j": "shell"}
    example: ClassVar[Mapping[str, str]] = {"P_j": '"rod.O"', "radius_i": "0.1", "radius_j": "0.1"}
    P_i: Point = point(doc="centre of a ball")
    radius_i: float = number(unit="m", minimum=0.0, doc="of the ball about P_i")
    P_j: Point = point(doc="centre of the other")
    radius_j: float = number(unit="m", positive=True, doc="of the ball about P_j")
    inside: bool = choice((False, True), False, doc="the ball about P_j is hollow, and round i")

    def gap(r_P_i, r_P_j, radius_i, radius_j, side):
        d = sub(r_P_i, r_P_j)
        return side * (sqrt(dot(d, d)) - radius_j) - radius_i

    def at(r_P_i, r_P_j, radius_i, side):
        return sub(r_P_i, scale(side * radius_i, outwards(r_P_i, r_P_j)))

    def normal(r_P_i, r_P_j, side):
        return scale(side, outwards(r_P_i, r_P_j))

    def prepare(self, bodies):
        """The sign of the normal: outwards, or inwards."""
        return {**super().prepare(bodies), "side": -1.0 if self.inside else 1.0}


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BallBall]
