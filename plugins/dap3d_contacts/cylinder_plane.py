"""A cylinder at a plane: on its rims, its side or a cap; and a disk."""

import math
from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import add, cross, dot, scale, sqrt, sub, where

interface_version = 1
#: Points of what lies flat; sine of the tilt below which they touch, and half of it, below which a
#: rim does not, so that what falls flat is met by points whose gap has no kink there. Below half of
#: that a rim has no lowest point. No step that locates an event may pass over all of it.
FLAT, UPRIGHT = 8, 1e-7
#: Sine of the tilt below which points across the rim are seen as well.
NEARLY_UPRIGHT = 0.05


def tilt(a_i, a_j):
    """What of the normal of the plane lies across the axis, and the square of its length."""
    across = cross(a_i, cross(a_j, a_i))  # without rounding where they are nearly parallel
    return across, dot(across, across)


def upright(a_i, a_j):
    """Not negative while the cap lies on the plane."""
    return UPRIGHT - tilt(a_i, a_j)[1] / UPRIGHT


def across_rim(gap, radius, a_i, a_j):
    """Not negative of a point of the cap that is high, or as deep as if the cap had tipped over.

    In the gaps of these a passage of the level of the plane is seen; a rim never rolls over them.
    """
    sine = sqrt(tilt(a_i, a_j)[1])
    away = where(gap < 0.0, -gap, gap) - 0.5 * radius * sine
    return where(sine < NEARLY_UPRIGHT, away, -1.0)


def lowest(r_P_i, a_i, spoke_i, a_j, radius, length, end):
    """A point of part ``end``: -1, 1 the lowest of a rim, else one of the cap that is lower.

    Of a cylinder that stands upright the lowest of a rim is the centre of its cap: out of reach.
    """
    across, square = tilt(a_i, a_j)
    tilts = square > (0.25 * UPRIGHT) ** 2
    rim = scale(where(tilts, -radius / sqrt(where(tilts, square, 1.0)), 0.0), across)
    of_rim = is_rim(end)
    way = where(of_rim, end, where(dot(a_j, a_i) > 0.0, -1.0, 1.0))
    arm = where(of_rim, rim, scale(radius, spoke_i))
    return add(add(r_P_i, scale(0.5 * way * length, a_i)), arm)


def is_rim(end):
    """True of the parts that are rims."""
    return (end > 0.5) | (end < -0.5)


class DiskPlane(Contact):
    """The rim of a thin disk of ``radius`` about P_i, with axis a_i, at a plane: wheel, knife edge.

    The plane goes through P_j, with normal a_j towards the disk, which touches it with the lowest
    point of its rim, and where it lies flat with eight, the first of them along the axis of the
    body that is farthest from a_i. It rolls, slides and lifts off; the joint ``disk`` rolls or
    slides as its rows say, and stays.

        gap = a_j . (r_Pi - r_Pj) - radius sin(tilt),   and of 8 points of the disk that lies
    """

    keyword, points, rims = "disk_plane", 1 + FLAT, (1.0,)
    surfaces: ClassVar[Mapping[str, str]] = {"i": "disk"}
    body_axes = ("i",)  # the points of a cap
    example: ClassVar[Mapping[str, str]] = {
        "P_j": '"ground.O"', "a_j": '"ground.z"', "radius": "0.1",
    }  # fmt: skip
    P_i: Point = point(doc="centre")
    a_i: Vector = vector(doc="axis")
    radius: float = number(unit="m", positive=True, doc="of the rim")
    P_j: Point = point("ground.O", doc="point of the plane")
    a_j: Vector = vector("ground.z", doc="normal of the plane, towards the body")

    def gap(r_P_i, a_i, spoke_i, r_P_j, a_j, radius, length, end):
        low = lowest(r_P_i, a_i, spoke_i, a_j, radius, length, end)
        return dot(a_j, sub(low, r_P_j))

    def at(r_P_i, a_i, spoke_i, a_j, radius, length, end):
        return lowest(r_P_i, a_i, spoke_i, a_j, radius, length, end)

    def normal(a_j):
        return a_j

    def reach(r_P_i, a_i, spoke_i, r_P_j, a_j, radius, length, end):
        flat = upright(a_i, a_j)
        point = lowest(r_P_i, a_i, spoke_i, a_j, radius, length, end)
        of_cap = where(flat < 0.0, across_rim(dot(a_j, sub(point, r_P_j)), radius, a_i, a_j), flat)
        return where(is_rim(end), 0.75 * UPRIGHT - flat, of_cap)

    def prepare(self, bodies):
        """The rim of the first parts, the spoke of the others, in axes of the body."""
        k = int(self.part) - len(self.rims)
        a = self.a_i
        far = min(range(3), key=lambda m: abs(a[m]))
        first = [(m == far) - a[far] * a[m] for m in range(3)]
        size = math.sqrt(sum(x * x for x in first))
        u = [x / size for x in first]
        v = [a[m - 2] * u[m - 1] - a[m - 1] * u[m - 2] for m in range(3)]
        turn = 2.0 * math.pi * k / FLAT
        spoke = tuple(math.cos(turn) * x + math.sin(turn) * y for x, y in zip(u, v, strict=True))
        part = {"spoke_i": spoke, "end": self.rims[k] if k < 0 else 0.0}
        return {**super().prepare(bodies), **part, "length": getattr(self, "length", 0.0)}


class CylinderPlane(DiskPlane):
    """The cylinder of ``radius`` and ``length`` about P_i, with axis a_i, at a plane.

    The plane goes through P_j, with normal a_j towards the cylinder. It rolls on the lowest point
    of a rim, lies on those of both, and stands on its cap, which eight points of its rim carry, the
    first of them along the axis of the body that is farthest from a_i: a load that tips it does so
    at its rim itself where it acts towards one of them, and at 0.92 of it between two.

        gap = a_j . (r_Pi +- length / 2 a_i - r_Pj) - radius sin(tilt),   and of 8 points of the cap
    """

    keyword, points, rims = "cylinder_plane", 2 + FLAT, (-1.0, 1.0)
    surfaces: ClassVar[Mapping[str, str]] = {"i": "cylinder"}
    body_axes = ("i",)  # the points of a cap
    example: ClassVar[Mapping[str, str]] = {**DiskPlane.example, "length": "0.2"}
    length: float = number(unit="m", positive=True, doc="of the cylinder, from cap to cap")


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [CylinderPlane, DiskPlane]
