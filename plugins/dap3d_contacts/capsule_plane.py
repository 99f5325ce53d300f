"""A capsule at a plane."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import dot, scale, sub, where

interface_version = 1


def end_of(r_P_i, r_Q_i, end):
    """The end that a part is about."""
    return where(end > 0.5, r_Q_i, r_P_i)


class CapsulePlane(Contact):
    """The capsule of ``radius`` about the line from P_i to Q_i, by the balls at its ends.

    The plane goes through P_j, with normal a_j towards the capsule: one that lies on it touches
    with both ends.

        gap = a_j . (r_Pi - r_Pj) - radius,   and the same of Q_i
    """

    keyword, points = "capsule_plane", 2
    surfaces: ClassVar[Mapping[str, str]] = {"i": "capsule"}
    example: ClassVar[Mapping[str, str]] = {"radius": "0.0"}
    P_i: Point = point(doc="centre of one end")
    Q_i: Point = point(doc="centre of the other")
    radius: float = number(unit="m", minimum=0.0, doc="of the capsule")
    P_j: Point = point("ground.O", doc="point of the plane")
    a_j: Vector = vector("ground.z", doc="normal of the plane, towards the capsule")

    def gap(r_P_i, r_Q_i, r_P_j, a_j, radius, end):
        return dot(a_j, sub(end_of(r_P_i, r_Q_i, end), r_P_j)) - radius

    def at(r_P_i, r_Q_i, a_j, radius, end):
        return sub(end_of(r_P_i, r_Q_i, end), scale(radius, a_j))

    def normal(a_j):
        return a_j

    def prepare(self, bodies):
        """The end of this part, 0 or 1."""
        return {**super().prepare(bodies), "end": float(self.part)}


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [CapsulePlane]
