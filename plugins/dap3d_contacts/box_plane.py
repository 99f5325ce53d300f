"""The eight corners of a box at a plane."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Body, Contact, Point, Vector, body, hookimpl, point, vec3, vector
from dap3d_core.kernels import add, dot, sub

interface_version = 1


class BoxPlane(Contact):
    """The corners of a box about P_i, with edges along the axes of its body, at a plane.

    The plane goes through P_j, with normal a_j towards the box. On a plane two corners carry an
    edge, and four or three a face: nothing else of the box can touch first.

        gap = a_j . (r_Pi + corner - r_Pj),   for each of the 8 corners
    """

    keyword, points = "box_plane", 8
    surfaces: ClassVar[Mapping[str, str]] = {"i": "box"}
    body_axes = ("i",)
    body_i: Body = body(default=None, doc="body that carries the box")
    P_i: Point = point(default=None, doc="centre of the box; the mass centre when left out")
    size: tuple = vec3(unit="m", doc="lengths of its edges, along the axes of the body")
    P_j: Point = point("ground.O", doc="point of the plane")
    a_j: Vector = vector("ground.z", doc="normal of the plane, towards the box")

    def gap(r_P_i, corner_i, r_P_j, a_j):
        return dot(a_j, sub(add(r_P_i, corner_i), r_P_j))

    def at(r_P_i, corner_i):
        return add(r_P_i, corner_i)

    def normal(a_j):
        return a_j

    def prepare(self, bodies):
        """The corner of this part, in axes of the body."""
        k = int(self.part)
        signs = (2 * (k & 1) - 1, (k & 2) - 1, (k & 4) // 2 - 1)
        corner = tuple(0.5 * sign * edge for sign, edge in zip(signs, self.size, strict=True))
        return {**super().prepare(bodies), "corner_i": corner}


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BoxPlane]
