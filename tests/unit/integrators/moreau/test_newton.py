"""Impulses of contacts: the law is met to rounding, also by dependent rows and unlike masses."""

import numpy as np

from dap3d_core.integrators.moreau.arrays import CONE
from dap3d_core.integrators.moreau.matrix import (
    factor_blocks,
    factor_square,
    solve_blocks,
    solve_square,
)
from dap3d_core.integrators.moreau.newton import put_missed, put_projected, put_slopes


def project(z, mu):
    """(m, 3) impulses next to z (m, 3) that Coulomb's law allows, given the normal ones."""
    found = np.zeros_like(z)
    for one, k, out in zip(z, mu, found, strict=True):
        put_projected(one, k * max(0.0, one[0]), CONE, out)
    return found


def slopes(z, mu):
    """(m, 3, 3) derivatives of ``project``."""
    found = np.zeros((len(mu), 9))
    for one, k, out in zip(z, mu, found, strict=True):
        put_slopes(one, k, k * max(0.0, one[0]), CONE, out)
    return found.reshape(-1, 3, 3)


def distance(x, u, mu, r):
    """(m, 3) what impulses x miss Coulomb's law by at velocities u, both (m, 3)."""
    found = np.zeros_like(x)
    for one, v, k, m, out in zip(x, u, mu, r, found, strict=True):
        put_missed(one, v, k * max(0.0, one[0]), CONE, m, out)
    return found


def test_slopes_are_those_of_the_projection():
    """Compared with central differences, away from the places where it bends."""
    rng, step = np.random.default_rng(1), 1e-6
    z, mu = rng.standard_normal((40, 3)), np.full(40, 0.5)
    B = slopes(z, mu)
    for k in range(3):
        d = np.zeros((1, 3))
        d[0, k] = step
        expected = (project(z + d, mu) - project(z - d, mu)) / (2.0 * step)
        assert np.abs(B[:, :, k] - expected).max() < 1e-8  # of the difference


def test_impulses_that_fulfil_the_law_have_no_distance():
    """One that is open, one that sticks, one that slides against its friction."""
    x = np.array([[0.0, 0.0, 0.0], [2.0, 0.3, 0.0], [2.0, -1.0, 0.0]])
    u = np.array([[0.1, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    mu, r = np.full(3, 0.5), np.ones(3)
    assert np.abs(distance(x, u, mu, r)).max() < 1e-15
    assert np.abs(distance(x, -u, mu, r)).max() > 0.05


def test_elimination_solves_as_numpy_does():
    rng = np.random.default_rng(2)
    K, x = rng.standard_normal((30, 30)), rng.standard_normal(30)
    expected, found = np.linalg.solve(K, x), x.copy()
    factors, exchanged = K.ravel().copy(), np.zeros(len(x), dtype=np.int64)
    factor_square(factors, exchanged, len(x))
    solve_square(factors, exchanged, found, len(x))
    assert np.abs(found - expected).max() < 1e-11  # condition of some hundreds


def test_elimination_by_blocks_solves_as_numpy_does():
    """An arrow and a chain of blocks, which elimination fills where the pattern says."""
    rng, n = np.random.default_rng(3), 5
    start, entries = np.array([0, 2, 4, 5, 6, 6]), np.array([1, 4, 4, 2, 4, 4])
    K = np.zeros(36 * (n + 2 * len(entries)))
    full = np.zeros((n, 6, n, 6))
    for a in range(n):
        full[a, :, a] = K[36 * a :][:36].reshape(6, 6)[:] = rng.standard_normal((6, 6))
    for a in range(n):
        for e in range(start[a], start[a + 1]):
            for row, column, part in ((entries[e], a, 0), (a, entries[e], 1)):
                block = K[36 * (n + 2 * e + part) :][:36].reshape(6, 6)
                full[row, :, column] = block[:] = rng.standard_normal((6, 6))
    x = rng.standard_normal(6 * n)
    expected = np.linalg.solve(full.reshape(6 * n, 6 * n), x)
    scratch = np.zeros(36)
    factor_blocks(K, n, start, entries, np.zeros(n, dtype=np.int64), scratch)
    solve_blocks(K, x, n, start, entries, scratch)
    assert np.abs(x - expected).max() < 1e-11  # condition of some hundreds
