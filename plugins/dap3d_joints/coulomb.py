"""Coulomb friction that fades at low speed: mu |N| S(v / v_tol), S = tanh."""

from dap3d_core.kernels import scale, sqrt, tanh, where


def magnitude(N):
    """The length of a force whose components are orthogonal; any number of them."""
    square = 0.0
    for x in N:
        square = square + x * x
    return sqrt(square)


def fading(speed, v_tol):
    """S(speed / v_tol) / speed, for a speed that is not negative; at rest its limit 1 / v_tol."""
    x = speed / v_tol
    near = x < 1e-8  # where tanh(x) = x to rounding
    x = where(near, 1.0, x)
    return where(near, 1.0, tanh(x) / x) / v_tol


def against(v, load, v_tol):
    """The force of size load S(|v| / v_tol) against the sliding velocity v."""
    return scale(-load * fading(magnitude(v), v_tol), v)
