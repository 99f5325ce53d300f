"""Rotations in kernels: 3x3 matrices by rows, Euler parameters, rotation vectors.

Euler parameters are tuples (e0, e1, e2, e3) of unit length; a rotation vector is axis times angle.
"""

from dap3d_core.kernels.scalar_math import atan2, cos, sin, sqrt, where
from dap3d_core.kernels.vectors import add, cross, dot, norm2, scale

#: Squared half sine below which series take the place of quotients of functions that vanish. Their
#: first term left out is below 1e-17 there.
SMALL = 1e-4


def matmul(A, B):
    """The matrix product A B."""
    columns = transpose(B)
    return tuple(tuple(_product(row, column) for column in columns) for row in A)


def _product(row, column):
    """The scalar product of a row and a column, of any length."""
    first, *others = (a * b for a, b in zip(row, column, strict=True))
    for product in others:
        first = first + product
    return first


def transpose(A):
    """The transposed matrix A^T."""
    return tuple(zip(*A, strict=True))


def conjugate(p):
    """The Euler parameters of the inverse rotation."""
    return (p[0], -p[1], -p[2], -p[3])


def quaternion_product(p, q):
    """The quaternion product p o q: the rotation q, then p."""
    u, v = (p[1], p[2], p[3]), (q[1], q[2], q[3])
    e = add(add(scale(p[0], v), scale(q[0], u)), cross(u, v))
    return (p[0] * q[0] - dot(u, v), *e)


def euler_parameters(A):
    """The Euler parameters of a rotation matrix, by the largest of the four."""
    x, y, z = A[0][0], A[1][1], A[2][2]
    a, b, c = A[2][1] - A[1][2], A[0][2] - A[2][0], A[1][0] - A[0][1]
    f, g, h = A[2][1] + A[1][2], A[0][2] + A[2][0], A[1][0] + A[0][1]
    rows = (
        (1.0 + x + y + z, a, b, c),
        (a, 1.0 + x - y - z, h, g),
        (b, h, 1.0 - x + y - z, f),
        (c, g, f, 1.0 - x - y + z),
    )
    largest, chosen = rows[0][0], rows[0]
    for k in (1, 2, 3):
        greater = rows[k][k] > largest
        largest = where(greater, rows[k][k], largest)
        chosen = tuple(where(greater, u, v) for u, v in zip(rows[k], chosen, strict=True))
    part = 0.5 / sqrt(largest)
    return tuple(part * u for u in chosen)


def rotation_vector(p):
    """Axis times angle, in [0, pi], of Euler parameters or of a rotation matrix.

    Regular at rest: 0 without a rotation, with its derivatives. At half a turn it jumps to the
    opposite axis.
    """
    p = euler_parameters(p) if len(p) == 3 else p
    sense = where(p[0] < 0.0, -1.0, 1.0)
    e = (p[1], p[2], p[3])
    square = norm2(e)
    small = square < SMALL
    sine = sqrt(where(small, 1.0, square))
    series = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0)))
    return scale(sense * where(small, series, 2.0 * atan2(sine, sense * p[0]) / sine), e)


def rotation_matrix(phi):
    """The rotation matrix of a rotation vector, three rows; regular at rest."""
    square = norm2(phi)
    small = square < 4.0 * SMALL
    angle = sqrt(where(small, 1.0, square))
    sines = 1.0 + square * (-1.0 / 6.0 + square * (1.0 / 120.0 - square * (1.0 / 5040.0)))
    cosines = 0.5 + square * (-1.0 / 24.0 + square * (1.0 / 720.0 - square * (1.0 / 40320.0)))
    f = where(small, sines, sin(angle) / angle)
    g = where(small, cosines, (1.0 - cos(angle)) / (angle * angle))
    x, y, z = phi
    c = 1.0 - g * square
    return (
        (c + g * x * x, g * x * y - f * z, g * x * z + f * y),
        (g * x * y + f * z, c + g * y * y, g * y * z - f * x),
        (g * x * z - f * y, g * y * z + f * x, c + g * z * z),
    )
