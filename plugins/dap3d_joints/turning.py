"""The angle of one body against another about an axis, for the formulas of several types."""

from dap3d_core.kernels import atan2, cos, dot, normals, sin


def references(axis, turned, fixed):
    """Three vectors by which an angle is measured: n, m on the body that turns, u on the other.

    For ``prepare``. n and m complete the axis to a triad; u is n in the poses as given, so that the
    angle is zero there.

    Args:
        axis: on the body that turns, 3 components in its axes.
        turned: pose of that body.
        fixed: pose of the body it turns against.
    """
    n, m = normals(axis)
    return n, m, fixed.to_local(turned.to_global(n))


def turned_by(n, m, u):
    """Angle in (-pi, pi] of the body of n and m against the body of u, about n x m."""
    return atan2(-dot(m, u), dot(n, u))


def wrapped(angle):
    """The angle without its whole turns, in (-pi, pi]."""
    return atan2(sin(angle), cos(angle))
