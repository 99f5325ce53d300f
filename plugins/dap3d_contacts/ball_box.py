"""A ball at a box."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import Contact, Point, hookimpl, number, point, vec3
from dap3d_core.kernels import dot, rotate, scale, sqrt, sub, transpose, where

interface_version = 1


def clamped(x, half):
    """A coordinate, or the end of its range that it is beyond."""
    return where(x > half, half, where(x < -half, -half, x))


def along(x, out):
    """A unit vector of one axis, towards x."""
    return where(out, where(x < 0.0, -1.0, 1.0), 0.0)


def surface(r_P_i, r_P_j, A_j, size):
    """Distance of P_i from the surface of the box, and the normal there, in its axes.

    Of a point within the box: through the nearest face.
    """
    x, y, z = rotate(transpose(A_j), sub(r_P_i, r_P_j))
    a, b, c = scale(0.5, size)
    d = (x - clamped(x, a), y - clamped(y, b), z - clamped(z, c))
    square = dot(d, d)
    outside = square > 0.0
    distance = sqrt(where(outside, square, 1.0))
    depth_x, depth_y, depth_z = (where(q < 0.0, -q, q) - h for q, h in ((x, a), (y, b), (z, c)))
    x_first = (depth_x >= depth_y) & (depth_x >= depth_z)
    y_first = depth_y >= depth_z
    within = where(x_first, depth_x, where(y_first, depth_y, depth_z))
    face = (
        where(x_first, along(x, x_first), 0.0),
        where(x_first, 0.0, along(y, y_first)),
        where(x_first, 0.0, where(y_first, 0.0, where(z < 0.0, -1.0, 1.0))),
    )
    return where(outside, distance, within), where(outside, scale(1.0 / distance, d), face)


class BallBox(Contact):
    """The ball of ``radius`` about P_i at a box about P_j, with edges along the axes of its body.

    It touches faces, edges and corners; where it rolls from a face over an edge, the normal turns
    without a jump.

        gap = |r_Pi - q| - radius,   q the point of the box that is nearest to P_i
    """

    keyword = "ball_box"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere", "j": "box"}
    example: ClassVar[Mapping[str, str]] = {
        "P_j": '"rod.O"', "radius": "0.1", "size": "[0.2, 0.3, 0.4]",
    }  # fmt: skip
    P_i: Point = point(doc="centre of the ball")
    radius: float = number(unit="m", positive=True, doc="of the ball")
    P_j: Point = point(doc="centre of the box")
    size: tuple = vec3(unit="m", doc="lengths of its edges, along the axes of the body")

    def gap(r_P_i, r_P_j, A_j, radius, size):
        return surface(r_P_i, r_P_j, A_j, size)[0] - radius

    def at(r_P_i, r_P_j, A_j, radius, size):
        return sub(r_P_i, scale(radius, rotate(A_j, surface(r_P_i, r_P_j, A_j, size)[1])))

    def normal(r_P_i, r_P_j, A_j, size):
        return rotate(A_j, surface(r_P_i, r_P_j, A_j, size)[1])

    def seam(r_P_i, r_P_j, A_j, size):
        of_axes = zip(rotate(transpose(A_j), sub(r_P_i, r_P_j)), size, strict=True)
        return tuple(where(x < 0.0, -x, x) - 0.5 * length for x, length in of_axes)


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [BallBox]
