"""3-vectors and 3x3 matrices as plain tuples: the functions that kernels are written with.

Every function here is pure and generic: in compiled code the tuples vanish into registers; in plain
Python the same source runs with floats, complex numbers (derivatives by complex step) and sympy.
"""

from dap3d_core.kernels.scalar_math import sqrt


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
