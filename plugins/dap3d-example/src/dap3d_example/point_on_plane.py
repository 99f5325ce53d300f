"""Point on a plane of another body, which may move."""

from dap3d_core.interface import Joint, Point, Vector, hookimpl, number, point, vector
from dap3d_core.kernels import dot, sub

interface_version = 1


class PointOnPlane(Joint):
    """P_i stays in the plane of body j through P_j, normal to a_j, or at a distance from it.

    The manual's ``rP`` has its plane on ground; this one moves with its body. One row:

        C = a_j . (r_Pi - r_Pj) - distance

    J and gamma are derived from C.
    """

    keyword, rows = "point-on-plane", 1
    P_i: Point = point(doc="the point that slides, on body i")
    P_j: Point = point(doc="point in the plane, on body j")
    a_j: Vector = vector(doc="normal of the plane, on body j")
    distance: float = number(default=0.0, unit="m", doc="height above the plane, of either sign")

    def C(r_P_i, r_P_j, a_j, distance):
        return dot(a_j, sub(r_P_i, r_P_j)) - distance


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [PointOnPlane]
