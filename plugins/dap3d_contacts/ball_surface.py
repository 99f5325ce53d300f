"""A ball, or a point, at a surface z = f(x, y)."""

import math
from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import REQUIRED, Contact, Point, choice, function, hookimpl, number, point
from dap3d_core.kernels import add, root, rotate, scale, sqrt, sub, transpose, where

interface_version = 1
#: What the last pass may change of the nearest point, m: more is not found.
LEFT = 1e-10


def seen_from(r_P_i, r_P_j, A_j):
    """P_i from P_j, in axes of body j."""
    return rotate(transpose(A_j), sub(r_P_i, r_P_j))


def nearest(place, side, radius, f, f_x, f_y, f_xx, f_xy, f_yy):
    """The signed distance of a place from the surface, the normal and the point nearest to it.

    By Newton from the point below. Where there is none near, a distance that is about right, and no
    normal.
    """
    X, Y, Z = place
    slope_x, slope_y = f_x(X, Y), f_y(X, Y)
    size = sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    about = side * (Z - f(X, Y)) / size
    step = side * where(about > radius, radius, about) / size

    def off(x, y):
        h = Z - f(x, y)
        return X - x + h * f_x(x, y), Y - y + h * f_y(x, y)

    def slopes(x, y):
        h, a, b = Z - f(x, y), f_x(x, y), f_y(x, y)
        mixed = h * f_xy(x, y) - a * b
        return (h * f_xx(x, y) - 1.0 - a * a, mixed), (mixed, h * f_yy(x, y) - 1.0 - b * b)

    (x, y), left = root((X + step * slope_x, Y + step * slope_y), off, slopes)
    a, b, z = f_x(x, y), f_y(x, y), f(x, y)
    found = where(left < LEFT, 1.0, math.nan)
    n = scale(found * side / sqrt(1.0 + a * a + b * b), (-a, -b, 1.0))
    d = (X - x) * n[0] + (Y - y) * n[1] + (Z - z) * n[2]
    return where(left < LEFT, d, about), n, (x, y, z)


class BallSurface(Contact):
    """The ball of ``radius`` about P_i at the surface z = f(x, y), in axes of body j, from P_j.

    A ball of no radius is a point. The surface is smooth, as of ``grid``, and bends less than the
    ball where that touches it, which is at one point: the one that is nearest to P_i.

        gap = distance of P_i from the surface - radius,   less than nothing on the other side
    """

    keyword = "ball_surface"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere"}
    P_i: Point = point(doc="centre of the ball")
    radius: float = number(0.0, unit="m", minimum=0.0, doc="of the ball; 0: a point")
    P_j: Point = point("ground.O", doc="where x, y and z are zero")
    function: str = function(REQUIRED, argument=("x, m,", "y, m"), doc="height z of the surface, m")
    side: str = choice(("above", "below"), "above", doc="where the ball is")

    def prepare(self, bodies):
        """The sign of the normal."""
        return {**super().prepare(bodies), "sense": 1.0 if self.side == "above" else -1.0}

    def gap(r_P_i, r_P_j, A_j, radius, sense, f, f_x, f_y, f_xx, f_xy, f_yy):
        place = seen_from(r_P_i, r_P_j, A_j)
        return nearest(place, sense, radius, f, f_x, f_y, f_xx, f_xy, f_yy)[0] - radius

    def at(r_P_i, r_P_j, A_j, radius, sense, f, f_x, f_y, f_xx, f_xy, f_yy):
        place = seen_from(r_P_i, r_P_j, A_j)
        found = nearest(place, sense, radius, f, f_x, f_y, f_xx, f_xy, f_yy)[2]
        return add(r_P_j, rotate(A_j, found))

    def normal(r_P_i, r_P_j, A_j, radius, sense, f, f_x, f_y, f_xx, f_xy, f_yy):
        place = seen_from(r_P_i, r_P_j, A_j)
        return rotate(A_j, nearest(place, sense, radius, f, f_x, f_y, f_xx, f_xy, f_yy)[1])


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BallSurface]
