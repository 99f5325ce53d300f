"""Factors of a symmetric 3x3 pivot, against rational arithmetic."""

import inspect
from fractions import Fraction

import numpy as np
import pytest

from dap3d_core.formulations.joint import reduce

# As plain Python, which has the bits of compiled code: that returns no tuples to Python.
factors_of, solve_factored = map(inspect.unwrap, (reduce.factors_of, reduce.solve_factored))


@pytest.mark.parametrize("light", [(1.0, 1e-9), (1e-3, 1e-6), (1e-9, 1e-9), (1e-6, 1e-12)])
def test_a_pivot_loses_no_digits_about_its_heavy_axis(light):
    """Solutions for what acts along the heavy axis, of eigenvalues 1 and two light ones.
    Along it they are right to rounding; across by rounding over the least eigenvalue, some ten
    operations of entries up to 1. Cofactors would lose the product of both light ones."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        S = (Q @ np.diag([1.0, *light]) @ Q.T)[np.triu_indices(3)].tolist()
        b = Q[:, 0].tolist()
        error = np.array(solve_factored(factors_of(S), b)) - exact_solution(S, b)
        assert abs(Q[:, 0] @ error) < 3e-15
        assert np.abs(error).max() < 3e-15 / min(light)


def exact_solution(S, b):
    """S^-1 b by cofactors of fractions; S by rows of its upper triangle."""
    a00, a01, a02, a11, a12, a22 = map(Fraction, S)
    rows = (
        (a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11),
        (a02 * a12 - a01 * a22, a00 * a22 - a02 * a02, a01 * a02 - a00 * a12),
        (a01 * a12 - a02 * a11, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01),
    )
    det = a00 * rows[0][0] + a01 * rows[0][1] + a02 * rows[0][2]
    return np.array([float(sum(c * Fraction(x) for c, x in zip(row, b, strict=True)) / det)
                     for row in rows])  # fmt: skip
