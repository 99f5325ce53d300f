"""Vectors of one body in its own axes."""

import numpy as np
import pytest
from support.internals import BODY_WIDTH, A, P, compiled, gyroscopic_moment, orient_by_state
from support.rotations import rotation


@compiled
def store_moment(J, w, out):
    """``gyroscopic_moment``, which is put into its callers."""
    x = J[0], J[1], J[2], J[3], J[4], J[5]
    out[0], out[1], out[2] = gyroscopic_moment(x, (w[0], w[1], w[2]))


def moment(J, w):
    """Of a body with this inertia."""
    out = np.zeros(3)
    store_moment(J[np.triu_indices(3)], np.array(w), out)
    return out


@pytest.mark.parametrize("seed", range(5))
def test_the_gyroscopic_moment_is_that_of_its_definition(seed):
    """To some roundings of its largest term."""
    rng = np.random.default_rng(seed)
    J, w = rng.normal(size=(3, 3)), rng.normal(size=3)
    J = J @ J.T + np.eye(3)
    size = np.linalg.norm(J) * (w @ w)
    assert np.allclose(moment(J, w), np.cross(w, J @ w), rtol=0.0, atol=1e-15 * size)


def test_that_of_a_sphere_is_zero():
    """To the last digit, whatever its size and angular velocity."""
    assert not moment(0.3 * np.eye(3), (0.1, -7.3, 1e5)).any()


@compiled
def orient(s, e):
    """``orient_by_state``, which is put into its callers."""
    orient_by_state(s, 0, (e[0], e[1], e[2], e[3]))


@pytest.mark.parametrize("length", [1.0, 1e-3, 7.0])
def test_their_length_does_not_matter(length):
    """The matrix is that of the unit parameters, to rounding."""
    p = np.array([0.1, -0.7, 0.5, 0.5]) / np.linalg.norm([0.1, -0.7, 0.5, 0.5])
    s = np.zeros(BODY_WIDTH)
    orient(s, length * p)
    assert np.allclose(s[P : P + 4], p, rtol=0.0, atol=4e-16)
    expected = rotation(p)
    assert np.allclose(s[A : A + 9].reshape(3, 3), expected, rtol=0.0, atol=1e-15)
