"""Rotation matrices and unit Euler parameters from Euler parameters of any length."""

import numpy as np
import pytest
from support.internals import BODY_WIDTH, compiled
from support.rotations import rotation

from dap3d_core.assembly.orientation import orient_by_state
from dap3d_core.kernels.runtime.loop_support import A, P


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
