"""Coefficients of the explicit Runge-Kutta methods, against their conditions and SciPy's copies."""

import numpy as np
import pytest
from scipy.integrate._ivp import dop853_coefficients
from scipy.integrate._ivp.rk import RK45
from support.integrands import ALL

from dap3d_core.integrators import TABLEAUS


@pytest.mark.parametrize("name", ALL)
def test_tableau_is_consistent(name):
    """Rows of a sum to c, and b integrates powers of t up to the order of the method."""
    method = TABLEAUS[name]
    assert method.name == name
    assert np.allclose(method.a.sum(axis=1), method.c, rtol=0, atol=1e-13)
    b, c = method.a[method.stages], method.c
    for q in range(1, method.order + 1):
        assert b @ c ** (q - 1) == pytest.approx(1 / q, abs=1e-14)


def test_coefficients_are_those_of_scipy():
    """DOP853 and DOPRI5 agree with the independent copies in scipy."""
    method = TABLEAUS["dop853"]
    assert np.array_equal(method.a, dop853_coefficients.A)
    assert np.array_equal(method.c, dop853_coefficients.C)
    assert np.array_equal(method.d, dop853_coefficients.D)
    assert np.array_equal(method.e[0, :13], dop853_coefficients.E5)
    assert np.array_equal(method.e[1, :13], dop853_coefficients.E3)
    method = TABLEAUS["dopri5"]
    assert np.allclose(method.a[:6, :5], RK45.A, rtol=1e-15)
    assert np.allclose(method.a[6, :6], RK45.B, rtol=1e-15)
    assert np.allclose(method.e[0], -RK45.E, rtol=1e-15)
    assert np.allclose(method.d[0], RK45.P[:, 3], rtol=1e-14)
