"""Block LU solves what numpy solves, and has no fill on trees."""

import numpy as np
import pytest
from support.graphs import chain, star
from support.internals import compiled, make_plan

from dap3d_core.linear.lu import factor_lu, make_lu_plan, solve_lu


@compiled
def factor_and_solve(nodes, columns, updates, K, pivots, x):
    found = factor_lu(nodes, columns, updates, K, pivots)
    solve_lu(nodes, columns, K, pivots, x)
    return found


def lu_of(body_count, slots, rows, coupled=()):
    nodes = make_plan(body_count, slots, rows).ordering.nodes
    return nodes, make_lu_plan(body_count, nodes, [*slots, *coupled])


LOOP = (4, [(1, 0), (2, 1), (3, 2), (4, 3), (4, 0)], [5, 5, 3, 3, 2])


@pytest.mark.parametrize("number", [float, complex])
def test_block_lu_solves_what_numpy_solves(number):
    """A loop with springs across it; well conditioned, so that 1e-10 is far above rounding."""
    nodes, lu = lu_of(*LOOP, coupled=[(1, 3), (2, 4)])
    rng = np.random.default_rng(3)
    count = len(nodes)
    first = np.concatenate([lu.joint_first, lu.body_first[1:]])
    size = [2 * node.rows for node in nodes] + [12] * 4
    dense = np.zeros((lu.size, lu.size), dtype=number)
    K = np.zeros(lu.matrix_size, dtype=number)
    for (a, b), place in lu.place.items():
        block = rng.normal(size=(size[a], size[b])) + (4.0 * np.eye(size[a]) if a == b else 0.0)
        if number is complex:
            block = block + 1j * rng.normal(size=block.shape)
        dense[first[a] : first[a] + size[a], first[b] : first[b] + size[b]] = block
        K[place : place + block.size] = block.ravel()
    assert count + 4 == len(first)
    x = rng.normal(size=lu.size).astype(number)
    expected = np.linalg.solve(dense, x)
    pivots = np.zeros(lu.size, dtype=np.int64)
    assert factor_and_solve(lu.nodes, lu.columns, lu.updates, K, pivots, x)
    assert np.max(np.abs(x - expected)) < 1e-10 * np.max(np.abs(expected)) * np.linalg.cond(dense)


@pytest.mark.parametrize("graph", [chain, star])
def test_trees_have_no_fill_and_linear_size(graph):
    """Ten times the bodies: ten times the numbers (but for the ends), and no block is added."""
    plans = []
    for n in (20, 200):
        bodies, joints = graph(n)
        plans.append(lu_of(bodies, [slots for slots, _ in joints], [rows for _, rows in joints])[1])
    small, large = plans
    assert small.fill == large.fill == 0
    assert large.matrix_size / small.matrix_size == pytest.approx(10.0, rel=0.1)
