"""The angle of one body against another about an axis, for the formulas of several types."""

from dap3d_core.kernels import add, atan2, cos, cross, dot, normals, scale, sin, sub


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


def line_rates(g, a):
    """K and e, by which the angle from g to a mark on the body of the axis a changes.

    At the rate -k . g_dot + e . w, with the angular velocity w of that body: k = a x g / |a x g|^2
    and e = g x k, which is a where g is normal to a.
    """
    c = cross(a, g)
    k = scale(1.0 / dot(c, c), c)
    return k, cross(g, k)


def line_accelerations(g, a, g_dot, a_dot):
    """The time derivatives of ``line_rates``."""
    c, c_dot = cross(a, g), add(cross(a_dot, g), cross(a, g_dot))
    square = 1.0 / dot(c, c)
    k = scale(square, c)
    k_dot = scale(square, sub(c_dot, scale(2.0 * dot(c, c_dot), k)))
    return k_dot, add(cross(g_dot, k), cross(g, k_dot))
