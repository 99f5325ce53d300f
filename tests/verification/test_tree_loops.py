"""Trees with kept rows against dense solutions and other methods; types from outside."""

import numpy as np
import pytest
from support import loops, trees
from support.process import REPOSITORY
from unit.formulations.joint_loops.test_equations import differences

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

pytestmark = pytest.mark.slow

#: Relative to the largest. Loops have condition numbers of up to 1e4.
ACCELERATIONS, MULTIPLIERS = 1e-11, 1e-10
#: Scenes of the example package, and types of the standard one that bend.
#: First seeds of the trees, twenty from each.
SEEDS = [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(20, 200, 20))]
EXAMPLES = sorted((REPOSITORY / "plugins/dap3d-example/scenes").glob("*.toml"))


@pytest.mark.parametrize("first", SEEDS)
def test_200_trees_with_loops_have_the_accelerations_of_a_dense_solution(first):
    """Up to 42 bodies, up to six joints that close loops; a quarter has redundant rows."""
    for seed in range(first, first + 20):
        n = 2 + (7 * seed) % 40
        tree = trees.random_tree(n, 2000 + seed, free=0.05, lag=1 + seed % 10)
        try:
            a, multipliers = differences(loops.add_loops(tree, seed, 1 + n // 8))
        except dap.AssemblyError:  # two of the 200: no velocities near the random ones, or no pose
            continue
        assert a < ACCELERATIONS, seed
        assert multipliers < MULTIPLIERS, seed


@pytest.mark.parametrize("first", SEEDS)
def test_200_trees_with_double_hinges_have_the_least_multipliers(first):
    """Up to seven hinges of each tree are there twice: five rows of each are redundant."""
    for seed in range(first, first + 20):
        n = 2 + (7 * seed) % 40
        tree = trees.random_tree(n, 2000 + seed, free=0.05, lag=1 + seed % 10)
        a, multipliers = differences(loops.add_twins(tree, seed, 1 + n // 6))
        assert a < ACCELERATIONS, seed
        assert multipliers < MULTIPLIERS, seed


@pytest.mark.parametrize("scene", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_types_of_the_example_package_move_as_in_other_methods(scene):
    """Screws, gears of three bodies, points on planes and surfaces: ten times the tolerance."""
    settings = {"t_end": 0.2, "dt": 0.05, "rtol": 1e-9, "atol": 1e-11, "integrator": "dop853"}
    same_motion(dap.load(scene), dap.load(scene), settings)


def same_motion(usual, other, settings, registry=None):
    """Compare a run of method auto of one scene with a run of method joint of another."""
    right = dap.simulate(usual, **settings)
    found = dap.simulate(CompiledModel(other, method="joint", registry=registry), **settings)
    if right.method != "unconstrained":
        assert found.method == "joint"
    assert found.u == pytest.approx(right.u, abs=1e-8 * np.max(np.abs(right.u)))
    assert found.status == right.status
