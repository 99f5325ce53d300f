"""L D L^T within a profile against numpy."""

import numpy as np
import pytest
from support import loops, trees

from dap3d_core.formulations.joint_loops import profile
from dap3d_core.formulations.joint_loops.layout import COUPLED, PLACE
from dap3d_core.simulation import CompiledModel


def dense(kept):
    """``matrix`` as a dense one."""
    m = len(kept.profile)
    S = np.zeros((m, m))
    for j, (first, place) in enumerate(kept.profile[:, [COUPLED, PLACE]].tolist()):
        S[j, first : j + 1] = S[first : j + 1, j] = kept.matrix[place + first : place + j + 1]
    return S


@pytest.mark.parametrize("seed", range(3))
def test_a_profile_is_solved_as_a_dense_matrix(seed):
    """The rows of loops on a tree, of which some do not meet; any positive matrix."""
    scene = loops.add_loops(trees.random_tree(20, seed, lag=2), seed, 5, ("sph",))
    system = CompiledModel(scene, method="joint").evaluator.system
    kept, rng = system.tree.kept, np.random.default_rng(seed)
    kept.matrix[:] = rng.normal(size=kept.matrix.size)
    diagonal = kept.profile[:, PLACE] + np.arange(len(kept.profile))
    kept.matrix[diagonal] += 2.0 * len(kept.profile)
    kept.right[:] = rng.normal(size=kept.right.size)
    kept.compliance[:] = 0.0
    expected = np.linalg.solve(dense(kept), kept.right)
    assert profile.factor_profile(system)
    profile.solve_profile(system)
    assert kept.multipliers == pytest.approx(expected, abs=1e-14)


def test_dependent_rows_are_solved_where_their_right_sides_agree():
    """A matrix of rank m - 1 with E: S lambda = right to rounding, whatever E."""
    scene = loops.add_loops(trees.random_tree(6, 1, lag=1), 1, 2, ("sph",))
    system = CompiledModel(scene, method="joint").evaluator.system
    kept, rng = system.tree.kept, np.random.default_rng(1)
    m = len(kept.profile)
    G = rng.normal(size=(m, m - 1))
    for j, (first, place) in enumerate(kept.profile[:, [COUPLED, PLACE]].tolist()):
        kept.matrix[place + first : place + j + 1] = G[j] @ G[first : j + 1].T
    S = dense(kept)
    assert np.linalg.matrix_rank(S) == m - 1  # all rows of this scene couple
    kept.right[:] = S @ rng.normal(size=m)
    kept.compliance[:] = profile.PART * np.diag(S)
    assert profile.factor_profile(system)
    profile.solve_profile(system)
    assert S @ kept.multipliers == pytest.approx(kept.right, abs=1e-12 * np.max(np.abs(S)))
