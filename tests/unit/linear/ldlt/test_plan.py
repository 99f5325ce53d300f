"""What the elimination program costs: fill and size, by the graph of bodies and joints."""

import numpy as np
import pytest
from support.graphs import Case, chain, free_star, full_case, ring, star, tree
from support.internals import make_plan


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
