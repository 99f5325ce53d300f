"""A ball at a cylinder."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import add, dot, scale, sqrt, sub, where

interface_version = 1


def surface(r_P_i, r_P_j, a_j, radius_j, length):
    """Distance of P_i from the surface of the cylinder, and the normal there.

    Of a point within it: through the side or the cap, whichever is nearer.
    """
    d = sub(r_P_i, r_P_j)
    x = dot(d, a_j)
    side = sub(d, scale(x, a_j))
    square = dot(side, side)
    off = square > 0.0
    rho = sqrt(where(off, square, 1.0))
    out = scale(where(off, 1.0 / rho, 0.0), side)
    rho = where(off, rho, 0.0)
    cap = scale(where(x < 0.0, -1.0, 1.0), a_j)
    u, v = where(x < 0.0, -x, x) - 0.5 * length, rho - radius_j
    beyond = (u > 0.0) & (v > 0.0)
    rim = sqrt(where(beyond, u * u + v * v, 1.0))
    corner = add(scale(u / rim, cap), scale(v / rim, out))
    return (
        where(beyond, rim, where(u > v, u, v)),
        where(beyond, corner, where(u > v, cap, out)),
    )


class BallCylinder(Contact):
    """The ball of ``radius_i`` about P_i at a cylinder about P_j, with axis a_j.

    It touches the side, both caps and their rims; where it rolls over a rim, the normal turns
    without a jump.

        gap = |r_Pi - q| - radius_i,   q the point of the cylinder that is nearest to P_i
    """

    keyword = "ball_cylinder"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere", "j": "cylinder"}
    example: ClassVar[Mapping[str, str]] = {
        "P_j": '"rod.O"', "a_j": '"rod.z"', "radius_i": "0.1", "radius_j": "0.1", "length": "0.3",
    }  # fmt: skip
    P_i: Point = point(doc="centre of the ball")
    radius_i: float = number(unit="m", positive=True, doc="of the ball")
    P_j: Point = point(doc="centre of the cylinder")
    a_j: Vector = vector(doc="axis of the cylinder")
    radius_j: float = number(unit="m", positive=True, doc="of the cylinder")
    length: float = number(unit="m", positive=True, doc="of the cylinder, from cap to cap")

    def gap(r_P_i, r_P_j, a_j, radius_i, radius_j, length):
        return surface(r_P_i, r_P_j, a_j, radius_j, length)[0] - radius_i

    def at(r_P_i, r_P_j, a_j, radius_i, radius_j, length):
        n = surface(r_P_i, r_P_j, a_j, radius_j, length)[1]
        return sub(r_P_i, scale(radius_i, n))

    def normal(r_P_i, r_P_j, a_j, radius_j, length):
        return surface(r_P_i, r_P_j, a_j, radius_j, length)[1]

    def seam(r_P_i, r_P_j, a_j, radius_j, length):
        d = sub(r_P_i, r_P_j)
        x = dot(d, a_j)
        side = sub(d, scale(x, a_j))
        return where(x < 0.0, -x, x) - 0.5 * length, sqrt(dot(side, side)) - radius_j


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BallCylinder]
