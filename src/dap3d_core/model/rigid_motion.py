"""Poses, twists and their exponentials for whole arrays at once.

A pose is a position r (..., 3), m, and unit Euler parameters p (..., 4). A twist is (v, w)
(..., 6): the velocity of the origin and the angular velocity, both in the axes that move along, so
that a pose T moves on to T exp(x). Murray, Li, Sastry: A Mathematical Introduction to Robotic
Manipulation, chapter 2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.model.rotations import rotation, to_body, to_global

Floats = NDArray[np.float64]


class Pose(NamedTuple):
    """Position r (..., 3), m, and unit Euler parameters p (..., 4) of one frame in another."""

    r: Floats
    p: Floats


def quaternion_product(a: Floats, b: Floats) -> Floats:
    """The quaternion products a o b of arrays (..., 4)."""
    a, b = np.broadcast_arrays(a, b)
    u, v = a[..., 1:], b[..., 1:]
    scalar = a[..., 0] * b[..., 0] - np.sum(u * v, axis=-1)
    vector = a[..., :1] * v + b[..., :1] * u + np.cross(u, v)
    product: Floats = np.concatenate([scalar[..., None], vector], axis=-1)
    return product


def identity(count: int) -> Pose:
    """As many poses without displacement."""
    return Pose(np.zeros((count, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))


def compose(a: Pose, b: Pose) -> Pose:
    """The poses a b: b is given in the axes of a."""
    p = quaternion_product(a.p, b.p)
    return Pose(a.r + to_global(a.p, b.r), p / np.linalg.norm(p, axis=-1, keepdims=True))


def inverse(a: Pose) -> Pose:
    """The poses of the outer frames in the inner ones."""
    p = a.p * np.array([1.0, -1.0, -1.0, -1.0])
    return Pose(-to_body(a.p, a.r), p)


def relative(a: Pose, b: Pose) -> Pose:
    """The poses of b in the axes of a, both given in a third frame."""
    return compose(inverse(a), b)


def exponential(twist: Floats) -> Pose:
    """The poses that constant twists (..., 6) lead to in a unit of time."""
    v, w = twist[..., :3], twist[..., 3:]
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    half = 0.5 * np.sinc(angle / (2.0 * np.pi))  # sin(angle / 2) / angle
    p = np.concatenate([np.cos(0.5 * angle), half * w], axis=-1)
    # (angle - sin angle) / angle^3: what it loses to rounding, its factor w x (w x v) makes small
    sine = np.sinc(angle / np.pi)
    third = (1.0 - sine) / np.where(angle > 0.0, angle, 1.0) ** 2
    across = np.cross(w, v)
    return Pose(v + 2.0 * half**2 * across + third * np.cross(w, across), p)


def rotation_vector(p: Floats) -> Floats:
    """(..., 3) the rotation vectors, of at most half a turn, of Euler parameters (..., 4)."""
    p = np.where(p[..., :1] < 0.0, -p, p)
    sine = np.linalg.norm(p[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, p[..., :1])
    vector: Floats = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0) * p[..., 1:]
    return vector


def skew(a: Floats) -> Floats:
    """Matrices a~ (..., 3, 3) of vectors (..., 3): a~ b = a x b."""
    matrix = np.zeros((*a.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    return matrix - np.swapaxes(matrix, -1, -2)


def adjoint(a: Pose) -> Floats:
    """(..., 6, 6) matrices from twists in the inner frames to the same in the outer ones."""
    A = rotation(a.p)
    matrix = np.zeros((*A.shape[:-2], 6, 6))
    matrix[..., :3, :3] = matrix[..., 3:, 3:] = A
    matrix[..., :3, 3:] = skew(a.r) @ A
    return matrix
