"""Weighted sums of stages, against the tableaus and exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from support.integrands import ALL

from dap3d_core.integrators import TABLEAUS
from dap3d_core.integrators.runge_kutta.sums import NUMBER, coefficients, combinations, combine


@pytest.mark.parametrize("size", [1, 3, 4, 8, 14, 15])
@pytest.mark.parametrize("name", ALL)
def test_sums_are_those_of_the_tableau(name, size):
    """Of all rows, for sizes with and without a rest in vectors: within rounding of exact sums, and
    rows that are written out have the bits of those that are read from the table."""
    method, rng = TABLEAUS[name], np.random.default_rng(size)
    rows, table = coefficients(method), combinations(method)
    assert all(table[np.any(rows != 0.0, axis=1), NUMBER] > 0)
    read = table.copy()
    read[:, NUMBER] = 0
    k, y, h = rng.standard_normal((len(method.a), size)), rng.standard_normal(size), 0.25
    for i, row in enumerate(rows):
        found, other = np.full((2, size), np.nan)
        combine(found, 1.0, y, h, table, i, k)
        combine(other, 1.0, y, h, read, i, k)
        assert found.tobytes() == other.tobytes(), i
        for m in range(size):
            terms = [Fraction(w) * Fraction(x) for w, x in zip(row, k[:, m], strict=True)]
            exact = Fraction(y[m]) + Fraction(h) * sum(terms)
            # products and sums of up to a dozen terms round some 24 times
            bound = 24 * 2.0**-53 * (abs(y[m]) + h * float(sum(map(abs, terms))))
            assert abs(float(Fraction(found[m]) - exact)) <= bound, (i, m)
