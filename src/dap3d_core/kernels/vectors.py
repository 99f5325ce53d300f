"""3-vectors, 3x3 matrices and rotations as plain tuples: the functions of kernels.

Every function here is pure and generic: in compiled code the tuples vanish into registers; in plain
Python the same source runs with floats, complex numbers (derivatives by complex step) and sympy.
Matrices are tuples of rows; Euler parameters are tuples (e0, e1, e2, e3) of unit length; a rotation
vector is axis times angle.
"""

from dap3d_core.kernels.scalar_math import atan2, cos, sin, sqrt, where

#: Squared half sine below which series take the place of quotients of functions that vanish. Their
#: first term left out is below 1e-17 there.
SMALL = 1e-4


def add(a, b):
    """Sum of two 3-vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    """Difference ``a - b`` of two 3-vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def neg(a):
    """The 3-vector ``-a``."""
    return (-a[0], -a[1], -a[2])


def scale(x, a):
    """The 3-vector ``x a`` for a number x."""
    return (x * a[0], x * a[1], x * a[2])


def dot(a, b):
    """Scalar product of two 3-vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    """Vector product ``a x b``."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def skew(a):
    """The skew matrix of a 3-vector: ``skew(a) b = a x b``, three rows."""
    return ((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0))


def eye(x):
    """``x`` times the 3x3 identity, three rows."""
    return ((x, 0.0, 0.0), (0.0, x, 0.0), (0.0, 0.0, x))


def row(a, b):
    """One Jacobian row of six from its translational part a and its rotational part b."""
    return (a[0], a[1], a[2], b[0], b[1], b[2])


def hstack(P, Q):
    """Three Jacobian rows of six from a translational and a rotational 3x3 block."""
    return (row(P[0], Q[0]), row(P[1], Q[1]), row(P[2], Q[2]))


def rotate(A, s):
    """The 3-vector ``A s``: components of s on the body become global ones."""
    return (dot(A[0], s), dot(A[1], s), dot(A[2], s))


def norm2(a):
    """Squared length of a 3-vector."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


def by_body(on, parts, count):
    """Sums of the parts on each of ``count`` bodies, as ``wrench`` and ``J`` return them.

    Args:
        on: for each part the index of its body, such as ``on_points``.
        parts: numbers, or nested tuples of one form: (force, moment), or rows of six.
        count: number of bodies, ``body_count``.
    """
    sums = {}
    for body, part in zip(on, parts, strict=True):
        sums[body] = added(sums[body], part) if body in sums else part
    return tuple(sums.get(body, zeros(parts[0])) for body in range(count))


def zeros(a):
    """Zeros of the form of nested tuples."""
    return tuple(zeros(x) for x in a) if isinstance(a, tuple) else 0.0


def added(a, b):
    """Sum of nested tuples of one form."""
    return tuple(added(x, y) for x, y in zip(a, b, strict=True)) if isinstance(a, tuple) else a + b


def normals(a):
    """Two unit vectors n, m that complete an axis a to a triad: a x n = m, n x m = a.

    n is the coordinate axis least aligned with a, made normal to it: the first of those that are
    so but for a fiftieth, that an axis along another turns a little without a jump of n. For
    ``prepare``, not for a kernel.

    Args:
        a: axis, 3 components, any length but zero.

    Raises:
        ValueError: the axis has no length.
    """
    length = sqrt(norm2(a))
    if not length > 0.0:
        raise ValueError("an axis needs a length; this one is zero")
    a = scale(1.0 / length, a)
    largest = min(abs(x) for x in a) + 0.02
    least = next(k for k in range(3) if abs(a[k]) <= largest)
    n = tuple((1.0 if k == least else 0.0) - a[least] * a[k] for k in range(3))
    n = scale(1.0 / sqrt(norm2(n)), n)
    return n, cross(a, n)


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
