"""A point, a roller or a ball at a curve: cams, rails, wires, pipes."""

import math
from collections.abc import Mapping
from typing import ClassVar

from dap3d_contacts.ball_surface import LEFT, seen_from
from dap3d_contacts.curve_samples import SAMPLES, Curve
from dap3d_core.interface import Contact, Point, choice, function, hookimpl, number, point
from dap3d_core.kernels import add, atan2, cos, dot, root, rotate, scale, sin, sqrt, sub, where

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

    s, left = foot((X, Y), start, curve)
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


#: Newton's method takes the slope as it is where the curve is flatter, by this part, than a circle
#: about the place; elsewhere one that leads to no greatest distance.
FLATTER = 0.02


def product(a, b):
    """Scalar product of tuples of any length."""
    first, *others = (p * q for p, q in zip(a, b, strict=True))
    return sum(others, first)


def apart(a, b):
    """Difference of tuples; of the first, as many as the second has."""
    return tuple(p - q for p, q in zip(a, b, strict=False))


def without_rates(values):
    """Numbers alone: of a start nothing else is wanted."""
    return tuple(getattr(value, "plain", value) for value in values)


def nearest_sample(samples, place):
    """The parameter of that sample (s, *point) of a curve which is nearest to a place."""
    place = without_rates(place)
    start, least = 0.0, math.inf
    for sample in samples:
        s, *point = without_rates(sample)
        d = apart(place, point)
        square = product(d, d)
        start = where(square < least, s, start)
        least = where(square < least, square, least)
    return start


def foot(place, start, curve):
    """The parameter of the point of a curve nearest to a place, and what the last pass changed."""

    def off(s):
        point, first, _ = curve(s)
        return (product(apart(place, point), first),)

    def slope(s):
        point, first, second = curve(s)
        square = product(first, first)
        own = product(apart(place, point), second) - square
        return ((where(own < -FLATTER * square, own, -square),),)

    (s,), left = root((start,), off, slope)
    return s, left


def reach_of(s, left, s_min, s_max, is_closed):
    """Not negative where a point of a curve is on it, and found."""
    reach = where(s - s_min < s_max - s, s - s_min, s_max - s)
    return where(is_closed > 0.5, 1.0, where(left < LEFT, reach, -1.0))


def parametric(*axes):
    """The curve of functions (f, f', f'') of x, y and maybe z."""
    return lambda s: tuple(zip(*(tuple(f(s) for f in axis) for axis in axes), strict=True))


def at_plane_curve(r_P_i, r_P_j, A_j, sense, samples, curve):
    """``nearest``, of a curve given by its parameter."""
    place = seen_from(r_P_i, r_P_j, A_j)
    start = nearest_sample([sample[:3] for sample in samples], place)
    return nearest(place, start, sense, curve)


def at_space_curve(r_P_i, r_P_j, A_j, samples, curve):
    """The distance of P_i from a curve in space, the direction away from it, the point nearest."""
    place = seen_from(r_P_i, r_P_j, A_j)
    start = nearest_sample(samples, place)
    s, left = foot(place, start, curve)
    point = where(left < LEFT, curve(s)[0], curve(start)[0])
    d = sub(place, point)
    square = dot(d, d)
    size = sqrt(where(square > 0.0, square, 1.0))
    away = scale(where(left < LEFT, 1.0, math.nan) / size, d)
    return where(square > 0.0, size, 0.0), away, point


class PointCurve(Contact):
    """The point P_i, or a roller or ball of ``radius`` about it, at a curve of body j.

    The curve is one of these, in axes of body j from P_j:

    * y = f(x), by ``function``;
    * with ``polar``, as of a cam, the distance r = f(angle) over the angle from x to y, rad;
    * x(s), y(s), by ``x`` and ``y``, from ``s_min`` to ``s_max``: closed, such as a cam, or a part;
    * x(s), y(s), z(s): a wire in space, or with ``side`` below a pipe of radius ``radius_j``.

    A plane curve goes on along z, as a plate does: where P_i is along z has no part. ``side``
    above is y > f(x), outside of what is closed, and left of a part, seen in the direction of s.
    f is of period 2 pi where it is polar, x, y and z of s_max - s_min where they are ``closed``.
    All are smooth, and hollows and necks wider than a roller. With ``x`` that point of the whole
    curve counts which is nearest to P_i; from y = f(x) and polar ones the one next to where P_i is.
    Beyond the ends of a part nothing touches; what may touch at two points at once has a contact
    for each part, and is behind the curve by ``depth`` at most, as behind a thin wall.

        gap = distance of P_i from the curve - radius,   less than nothing on the other side
        gap = distance - radius_j - radius of a wire, radius_j - distance - radius in a pipe
    """

    keyword = "point_curve"
    surfaces: ClassVar[Mapping[str, str]] = {"i": "sphere", "j": "curve"}
    synonyms = ("cam", "cam-follower", "point-curve")
    example: ClassVar[Mapping[str, str]] = {"function": '"motor"'}
    P_i: Point = point(doc="the point, centre of the roller")
    radius: float = number(0.0, unit="m", minimum=0.0, doc="of the roller; 0: a point")
    P_j: Point = point("ground.O", doc="origin of the curve")
    polar: bool = choice((False, True), False, doc="f is the distance from P_j over the angle")
    x: str = function(argument="s", doc="x of the curve, m, in place of function")
    y: str = function(argument="s", doc="y of the curve, m, with x")
    z: str = function(argument="s", doc="z of a curve in space, m, with x and y")
    function: str = function(argument="x, m, or angle, rad", doc="the curve, m")
    s_min: float = number(0.0, doc="of x, y and z: where the curve begins")
    s_max: float = number(None, doc="the same: where it ends")
    closed: bool = choice((False, True), False, doc="the same: it ends where it begins")
    radius_j: float = number(0.0, unit="m", minimum=0.0, doc="of a wire or pipe about it; with z")
    side: str = choice(("above", "below"), "above", doc="where P_i is; above: outside of a cam")
    depth: float = number(None, unit="m", positive=True, doc="with y: how far behind it touches")

    def prepare(self, bodies):
        """The sign of the normal, and places of what the functions give."""
        s_max = self.s_min if self.s_max is None else self.s_max
        own = {"s_max": s_max, "is_closed": float(self.closed), "depth": self.depth or 0.0}
        sense = 1.0 if self.side == "above" else -1.0
        samples = [[0.0] * 4] * SAMPLES
        return {**super().prepare(bodies), **own, "sense": sense, "samples": samples}

    def prepare_functions(self, functions):
        """Points along a curve of a parameter, and the sign of the normal of a closed one."""
        given = sorted(functions)
        if given not in (["function"], ["x", "y"], ["x", "y", "z"]):
            raise ValueError(
                "a curve is given by function, or by x and y, or by x, y and z; this one has "
                f"{' and '.join(given) or 'none of them'}"
            )
        of_parameter = self.s_max is not None or self.s_min != 0.0 or self.closed
        in_space = "z" in functions
        if "x" not in functions and of_parameter:
            raise ValueError("s_min, s_max and closed are of a curve given by x and y")
        if "x" in functions and (self.s_max is None or self.polar):
            raise ValueError("a curve given by x and y takes s_max, its end, and is not polar")
        if self.depth is not None and given != ["x", "y"]:
            raise ValueError("depth is that behind a plane curve given by x and y")
        if self.radius_j and not in_space:
            raise ValueError("radius_j is that of a wire or pipe, a curve given by x, y and z")
        if "x" not in functions:
            return {}
        curve = Curve([functions[name] for name in given], self.s_min, self.s_max)
        sense = 1.0 if self.side == "above" else -1.0
        if self.closed:
            curve.check_closed()
        if in_space:
            if sense < 0.0 and not self.radius_j > self.radius:
                raise ValueError("what is in a pipe, side = below, has a radius below radius_j")
            curve.check_room(0.0, sense * self.radius + self.radius_j)
        else:
            sense = -sense if self.closed and not curve.is_clockwise() else sense
            curve.check_room(sense, self.radius)
        return {"sense": sense, "samples": curve.samples()}

    gap, at, normal = kernels_of(of_height)


class PointCam(PointCurve, polar=True):
    """The curve is polar."""

    gap, at, normal = kernels_of(of_polar)


class InSpace(PointCurve, x=True, z=True):
    """The curve is x(s), y(s), z(s)."""

    def gap(
        r_P_i, r_P_j, A_j, radius, radius_j, sense, samples,
        x, x_dot, x_ddot, y, y_dot, y_ddot, z, z_dot, z_ddot,
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot), (z, z_dot, z_ddot))
        distance = at_space_curve(r_P_i, r_P_j, A_j, samples, curve)[0]
        return sense * (distance - radius_j) - radius

    def at(
        r_P_i, r_P_j, A_j, radius_j, samples,
        x, x_dot, x_ddot, y, y_dot, y_ddot, z, z_dot, z_ddot,
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot), (z, z_dot, z_ddot))
        _, away, point = at_space_curve(r_P_i, r_P_j, A_j, samples, curve)
        return add(r_P_j, rotate(A_j, add(point, scale(radius_j, away))))

    def normal(
        r_P_i, r_P_j, A_j, sense, samples,
        x, x_dot, x_ddot, y, y_dot, y_ddot, z, z_dot, z_ddot,
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot), (z, z_dot, z_ddot))
        return scale(sense, rotate(A_j, at_space_curve(r_P_i, r_P_j, A_j, samples, curve)[1]))

    def reach(
        r_P_i, r_P_j, A_j, samples, s_min, s_max, is_closed,
        x, x_dot, x_ddot, y, y_dot, y_ddot, z, z_dot, z_ddot,
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot), (z, z_dot, z_ddot))
        place = seen_from(r_P_i, r_P_j, A_j)
        return reach_of(
            *foot(place, nearest_sample(samples, place), curve), s_min, s_max, is_closed
        )


class Wall(PointCurve, x=True, depth=True):
    """The curve is x(s), y(s), and what is more than depth behind it does not touch."""

    def gap(
        r_P_i, r_P_j, A_j, radius, sense, samples, x, x_dot, x_ddot, y, y_dot, y_ddot
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot))
        return at_plane_curve(r_P_i, r_P_j, A_j, sense, samples, curve)[0] - radius

    def at(r_P_i, r_P_j, A_j, sense, samples, x, x_dot, x_ddot, y, y_dot, y_ddot):
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot))
        found = at_plane_curve(r_P_i, r_P_j, A_j, sense, samples, curve)[2]
        return add(r_P_j, rotate(A_j, found))

    def normal(r_P_i, r_P_j, A_j, sense, samples, x, x_dot, x_ddot, y, y_dot, y_ddot):
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot))
        return rotate(A_j, at_plane_curve(r_P_i, r_P_j, A_j, sense, samples, curve)[1])

    def reach(
        r_P_i, r_P_j, A_j, radius, sense, samples, s_min, s_max, is_closed, depth,
        x, x_dot, x_ddot, y, y_dot, y_ddot,
    ):  # fmt: skip
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot))
        place, first = seen_from(r_P_i, r_P_j, A_j), [sample[:3] for sample in samples]
        start = nearest_sample(first, place)
        along = reach_of(*foot(place[:2], start, curve), s_min, s_max, is_closed)
        within = nearest(place, start, sense, curve)[0] - radius + depth
        return where(within < along, within, along)


class InPlane(PointCurve, x=True):
    """The curve is x(s), y(s)."""

    gap, at, normal = Wall.gap, Wall.at, Wall.normal

    def reach(
        r_P_i, r_P_j, A_j, samples, s_min, s_max, is_closed, x, x_dot, x_ddot, y, y_dot, y_ddot
    ):
        place = seen_from(r_P_i, r_P_j, A_j)
        start = nearest_sample([sample[:3] for sample in samples], place)
        curve = parametric((x, x_dot, x_ddot), (y, y_dot, y_ddot))
        return reach_of(*foot(place[:2], start, curve), s_min, s_max, is_closed)


@hookimpl
def dap3d_contacts():
    """The contact types of this module."""
    return [PointCurve]
