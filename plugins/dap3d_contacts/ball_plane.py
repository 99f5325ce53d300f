"""A ball, or a point, at a plane."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import dot, scale, sub

interface_version = 1


class BallPlane(Contact):
    """The ball of ``radius`` about P_i at the plane through P_j with normal a_j.

    A ball of no radius is a point. The ball is on the side to which a_j points.

        gap = a_j . (r_Pi - r_Pj) - radius
    """

    keyword = "ball_plane"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere"}
    P_i: Point = point(doc="centre of the ball")
    radius: float = number(0.0, unit="m", minimum=0.0, doc="of the ball; 0: a point")
    P_j: Point = point("ground.O", doc="point of the plane")
    a_j: Vector = vector("ground.z", doc="normal of the plane, towards the ball")

    def gap(r_P_i, r_P_j, a_j, radius):
        return dot(a_j, sub(r_P_i, r_P_j)) - radius

    def at(r_P_i, a_j, radius):
        return sub(r_P_i, scale(radius, a_j))

    def normal(a_j):
        return a_j


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BallPlane]
