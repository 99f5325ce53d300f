"""The relative orientation of two bodies as an error quaternion, and its rate."""

from dap3d_core.kernels import add, conjugate, cross, dot, quaternion_product, scale, sub, where


def error(p_j, p_c, p_i):
    """Error q = p_j o conj(p_c) o conj(p_i) as (q0, e), q0 >= 0; e = 0 where A_i^T A_j = A_c."""
    q = quaternion_product(p_j, conjugate(quaternion_product(p_i, p_c)))
    sign = where(q[0] < 0.0, -1.0, 1.0)
    return sign * q[0], scale(sign, (q[1], q[2], q[3]))


def error_rate(q0, e, w_i, w_j):
    """(q0_dot, e_dot) for the global angular velocities of the two bodies."""
    w = sub(w_j, w_i)
    return -0.5 * dot(e, w), scale(0.5, add(scale(q0, w), cross(add(w_i, w_j), e)))


def turn(q0, e):
    """The matrix q0 I - e~, three rows: the error's Jacobian of body j, and of body i for -q0."""
    x, y, z = e
    return ((q0, z, -y), (-z, q0, x), (y, -x, q0))
