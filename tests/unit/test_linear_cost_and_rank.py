"""What the elimination program costs, and how many rows are independent."""

import numpy as np
import pytest
from support.graphs import (
    Case,
    chain,
    free_star,
    full_case,
    hub_under_hub,
    ring,
    star,
    three_bodies_on_a_hub,
    tree,
    two_wheels,
    wheel,
)

from dap3d_core.linear.plan import make_plan
from dap3d_core.linear.rank import dense_rank, sparse_rank

# ------------------------------------------------------------------ what it costs


@pytest.mark.parametrize("name", ["chain", "welded chain", "star", "free star"])
def test_chains_and_stars_have_no_fill(name):
    """No block of their factors was zero before: an exact count."""
    assert full_case(name).plan.fill == 0


def test_trees_have_little_fill():
    """A cheap node between dear ones may go first and leave a block: on the average of many trees
    of 25 bodies not one, and in no tree as many as there are joints."""
    fill = [Case(tree(25, rng := np.random.default_rng(k)), rng).plan.fill for k in range(50)]
    assert np.mean(fill) < 1.0
    assert max(fill) < 25


def test_joints_between_the_same_bodies_share_a_node_within_six_rows():
    """Two joints of 2 and 3 rows between bodies 1 and 2 are one node; one of 2 more starts anew."""
    joints = [((1, 0), 3), ((2, 1), 2), ((1, 2), 3), ((2, 1), 2)]
    plan = make_plan(2, [s for s, _ in joints], [m for _, m in joints])
    assert [node.joints for node in plan.ordering.nodes] == [(0,), (1, 2), (3,)]


def size_of_plan(graph):
    n, joints = graph
    plan = make_plan(n, [s for s, _ in joints], [m for _, m in joints])
    return np.array([plan.matrix_size, len(plan.updates), len(plan.contributions), plan.fill])


@pytest.mark.parametrize("family", [chain, star, free_star])
def test_cost_of_a_tree_is_linear(family):
    """From 500 to 1000 and on to 1500 bodies the program grows by the same numbers, exactly."""
    small, medium, large = (size_of_plan(family(n)) for n in (500, 1000, 1500))
    assert np.array_equal(large - medium, medium - small)
    assert large[1] <= 3 * 1500  # products of blocks: three for each joint at most


def test_a_ring_costs_little_more_than_a_chain():
    """Closing a chain of 500 bodies adds one block of fill at most for each body."""
    opened, closed = size_of_plan(chain(500)), size_of_plan(ring(500))
    assert closed[3] <= 500
    assert closed[0] <= 2 * opened[0]


# ------------------------------------------------------------------ rank

REDUNDANT = {
    "two hinges": lambda rng: (2, [((1, 0), 5), ((2, 1), 5), ((1, 2), 4)]),
    "doubled on ground": lambda rng: (2, [((1, 0), 5), ((1, 0), 4), ((2, 1), 3)]),
    "ring": lambda rng: ring(6, 5),
    "ring of welds": lambda rng: ring(5, 6),
    "wheel": lambda rng: stiff(wheel(7, True)),
    "free wheel": lambda rng: stiff(wheel(7, False)),
    "two wheels": lambda rng: stiff(two_wheels(6)),
    "hubs": lambda rng: stiff(hub_under_hub(6)),
    "tree": lambda rng: tree(15, rng),
    "three bodies": lambda rng: stiff(three_bodies_on_a_hub(rng)),
}


def stiff(graph):
    """The same graph with five rows and more in every joint: far more than there are freedoms."""
    n, joints = graph
    return n, [(slots, 5 + (k % 2)) for k, (slots, _) in enumerate(joints)]


@pytest.mark.parametrize("name", REDUNDANT)
def test_both_ranks_agree(name):
    """Singular values and pivots find the same rank; without the rows that the pivots name, the
    others are independent and as many as the rank.

    Pivots are squares of lengths and 1e-10 of a row's is zero. Without pivoting one in some hundred
    random graphs has a prefix so near to singular that rounding comes up to that; these have not.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        case = Case(REDUNDANT[name](rng), rng)
        dense = dense_rank(case.dense)
        sparse = sparse_rank(case.plan, case.D, case.metric, case.places, 6 * case.n)
        assert (dense.rank, dense.redundant, dense.dof) == (
            sparse.rank,
            sparse.redundant,
            sparse.dof,
        )
        assert (dense.method, sparse.method) == ("svd", "pivots")
        kept = np.delete(case.dense, sparse.shared, axis=0)
        assert len(kept) == np.linalg.matrix_rank(kept, tol=1e-9) == dense.rank


def test_sparse_rank_leaves_the_blocks_as_they_were():
    """The blocks are scaled in a copy: D is the caller's, bit for bit."""
    case = full_case("wheel")
    case.metric[1:] *= 3.0
    before = case.D.copy()
    sparse_rank(case.plan, case.D, case.metric, case.places, 6 * case.n)
    assert np.array_equal(case.D, before)


def test_dense_rank_names_the_rows_of_a_dependency():
    """Row 3 = row 0 + 2 row 1 of 5: these take part, rows 2 and 4 do not; the combination vanishes
    to rounding, and no row at all is rank 0."""
    rng = np.random.default_rng(4)
    D = rng.normal(size=(5, 12))
    D[3] = D[0] + 2.0 * D[1]
    found = dense_rank(D)
    assert (found.rows, found.columns, found.rank, found.redundant, found.dof) == (5, 12, 4, 1, 8)
    assert found.shared == (0, 1, 3)
    assert found.dependencies @ D == pytest.approx(np.zeros((1, 12)), abs=1e-14)
    weights = found.dependencies[0] / found.dependencies[0, 3]
    assert weights == pytest.approx([-1.0, -2.0, 0.0, 1.0, 0.0], abs=1e-13)
    assert dense_rank(np.zeros((0, 6))).rank == 0
    assert dense_rank(np.zeros((2, 6))).rank == 0
