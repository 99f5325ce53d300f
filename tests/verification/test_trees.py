"""Trees in joint coordinates against method standard and closed forms: many trees, long motions."""

import numpy as np
import pytest
from support import trees
from unit.formulations.joint.test_equations import ACCELERATIONS, MULTIPLIERS, differences

import dap3d_core as dap

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    "first", [0, 20, 40, *(pytest.param(k, marks=pytest.mark.long) for k in range(60, 200, 20))]
)
def test_200_random_trees_have_the_accelerations_of_standard(first):
    """Up to 40 bodies on all standard joints that bend, some free; 60 of them outside releases."""
    for seed in range(first, first + 20):
        tree = trees.random_tree(1 + (7 * seed) % 40, 1000 + seed, free=0.05, lag=1 + seed % 10)
        a, multipliers = differences(tree)
        assert a < ACCELERATIONS, seed
        assert multipliers < MULTIPLIERS, seed


@pytest.mark.parametrize("n", [100, 1000])
def test_long_chains_have_the_accelerations_of_standard(n):
    """A chain's condition number grows with its length; so do both roundings."""
    a, multipliers = differences(trees.mixed_chain(n))
    assert a < n * 1e-14
    assert multipliers < n * 1e-13


def test_energy_is_kept_over_five_minutes():
    """A pendulum of three rods: drift per second as little as the tolerance, and no row opens."""
    found = dap.simulate(trees.mixed_chain(3), t_end=300.0, dt=10.0, rtol=1e-10, method="joint")
    energy = found.energy.total
    assert np.max(np.abs(energy - energy[0])) < 300.0 * 1e-9
    assert found.ledger["position"].value < 1e-12
    assert found.ledger["velocity"].value < 1e-11
