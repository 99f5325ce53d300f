"""Steps of the search for an equilibrium: Newton's, limited, off a ridge."""

import numpy as np
import pytest
from support.internals import trust_region_step


def test_a_short_step_is_newtons_also_without_symmetry():
    K = np.array([[3.0, 1.0], [0.5, 2.0]])
    g = np.array([0.1, -0.2])
    step = trust_region_step(K, g, 1.0, 10.0)
    assert step.is_newton
    assert K @ step.y == pytest.approx(g, rel=1e-14)
    assert step.gain == pytest.approx(g @ step.y - 0.5 * step.y @ K @ step.y, rel=1e-14)


@pytest.mark.parametrize("least", [2.0, 0.0, -3.0])
def test_a_long_step_is_cut_to_the_radius_by_a_damper(least):
    """(K + mu I) y = g with K + mu I positive definite: so y goes with g, whatever K is."""
    rng = np.random.default_rng(0)
    Q = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    K = Q @ np.diag([least, 3.0, 4.0, 5.0, 6.0]) @ Q.T
    g = 10.0 * Q @ np.ones(5)
    step = trust_region_step(K, g, 10.0, 0.5)
    assert not step.is_newton
    assert np.linalg.norm(step.y) == pytest.approx(0.5, rel=0.11)  # mu is found to a tenth
    mu = (g @ step.y - step.y @ K @ step.y) / (step.y @ step.y)
    assert np.linalg.norm(K @ step.y + mu * step.y - g) < 0.06 * np.linalg.norm(g)
    assert mu > -least
    assert step.gain > 0.0


def test_freedoms_that_nothing_pushes_stay_unless_a_ridge_is_left():
    """The second has a negative stiffness, the third none."""
    K, g = np.diag([1.0, -1.0, 0.0]), np.array([0.1, 0.0, 0.0])
    step = trust_region_step(K, g, 1.0, 0.5)
    assert step.is_newton
    assert step.y == pytest.approx([0.1, 0.0, 0.0], abs=1e-15)
    off = trust_region_step(K, 0.0 * g, 1.0, 0.5, leaves=True)
    assert np.abs(off.y) == pytest.approx([0.0, 0.5, 0.0], abs=1e-15)
    assert off.gain > 0.0
