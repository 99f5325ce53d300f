"""Poses, twists and their exponentials for whole arrays at once.

A pose is a position r (..., 3), m, and unit Euler parameters p (..., 4). A twist is (v, w)
(..., 6): the velocity of the origin and the angular velocity, both in the axes that move along, so
that a pose T moves on to T exp(x). Murray, Li, Sastry: A Mathematical Introduction to Robotic
Manipulation, chapter 2.
"""

from typing import NamedTuple

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rotations import skew


class Pose(NamedTuple):
    """Position r (..., 3), m, and unit Euler parameters p (..., 4) of one frame in another."""

    r: Floats
    p: Floats


def cross(a: Floats, b: Floats) -> Floats:
    """Vector products (..., 3); of few vectors in half the time of numpy's."""
    x = np.empty(np.broadcast_shapes(a.shape, b.shape))
    x[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    x[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    x[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return x


def quaternion_product(a: Floats, b: Floats) -> Floats:
    """The quaternion products a o b of arrays (..., 4)."""
    u, v = a[..., 1:], b[..., 1:]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = a[..., 0] * b[..., 0] - np.sum(u * v, axis=-1)
    product[..., 1:] = a[..., :1] * v + b[..., :1] * u + cross(u, v)
    return product


def conjugate(p: Floats) -> Floats:
    """Euler parameters (..., 4) of the inverse rotations."""
    return p * np.array([1.0, -1.0, -1.0, -1.0])


def turned(p: Floats, a: Floats) -> Floats:
    """Vectors A a (..., 3) of unit Euler parameters p (..., 4)."""
    e = p[..., 1:]
    half = cross(e, a)
    return a + 2.0 * (p[..., :1] * half + cross(e, half))


def matrices(p: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit Euler parameters (..., 4)."""
    e0, e1, e2, e3 = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    A = np.empty((*p.shape[:-1], 3, 3))
    A[..., 0, 0] = 1.0 - 2.0 * (e2 * e2 + e3 * e3)
    A[..., 1, 1] = 1.0 - 2.0 * (e1 * e1 + e3 * e3)
    A[..., 2, 2] = 1.0 - 2.0 * (e1 * e1 + e2 * e2)
    for r, c, product, other in ((0, 1, e1 * e2, e3), (1, 2, e2 * e3, e1), (2, 0, e1 * e3, e2)):
        turn = e0 * other
        A[..., r, c], A[..., c, r] = 2.0 * (product - turn), 2.0 * (product + turn)
    return A


def identity(count: int) -> Pose:
    """As many poses without displacement."""
    return Pose(np.zeros((count, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))


def compose(a: Pose, b: Pose) -> Pose:
    """The poses a b: b is given in the axes of a."""
    p = quaternion_product(a.p, b.p)
    return Pose(a.r + turned(a.p, b.r), p / np.sqrt(np.sum(p * p, axis=-1, keepdims=True)))


def inverse(a: Pose) -> Pose:
    """The poses of the outer frames in the inner ones."""
    p = conjugate(a.p)
    return Pose(-turned(p, a.r), p)


def relative(a: Pose, b: Pose) -> Pose:
    """The poses of b in the axes of a, both given in a third frame."""
    return compose(inverse(a), b)


def exponential(twist: Floats) -> Pose:
    """The poses that constant twists (..., 6) lead to in a unit of time."""
    v, w = twist[..., :3], twist[..., 3:]
    angle = np.sqrt(np.sum(w * w, axis=-1, keepdims=True))
    safe = np.where(angle > 0.0, angle, 1.0)
    half = np.where(angle > 0.0, np.sin(0.5 * angle) / safe, 0.5)
    p = np.concatenate([np.cos(0.5 * angle), half * w], axis=-1)
    # (angle - sin angle) / angle^3: what it loses to rounding, its factor w x (w x v) makes small
    third = (1.0 - 2.0 * half * np.cos(0.5 * angle)) / safe**2
    across = cross(w, v)
    return Pose(v + 2.0 * half**2 * across + third * cross(w, across), p)


def rotation_vector(p: Floats) -> Floats:
    """(..., 3) the rotation vectors, of at most half a turn, of Euler parameters (..., 4)."""
    p = np.where(p[..., :1] < 0.0, -p, p)
    sine = np.linalg.norm(p[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, p[..., :1])
    return np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0) * p[..., 1:]


def adjoint(a: Pose) -> Floats:
    """(..., 6, 6) matrices from twists in the inner frames to the same in the outer ones."""
    A = matrices(a.p)
    matrix = np.zeros((*A.shape[:-2], 6, 6))
    matrix[..., :3, :3] = matrix[..., 3:, 3:] = A
    matrix[..., :3, 3:] = skew(a.r) @ A
    return matrix
