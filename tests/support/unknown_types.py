"""Joints with unknowns of their own: a point on a closed curve, an ellipsoid on a plane."""

from dap3d_core.interface import Body, Joint, Point, body, number, point
from dap3d_core.kernels import add, cos, cross, rotate, sin, sub


class OnCurve(Joint):
    """P_i stays on the closed curve (a cos s, b sin s, h sin 2 s) about P_j, axes of body j."""

    keyword, rows, unknowns = "on-curve", 3, ("s",)
    P_i: Point = point()
    P_j: Point = point()
    a: float = number(default=1.0, unit="m")
    b: float = number(default=0.6, unit="m")
    h: float = number(default=0.2, unit="m")

    def C(r_P_i, r_P_j, A_j, s, a, b, h):
        c = (a * cos(s), b * sin(s), h * sin(2.0 * s))
        return sub(r_P_i, add(r_P_j, rotate(A_j, c)))


class RoundAgain(OnCurve):
    """The same, with s between two bounds a turn apart."""

    keyword, periodic = "on-curve-again", ("s",)
    s_min: float = number(default=0.0)
    s_max: float = number(default=6.283185307179586)


class SlidingEllipsoid(Joint):
    """An ellipsoid about the mass centre of body i touches the plane z = 0 at (x, y, z) on it.
    Rows: the point is on the surface, and on the plane; the normals are parallel there."""

    keyword, rows, unknowns = "ellipsoid", 4, ("x", "y", "z")
    body_i: Body = body()
    a: float = number(default=0.5, unit="m")
    b: float = number(default=0.4, unit="m")
    c: float = number(default=0.3, unit="m")

    def C(r_i, A_i, x, y, z, a, b, c):
        normal = rotate(A_i, (x / a**2, y / b**2, z / c**2))
        surface = 0.5 * ((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1.0)
        return surface, r_i[2] + rotate(A_i, (x, y, z))[2], normal[0], normal[1]


class RollingEllipsoid(SlidingEllipsoid):
    """The same, without slip."""

    keyword, rows = "rolling-ellipsoid", 6
    holonomic = (True, True, True, True, False, False)

    def C_dot(v_i, w_i, A_i, x, y, z):
        velocity = add(v_i, cross(w_i, rotate(A_i, (x, y, z))))
        return velocity[0], velocity[1]


WITH_UNKNOWNS = (OnCurve, RoundAgain, SlidingEllipsoid, RollingEllipsoid)
