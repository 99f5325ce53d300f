"""Coefficients of Radau IIA: order conditions, its transformation, its error estimate."""

import numpy as np
import pytest

from dap3d_core.integrators.radau.tableau import radau_method


def test_coefficients_have_order_five():
    """B(5) and C(3) of Radau IIA, b the last row of A; its transformation; HW II, IV.5."""
    m = radau_method()
    for q in range(1, 6):
        assert m.A[2] @ m.c ** (q - 1) == pytest.approx(1.0 / q, abs=1e-15)
    for q in range(1, 4):
        assert m.A @ m.c ** (q - 1) == pytest.approx(m.c**q / q, abs=1e-15)
    gamma, alpha, beta = m.poles
    blocks = np.array([[gamma, 0, 0], [0, alpha, -beta], [0, beta, alpha]])
    assert m.T_inverse @ m.inverse @ m.T == pytest.approx(blocks, abs=1e-13)
    # the error estimate is zero for polynomials up to degree 3: gamma h f(0) + e Z, scaled
    for q in range(1, 4):
        f0 = 1.0 if q == 1 else 0.0
        assert f0 + m.e @ m.c**q == pytest.approx(0.0, abs=1e-13)
