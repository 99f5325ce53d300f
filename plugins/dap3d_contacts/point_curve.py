"""A point, or a roller, at a plane curve: cams, grooves, rails."""

import math

from dap3d_contacts.ball_surface import LEFT, seen_from
from dap3d_core.interface import (
    REQUIRED,
    Contact,
    Point,
    choice,
    function,
    hookimpl,
    number,
    point,
)
from dap3d_core.kernels import add, atan2, cos, root, rotate, sin, sqrt, where

interface_version = 1


def height(s, f, f_dot, f_ddot):
    """The curve y = f(s) at x = s, and its first two derivatives."""
    return (s, f(s)), (1.0, f_dot(s)), (0.0, f_ddot(s))


def polar(s, f, f_dot, f_ddot):
    """The curve at the distance f(s) from the origin in the direction s."""
    e, t = (cos(s), sin(s)), (-sin(s), cos(s))
    r, slope = f(s), f_dot(s)
    first = tuple(slope * a + r * b for a, b in zip(e, t, strict=True))
    second = tuple((f_ddot(s) - r) * a + 2.0 * slope * b for a, b in zip(e, t, strict=True))
    return (r * e[0], r * e[1]), first, second


def nearest(place, start, side, curve):
    """The signed distance of a place from a curve, the normal and the point nearest to it.

    By Newton from a start; ``side`` 1: the normal is to the left of the curve. Where there is no
    near point, the distance from that of the start, and no normal.
    """
    X, Y, Z = place

    def from_curve(s):
        point, first, _ = curve(s)
        size = sqrt(first[0] * first[0] + first[1] * first[1])
        n = (-side * first[1] / size, side * first[0] / size)
        return (X - point[0]) * n[0] + (Y - point[1]) * n[1], n, point

    def off(s):
        point, first, _ = curve(s)
        return ((X - point[0]) * first[0] + (Y - point[1]) * first[1],)

    def slope(s):
        point, first, second = curve(s)
        d = X - point[0], Y - point[1]
        square = first[0] * first[0] + first[1] * first[1]
        return ((d[0] * second[0] + d[1] * second[1] - square,),)

    (s,), left = root((start,), off, slope)
    d, n, point = from_curve(s)
    found = where(left < LEFT, 1.0, math.nan)
    about = from_curve(start)[0]
    normal = (found * n[0], found * n[1], 0.0)
    return where(left < LEFT, d, about), normal, (point[0], point[1], Z)


def of_height(place, side, f, f_dot, f_ddot):
    """``nearest``, of the curve y = f(x)."""
    return nearest(place, place[0], side, lambda s: height(s, f, f_dot, f_ddot))


def of_polar(place, side, f, f_dot, f_ddot):
    """``nearest``, of the curve r = f(angle), whose left side is the inside."""
    start = atan2(place[1], place[0])
    return nearest(place, start, -side, lambda s: polar(s, f, f_dot, f_ddot))


def kernels_of(curve):
    """Gap, point of contact and normal at a curve; curve: ``of_height`` or ``of_polar``."""

    def gap(r_P_i, r_P_j, A_j, radius, sense, f, f_dot, f_ddot):
        return curve(seen_from(r_P_i, r_P_j, A_j), sense, f, f_dot, f_ddot)[0] - radius

    def at(r_P_i, r_P_j, A_j, sense, f, f_dot, f_ddot):
        found = curve(seen_from(r_P_i, r_P_j, A_j), sense, f, f_dot, f_ddot)[2]
        return add(r_P_j, rotate(A_j, found))

    def normal(r_P_i, r_P_j, A_j, sense, f, f_dot, f_ddot):
        return rotate(A_j, curve(seen_from(r_P_i, r_P_j, A_j), sense, f, f_dot, f_ddot)[1])

    return gap, at, normal


class PointCurve(Contact):
    """The point P_i, or a roller of ``radius`` about it, at a curve in the x-y plane of body j.

    The curve is y = f(x) from P_j, or with ``polar``, as of a cam, the distance r = f(angle) from
    P_j over the angle from x to y, rad. ``side`` above is y > f(x), or outside. The curve goes on
    along z, as that of a plate: where P_i is along z has no part.
    f is smooth, of period 2 pi where it is polar, and bends less than a roller where that touches.

        gap = distance of P_i from the curve - radius,   less than nothing on the other side
    """

    keyword = "point_curve"
    P_i: Point = point(doc="the point, centre of the roller")
    radius: float = number(0.0, unit="m", minimum=0.0, doc="of the roller; 0: a point")
    P_j: Point = point("ground.O", doc="origin of the curve")
    function: str = function(REQUIRED, argument="x, m, or angle, rad", doc="the curve, m")
    polar: bool = choice((False, True), False, doc="f is the distance from P_j over the angle")
    side: str = choice(("above", "below"), "above", doc="where P_i is; above: outside of a cam")

    def prepare(self, bodies):
        """The sign of the normal."""
        return {**super().prepare(bodies), "sense": 1.0 if self.side == "above" else -1.0}

    gap, at, normal = kernels_of(of_height)


class PointCam(PointCurve, polar=True):
    """The curve is polar."""

    gap, at, normal = kernels_of(of_polar)


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [PointCurve]
