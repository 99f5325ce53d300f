"""Functions by which group loops read quantities: vectors and matrices from rows of arrays."""

import numpy as np

from dap3d_core.kernels.scalar_math import atan2, where
from dap3d_core.kernels.vectors import add, cross, dot, rotate, sub

#: Columns of the body array: position, rotation matrix by rows, velocity, angular velocity
#: (global), Euler parameters, mass, inertia matrix in body axes by rows.
R, A, V, W, P, MASS, JP, BODY_WIDTH = 0, 3, 12, 15, 18, 22, 23, 32
TURN = 6.283185307179586

__all__ = [
    "JP", "MASS", "A", "P", "R", "V", "W", "add", "angle_about", "cross", "dot", "matrix_at",
    "matrix_in", "rotate", "sub", "doubtful", "unwound", "vector_at", "vector_in", "where", "whole",
    "within",
]  # fmt: skip


def vector_at(array, i, k):
    """The 3-vector in columns k, k+1, k+2 of row i."""
    return (array[i, k], array[i, k + 1], array[i, k + 2])


def matrix_at(array, i, k):
    """The 3x3 matrix in nine columns of row i, by rows."""
    return (vector_at(array, i, k), vector_at(array, i, k + 3), vector_at(array, i, k + 6))


def vector_in(array, k):
    """The 3-vector at k of a flat array."""
    return (array[k], array[k + 1], array[k + 2])


def matrix_in(array, k):
    """The 3x3 matrix at k of a flat array, by rows."""
    return (vector_in(array, k), vector_in(array, k + 3), vector_in(array, k + 6))


def angle_about(u, v, k):
    """The angle from u to v about the unit vector k, in (-pi, pi]."""
    return atan2(dot(k, cross(u, v)), dot(u, v) - dot(u, k) * dot(v, k))


def unwound(angle, last):
    """The angle plus whole turns, so that it is within half a turn of the last one."""
    return angle + TURN * np.rint((last - angle).real / TURN)


def doubtful(rise, before, rate, elapsed, sense):
    """1 if an angle may be miscounted in a step, else 0.

    Its rate changed by half a turn per step; its rise is not near the mean rate's; or it is more
    than half a turn in a step whose length was given, and is not limited by its error: sense < 0.
    """
    is_far = where(sense < 0.0, where(abs(rise) > 0.5 * TURN, 1.0, 0.0), 0.0)
    changes = where(abs(rate - before) * elapsed > 0.5 * TURN, 1.0, is_far)
    return where(abs(rise - 0.5 * (before + rate) * elapsed) > 0.25 * TURN, 1.0, changes)


def within(x, low, high):
    """The number plus whole periods, high less low, so that it is between them."""
    period = high - low
    return x - period * np.rint(((x - 0.5 * (low + high)) / period).real)


def whole(x):
    """A number of an array as an integer, an index into another one."""
    return x.tracer.integer(x) if hasattr(x, "tracer") else int(x)
