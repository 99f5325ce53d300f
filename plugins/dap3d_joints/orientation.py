"""The relative orientation of two bodies as an error quaternion, and its rate (spec 3.4)."""

from dap3d_core.kernels import add, cross, dot, scale, sub, where


def product(a, b):
    """The quaternion product a o b, of 4-tuples."""
    u, v = (a[1], a[2], a[3]), (b[1], b[2], b[3])
    e = add(add(scale(a[0], v), scale(b[0], u)), cross(u, v))
    return (a[0] * b[0] - dot(u, v), e[0], e[1], e[2])


def conjugate(a):
    """The conjugate of a quaternion."""
    return (a[0], -a[1], -a[2], -a[3])


def error(p_j, p_c, p_i):
    """Error q = p_j o conj(p_c) o conj(p_i) as (q0, e), q0 >= 0; e = 0 where A_i^T A_j = A_c."""
    q = product(p_j, conjugate(product(p_i, p_c)))
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


def quaternion(A):
    """Euler parameters of a rotation matrix, by the largest of the four; for ``prepare``."""
    trace = A[0][0] + A[1][1] + A[2][2]
    squares = [1 + trace, *(1 + 2 * A[k][k] - trace for k in range(3))]
    k = max(range(4), key=lambda n: squares[n])
    x = 0.5 * squares[k] ** 0.5
    skew_part = [A[2][1] - A[1][2], A[0][2] - A[2][0], A[1][0] - A[0][1]]
    if k == 0:
        return (x, *(s / (4 * x) for s in skew_part))
    others = [(A[k - 1][n] + A[n][k - 1]) / (4 * x) for n in range(3)]
    others[k - 1] = x
    return (skew_part[k - 1] / (4 * x), *others)
