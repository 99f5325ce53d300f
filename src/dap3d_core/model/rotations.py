"""Euler parameters and frames for whole arrays at once."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.kernels.array_types import Floats

#: An array of any kind.
AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


def rotation(p: ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3), body to global, of Euler parameters (..., 4) of any length."""
    p = np.asarray(p, dtype=float)
    e = (p / np.sqrt(np.add.reduce(p * p, axis=-1, keepdims=True))).T
    e0, e1, e2, e3 = e
    _, d1, d2, d3 = e + e
    x, y, z = d1 * e1, d2 * e2, d3 * e3
    xy, xz, yz, sx, sy, sz = d2 * e1, d3 * e1, d3 * e2, d1 * e0, d2 * e0, d3 * e0
    A = np.empty((3, 3, *e0.shape))
    A[0, 0], A[0, 1], A[0, 2] = 1 - (y + z), xy - sz, xz + sy
    A[1, 0], A[1, 1], A[1, 2] = xy + sz, 1 - (x + z), yz - sx
    A[2, 0], A[2, 1], A[2, 2] = xz - sy, yz + sx, 1 - (x + y)
    return A.T.swapaxes(-1, -2)


def to_body(p: ArrayLike, vector: ArrayLike) -> Floats:
    """Body components (..., 3) of global vectors (..., 3): A^T a."""
    return _apply(np.swapaxes(rotation(p), -1, -2), vector)


def to_global(p: ArrayLike, vector: ArrayLike) -> Floats:
    """Global components (..., 3) of vectors given on the body (..., 3): A a."""
    return _apply(rotation(p), vector)


def _apply(A: Floats, vector: ArrayLike) -> Floats:
    """A a for each pair, written out: the same bits whether one vector is turned or many."""
    a = np.asarray(vector, dtype=float)
    x, y, z = a[..., None, 0], a[..., None, 1], a[..., None, 2]
    return A[..., 0] * x + A[..., 1] * y + A[..., 2] * z


def roll_pitch_yaw(p: ArrayLike) -> Floats:
    """Roll, pitch and yaw (..., 3), rad, of Euler parameters (..., 4) of any length.

    A = Rz(yaw) Ry(pitch) Rx(roll): turns about the global x, then y, then z. With c, s of half the
    pitch, e0 + e2 and e3 - e1 are c + s times the cosine and sine of (yaw - roll) / 2; e0 - e2 and
    e3 + e1 are c - s times those of (yaw + roll) / 2. So at a pitch of a quarter turn, where one
    of the two is not defined, the other is as exact as anywhere, and the angles give p again. Roll
    and yaw are in [-pi, pi], pitch in [-pi/2, pi/2].
    """
    e0, e1, e2, e3 = np.moveaxis(np.asarray(p, dtype=float), -1, 0)
    half_difference, half_sum = np.arctan2(e3 - e1, e0 + e2), np.arctan2(e3 + e1, e0 - e2)
    quarter = np.arctan2(np.hypot(e0 - e2, e3 + e1), np.hypot(e0 + e2, e3 - e1))
    roll, yaw = half_sum - half_difference, half_sum + half_difference
    turns = 2.0 * np.pi * np.round(np.array([roll, 0.0 * roll, yaw]) / (2.0 * np.pi))
    return np.moveaxis(np.array([roll, 0.5 * np.pi - 2.0 * quarter, yaw]) - turns, 0, -1)


def roll_pitch_yaw_rates(angles: Floats, w: Floats) -> Floats:
    """Rates (..., 3) of roll, pitch and yaw (..., 3) at global angular velocities w (..., 3).

    Of w = yaw' z + pitch' Rz y + roll' Rz Ry x; those of roll and yaw grow without bound towards a
    pitch of a quarter turn.
    """
    pitch, yaw = angles[..., 1], angles[..., 2]
    along = np.cos(yaw) * w[..., 0] + np.sin(yaw) * w[..., 1]
    across = np.cos(yaw) * w[..., 1] - np.sin(yaw) * w[..., 0]
    roll = along / np.cos(pitch)
    return np.stack([roll, across, w[..., 2] + np.sin(pitch) * roll], axis=-1)


def euler_rates(p: Floats, w: Floats) -> Floats:
    """p_dot (..., 4) of p (..., 4) and global angular velocities (..., 3): half (0, w) times p."""
    scalar = -np.sum(w * p[..., 1:], axis=-1, keepdims=True)
    vector = p[..., :1] * w + np.cross(w, p[..., 1:])
    return 0.5 * np.concatenate([scalar, vector], axis=-1)


def angular_velocities(p: Floats, p_dot: Floats) -> Floats:
    """Global angular velocities (..., 3) of p (..., 4) and its rates p_dot (..., 4): 2 G p_dot."""
    e0, e, rate = p[..., :1], p[..., 1:], p_dot[..., 1:]
    return 2.0 * (-e * p_dot[..., :1] + e0 * rate + np.cross(e, rate))


def skew(a: ArrayLike) -> Floats:
    """Skew matrices (..., 3, 3) of vectors (..., 3): skew(a) b = a x b."""
    a = np.asarray(a, dtype=float)
    matrices = np.zeros((*a.shape, 3))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        matrices[..., j, i], matrices[..., i, j] = a[..., k], -a[..., k]
    return matrices


def read_only(array: AnyArray) -> AnyArray:
    """The same array, which nobody can write to by this name from here on."""
    array.flags.writeable = False
    return array
