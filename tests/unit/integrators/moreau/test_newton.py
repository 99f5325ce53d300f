"""Impulses of contacts: the law is met to rounding, also by dependent rows and unlike masses."""

import numpy as np

from dap3d_core.integrators.moreau.dense import solve_dense
from dap3d_core.integrators.moreau.newton import distance, project, slopes


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
    solve_dense(K.copy(), found)
    assert np.abs(found - expected).max() < 1e-11  # condition of some hundreds
