"""Poses and twists: exponentials against the matrix exponential, adjoints against products."""

import numpy as np
import pytest
from scipy.linalg import expm
from support.internals import (
    Pose,
    adjoint,
    compose,
    cross,
    exponential,
    inverse,
    matrices,
    relative,
    rotation_vector,
    skew,
    turned,
)
from support.rotations import rotation, to_global


def matrix(pose):
    """The homogeneous matrix of one pose."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(pose.p), pose.r
    return T


def twist_matrix(twist):
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = skew(twist[3:]), twist[:3]
    return X


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, 7.0])
def test_exponential_is_that_of_the_matrix(size):
    """Of rotations from none over tiny ones to more than a turn."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        twist = rng.normal(size=6)
        twist[3:] *= size / np.linalg.norm(twist[3:])
        # expm works by squaring: its error grows with the norm
        np.testing.assert_allclose(
            matrix(exponential(twist)), expm(twist_matrix(twist)), atol=1e-14 * (1.0 + size)
        )


def test_products_of_vectors_and_matrices_of_quaternions():
    """As numpy's, and as those of any Euler parameters; of one with many, too."""
    a, b = np.random.default_rng(5).normal(size=(2, 4, 1, 3))
    np.testing.assert_allclose(cross(a, b.reshape(1, 4, 3)), np.cross(a, b.reshape(1, 4, 3)))
    p = exponential(np.random.default_rng(6).normal(size=(4, 6))).p
    np.testing.assert_allclose(matrices(p), rotation(p), atol=1e-15)
    np.testing.assert_allclose(turned(p, a[:, 0]), to_global(p, a[:, 0]), atol=1e-14)


def test_adjoint_carries_twists():
    """T exp(x) = exp(Ad x) T."""
    a, x = np.random.default_rng(2).normal(size=(2, 6))
    pose = exponential(a)
    one = compose(pose, exponential(x))
    other = compose(exponential(adjoint(pose) @ x), pose)
    np.testing.assert_allclose(matrix(one), matrix(other), atol=1e-14)


def test_relative_poses_and_inverses():
    a, b = (exponential(x) for x in np.random.default_rng(3).normal(size=(2, 5, 6)))
    gone = compose(a, relative(a, b))
    np.testing.assert_allclose(gone.r, b.r, atol=1e-15 * 10)
    np.testing.assert_allclose(rotation(gone.p), rotation(b.p), atol=1e-15 * 10)
    none = compose(a, inverse(a))
    np.testing.assert_allclose(none.r, 0.0, atol=1e-15 * 10)


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.5, np.pi - 1e-6])
def test_rotation_vector_is_the_logarithm(size):
    w = np.array([2.0, -1.0, 2.0]) / 3.0 * size
    p = exponential(np.concatenate([np.zeros(3), w])).p
    for same in (p, -p):
        np.testing.assert_allclose(rotation_vector(same), w, atol=1e-15, rtol=1e-14)


def test_poses_broadcast():
    """One pose with many, as a result has them: instants by joints."""
    many = exponential(np.random.default_rng(4).normal(size=(7, 3, 6)))
    one = Pose(many.r[0], many.p[0])
    gone = relative(one, many)
    assert gone.r.shape == (7, 3, 3)
    np.testing.assert_allclose(gone.r[0], 0.0, atol=1e-15 * 10)
