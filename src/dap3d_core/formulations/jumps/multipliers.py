"""Impulses of rows: A Lambda = b, where some push and do not pull."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats

#: A row is met where it misses its change by no more than this part of the largest one.
MISS = 1e-8
#: Of a row of unit length no freedom is left below this part of what it had without joints.
FREEDOM = 1e-11


def row_impulses(A: Floats, b: Floats, pushes: Any) -> Floats:
    """Impulses Lambda (m,) of rows with A Lambda = b; of those that push 0 <= Lambda.

    Where a row that pushes would have to pull, it is left alone and its rate changes by more than
    b asks for: 0 <= Lambda, 0 <= A Lambda - b, and one of both is zero (Moreau's law). Rows that
    depend on each other share their impulse, by the least sum of squares.

    Args:
        A: (m, m) symmetric, positive semidefinite: changes of the rows' rates by unit impulses;
            for rows that have unit length in the metric of the masses.
        b: (m,) wanted changes.
        pushes: (m,) truth values.
    """
    solution = _least(A, b)
    if not pushes.any() or solution[pushes].min() >= 0.0:
        return solution
    acts = ~pushes | (_complementary(A, b, pushes) > 0.0)
    solution = np.zeros(len(b))
    solution[acts] = _least(A[np.ix_(acts, acts)], b[acts])
    solution[pushes] = np.maximum(solution[pushes], 0.0)
    return solution


def _least(A: Floats, b: Floats) -> Floats:
    """The least solution of A x = b, as far as there is freedom."""
    values, vectors = np.linalg.eigh(A)
    free = values > FREEDOM
    solution: Floats = vectors[:, free] @ ((vectors[:, free].T @ b) / values[free])
    return solution


def _complementary(A: Floats, b: Floats, pushes: Any) -> Floats:
    """(m,) impulses of the rows that push by non-negative least squares; zeros for the others.

    The others are eliminated. S x - c, complementary to x >= 0, is the condition of the least
    |E x - f| with E^T E = S, E^T f = c (Lawson, Hanson, Solving Least Squares Problems, 23).
    """
    from scipy.optimize import nnls

    free = ~pushes
    S, c = A[np.ix_(pushes, pushes)], b[pushes]
    if free.any():
        coupling = A[np.ix_(pushes, free)]
        inner = A[np.ix_(free, free)]
        S = S - coupling @ np.array([_least(inner, row) for row in coupling]).T
        c = c - coupling @ _least(inner, b[free])
    values, vectors = np.linalg.eigh(0.5 * (S + S.T))
    root = np.sqrt(np.maximum(values, FREEDOM))
    E = root[:, None] * vectors.T
    f = (vectors.T @ c) / root
    found = np.zeros(len(b))
    found[pushes] = nnls(E, f)[0]
    return found


def missed_rows(A: Floats, b: Floats, solution: Floats, pushes: Any) -> Any:
    """Indices of the rows whose rate the impulses do not change as it should: joints hold it."""
    left = A @ solution - b
    left[pushes] = np.minimum(left[pushes], 0.0)
    return np.flatnonzero(np.abs(left) > MISS * np.max(np.abs(b), initial=0.0))
