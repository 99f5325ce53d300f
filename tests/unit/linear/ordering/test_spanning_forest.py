"""Which joints a spanning forest cuts, against all forests of small mechanisms."""

from itertools import combinations

import numpy as np
import pytest

from dap3d_core.linear.ordering.spanning_forest import CARRY, spanning_forest


def components(count, edges):
    """Number of connected parts of ground and bodies."""
    part = list(range(count + 1))

    def root(b):
        while part[b] != b:
            b = part[b]
        return b

    for a, b in edges:
        part[root(a)] = root(b)
    return len({root(b) for b in range(count + 1)})


def fewest_rows(count, ends, rows):
    """The fewest rows outside of a spanning forest, of all of them."""
    size = count + 1 - components(count, ends.values())
    return min(
        sum(rows[k] for k in ends if k not in chosen)
        for chosen in combinations(ends, size)
        if components(count, [ends[k] for k in chosen]) == components(count, ends.values())
    )


def random_graph(seed, count=5, joints=8):
    rng = np.random.default_rng(seed)
    pairs = [tuple(rng.choice(count + 1, size=2, replace=False).tolist()) for _ in range(joints)]
    return dict(enumerate(pairs)), rng.integers(3, 6, size=joints).tolist()


@pytest.mark.parametrize("seed", range(20))
def test_forest_of_a_random_graph(seed):
    """It spans, parents come first, the loop of each cut closes, and its work counts all ways."""
    ends, rows = random_graph(seed)
    forest = spanning_forest(5, ends, rows)
    assert sorted(forest.child.tolist()) == [1, 2, 3, 4, 5]
    seen = {0}
    for joint, parent, child in zip(forest.joint, forest.parent, forest.child, strict=True):
        assert parent in seen
        seen.add(int(child))
        assert joint < 0 or set(ends[int(joint)]) == {parent, child}
    free = int(np.sum(forest.joint < 0))
    assert free == components(5, ends.values()) - 1
    assert {cut.joint for cut in forest.cuts} == set(ends) - set(forest.joint.tolist())
    for cut in forest.cuts:
        bodies = [b for k in (*cut.loop, cut.joint) for b in ends[k]]
        assert all(bodies.count(b) == 2 for b in bodies)
    assert forest.kept_rows >= fewest_rows(5, ends, rows)
    assert forest.work >= CARRY * sum(cut.rows * cut.node_count for cut in forest.cuts)


@pytest.mark.parametrize("seed", range(20))
def test_fewest_rows_are_kept_where_all_ways_are_equal(seed):
    """Bodies that all hang on ground, twice each: the joint of more rows is in the forest."""
    rng = np.random.default_rng(seed)
    ends = {k: (0, 1 + k % 4) for k in range(8)}
    rows = rng.integers(3, 6, size=8).tolist()
    forest = spanning_forest(4, ends, rows)
    assert forest.kept_rows == fewest_rows(4, ends, rows)


def test_a_four_bar_is_cut_at_the_joint_of_fewest_rows():
    """Revolutes on ground and a universal and a spherical joint on the coupler: cut is the last."""
    ends = {0: (1, 0), 1: (2, 1), 2: (3, 2), 3: (3, 0)}
    forest = spanning_forest(3, ends, [5, 4, 3, 5])
    (cut,) = forest.cuts
    assert (cut.joint, cut.rows, cut.node_count) == (2, 3, 3)
    assert set(cut.loop) == {0, 1, 3}
    names = ["crank", "cross", "ball", "follower"]
    assert cut.words(names) == "it closes a loop with follower, crank, cross"


@pytest.mark.parametrize(("light", "cut"), [((), 2), ((2,), 3), ((3,), 1), ((1, 2, 3), 2)])
def test_a_loop_is_not_cut_at_a_body_without_mass(light, cut):
    """The four-bar of above, whose joint of fewest rows has bodies 2 and 3; the joint across from
    a light body is cut, and where all are light that of fewest rows."""
    ends = {0: (1, 0), 1: (2, 1), 2: (3, 2), 3: (3, 0)}
    forest = spanning_forest(3, ends, [5, 4, 3, 5], light)
    assert [one.joint for one in forest.cuts] == [cut]


def test_a_ladder_is_cut_near_ground():
    """Cranks on ground, couplers between them: every row is carried over three bodies, not all.
    Work grows with the number of loops, as neighbours alone meet."""

    def ladder(loops):
        """Cranks 1 to loops + 1, couplers behind them."""
        ends = {}
        cranks = range(1, loops + 2)
        for crank in cranks:
            ends[len(ends)] = (crank, 0)
        for k, crank in enumerate(cranks[:-1]):
            coupler = loops + 2 + k
            ends[len(ends)] = (coupler, crank)
            ends[len(ends)] = (coupler, crank + 1)
        return 2 * loops + 1, ends, [5] * len(ends)

    few, many = (spanning_forest(*ladder(n)) for n in (20, 40))
    assert [cut.node_count for cut in many.cuts] == [3] * 40
    assert many.kept_rows == 200
    assert many.work / few.work == pytest.approx(2.0, rel=0.05)


def test_long_ways_are_worth_more_rows():
    """A chain of 60 revolutes with every body on a ball on ground: the balls are the forest."""
    n = 60
    ends = {k: (k + 1, k) for k in range(n)} | {n + k: (k + 1, 0) for k in range(1, n)}
    rows = [5] * n + [0] + [3] * (n - 1)
    forest = spanning_forest(n, ends, rows)
    assert {cut.joint for cut in forest.cuts} == set(range(1, n))
    assert max(cut.node_count for cut in forest.cuts) == 2
    assert forest.kept_rows == 5 * (n - 1)


def test_a_tree_is_not_cut_and_a_chain_stays_in_one_piece():
    """Two branches of three bodies: each body stands behind its parent."""
    ends = {0: (1, 0), 1: (3, 1), 2: (5, 3), 3: (2, 0), 4: (4, 2), 5: (6, 4)}
    forest = spanning_forest(6, ends, [5] * 6)
    assert forest.cuts == ()
    assert forest.work == 0
    assert forest.child.tolist() == [1, 3, 5, 2, 4, 6]
    assert forest.parent.tolist() == [0, 1, 3, 0, 2, 4]


def test_bodies_without_joints_and_two_joints_between_the_same_bodies():
    """Both are free bodies of the forest, but for the second; the weaker joint is cut."""
    forest = spanning_forest(3, {0: (2, 1), 1: (1, 2)}, [3, 5])
    assert forest.joint.tolist() == [-1, 1, -1]
    assert forest.child.tolist() == [1, 2, 3]
    (cut,) = forest.cuts
    assert (cut.joint, cut.loop, cut.node_count) == (0, (1,), 2)
    assert spanning_forest(0, {}, []).child.tolist() == []
