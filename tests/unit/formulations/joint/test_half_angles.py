"""Sines and cosines of half angles, against mpmath."""

import mpmath
import numpy as np
import pytest

from dap3d_core.formulations.joint.half_angles import half_angles

EPSILON = np.finfo(float).eps


@pytest.mark.parametrize("size", [1e-9, 1.0, 30.0, 1e5, 1e7])
def test_half_angles_are_right_to_the_last_digit_but_one(size):
    """Of any angle, also beyond the range of the reduction; exact at multiples of pi to rounding.
    Half a unit in the last place of the reduction, one of the polynomial and of the result: below
    two, relative to 1 where the function vanishes."""
    rng = np.random.default_rng(2)
    quarters = np.pi * np.rint(rng.uniform(-size, size, size=20) / np.pi)
    q = np.concatenate([rng.uniform(-size, size, size=200), quarters, [0.0, -0.0]])
    sines, cosines = np.empty(len(q)), np.empty(len(q))
    half_angles(q, sines, cosines)
    with mpmath.workdps(40):
        right = [(mpmath.sin(mpmath.mpf(x) / 2), mpmath.cos(mpmath.mpf(x) / 2)) for x in q.tolist()]
        errors = [
            [float(abs(found - exact)) for found, exact in zip(pair, exacts, strict=True)]
            for pair, exacts in zip(zip(sines.tolist(), cosines.tolist(), strict=True), right,
                                    strict=True)
        ]  # fmt: skip
    assert np.max(errors) < 2.0 * EPSILON
