"""Point on the surface of an ellipsoid."""

from dap3d_core.interface import Joint, Point, hookimpl, number, point
from dap3d_core.kernels import dot, sub

interface_version = 1


class PointOnSurface(Joint):
    """P_i stays on an ellipsoid of body j, which has P_j for its lowest point along z of the body.

    Its axes are those of body j, its centre is c above P_j. With x, y, z the components of P_i from
    the centre, in the axes of body j, a, b, c the semi-axes, and l = (a b c)^(1/3), one row:

        C = l / 2 (x^2 / a^2 + y^2 / b^2 + z^2 / c^2 - 1)

    It is a length, near the surface about the distance from it. J and gamma are derived from C.
    """

    keyword, rows = "point-on-surface", 1
    body_axes = ("j",)
    P_i: Point = point(doc="the point that slides, on body i")
    P_j: Point = point(doc="point of the surface that is lowest along z, on body j")
    a: float = number(unit="m", positive=True, doc="half the extent along x of body j")
    b: float = number(unit="m", positive=True, doc="half the extent along y of body j")
    c: float = number(unit="m", positive=True, doc="half the extent along z of body j")

    def prepare(self, bodies):
        a, b, c = self.a, self.b, self.c
        half = 0.5 * (a * b * c) ** (1.0 / 3.0)
        # the axes divided by their lengths: by them the surface is a sphere of radius 1
        return {"u_j": (1.0 / a, 0.0, 0.0), "m_j": (0.0, 1.0 / b, 0.0), "n_j": (0.0, 0.0, 1.0 / c),
                "half": half}  # fmt: skip

    def C(r_P_i, r_P_j, u_j, m_j, n_j, half):
        d = sub(r_P_i, r_P_j)
        x, y, z = dot(u_j, d), dot(m_j, d), dot(n_j, d) - 1.0
        return half * (x * x + y * y + z * z - 1.0)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [PointOnSurface]
