"""Least solutions against singular values; an inverse."""

import numpy as np
import pytest

from dap3d_core.linear.least_squares import factor_least, invert, solve_least

PART = 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_solutions_are_those_by_singular_values(seed):
    rng = np.random.default_rng(seed)
    m, n = (int(k) for k in rng.integers(1, 13, 2))
    least = int(rng.integers(1, min(m, n) + 1))
    A, b = rng.normal(size=(m, least)) @ rng.normal(size=(least, n)), rng.normal(size=m)
    room, w, order, x = np.ones((14, 14)), np.zeros((3, 14)), np.zeros(14, dtype=int), np.zeros(n)
    room[:m, :n] = A
    rank = factor_least(room, m, n, PART, 0.0, w, order)
    solve_least(room, m, n, rank, w, order, b.copy(), x)
    assert rank == least
    values = np.linalg.svd(A, compute_uv=False)[:rank]
    error = 1e-14 * (values[0] / values[-1]) ** 2  # of the condition, as residuals are not zero
    assert np.abs(x - np.linalg.lstsq(A, b, rcond=PART)[0]).max() <= error * np.abs(x).max()


def test_columns_that_are_short_count_as_dependent():
    A, w, order = np.diag([1.0, 1e-3]), np.zeros((3, 2)), np.zeros(2, dtype=int)
    assert factor_least(A.copy(), 2, 2, 0.0, 1e-4, w, order) == 2
    assert factor_least(A.copy(), 2, 2, 0.0, 1e-2, w, order) == 1


def test_the_inverse_of_a_matrix_takes_its_place():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(5, 5))
    A[0, 0] = 0.0  # pivots are chosen
    table = np.hstack([A, np.eye(5)])
    assert invert(table.ravel(), 5) == pytest.approx(np.linalg.det(A))  # a view
    assert table[:, 5:] @ A == pytest.approx(np.eye(5), abs=1e-12)
