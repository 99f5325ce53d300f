"""The elimination program solves the saddle-point equations of any graph of bodies and joints."""

import numpy as np
import pytest
from support.graphs import GRAPHS, RANDOM, check_solution, full_case
from support.internals import add_product, scale_blocks

EPS = np.finfo(float).eps
all_graphs = pytest.mark.parametrize("name", [*GRAPHS, *RANDOM])


@all_graphs
def test_solution_is_that_of_the_dense_saddle_point_matrix(name):
    check_solution(full_case(name))


@all_graphs
def test_rows_eliminated_so_far_are_independent_on_the_bodies_eliminated_so_far(name):
    """What the static order promises at each of its places, and what makes every pivot exist.
    Singular values of the prefix and of the same rows on all bodies: where these are independent
    (above 1e-3), those do not vanish (1e-9 is far above rounding)."""
    case = full_case(name)
    ordering = case.plan.ordering
    bodies, rows = set(ordering.early), []
    for k in ordering.order:
        if k >= len(ordering.nodes):
            bodies.add(ordering.hubs[k - len(ordering.nodes)])
            continue
        node = ordering.nodes[k]
        for joint in node.joints:
            rows += list(range(case.start[joint], case.start[joint + 1]))
        columns = [6 * b - 6 + c for b in sorted(bodies) for c in range(6)]
        assert np.linalg.matrix_rank(case.dense[np.ix_(rows, columns)], tol=1e-9) == len(rows)


@all_graphs
def test_every_body_and_row_is_eliminated_once(name):
    """Early bodies and hubs are all bodies; nodes hold each joint once; places of rows differ."""
    case = full_case(name)
    plan, ordering = case.plan, case.plan.ordering
    assert sorted(ordering.early + ordering.hubs) == list(range(1, case.n + 1))
    joints = sorted(j for node in ordering.nodes for j in node.joints)
    assert joints == list(range(len(case.start) - 1))
    assert sorted(ordering.order) == list(range(len(ordering.nodes) + len(ordering.hubs)))
    assert len(set(case.places.tolist())) == len(case.places)
    assert plan.row_size == len(case.places) + 6 * len(ordering.hubs)


@all_graphs
def test_product_with_the_jacobian(name):
    """add_product adds D a, in the order of the plan; exact but for the order of the sum."""
    case = full_case(name)
    rng = np.random.default_rng(2)
    a, before = rng.normal(size=6 * case.n), rng.normal(size=case.plan.row_size)
    out = before.copy()
    add_product(case.plan.blocks, case.D, np.concatenate([np.zeros(6), a]), out)
    wanted = before[case.places] + case.dense @ a
    assert out[case.places] == pytest.approx(wanted, abs=1e-13 * (1 + np.abs(case.dense).sum()))


def test_scaled_blocks_are_those_of_the_scaled_jacobian():
    """D^ = [D_r / sqrt(m), D_w B] for each body; products of three terms, so rounding alone."""
    case = full_case("wheel")
    rng = np.random.default_rng(3)
    case.metric[:] = rng.normal(size=case.metric.shape)
    scaling = np.zeros((6 * case.n, 6 * case.n))
    for b in range(1, case.n + 1):
        at = 6 * b - 6
        scaling[at : at + 3, at : at + 3] = case.metric[b, 0] * np.eye(3)
        scaling[at + 3 : at + 6, at + 3 : at + 6] = case.metric[b, 7:].reshape(3, 3)
    scale_blocks(case.plan.blocks, case.D, case.metric)
    a, out = rng.normal(size=6 * case.n), np.zeros(case.plan.row_size)
    add_product(case.plan.blocks, case.D, np.concatenate([np.zeros(6), a]), out)
    assert out[case.places] == pytest.approx(case.dense @ (scaling @ a), abs=1e-12)


def weak_case():
    """A wheel whose joint 2 has a row 1e-6 of its length; the place of that row among all rows."""
    case = full_case("wheel")
    weak = case.start[2] + 1
    case.scale_row(weak, 1e-6)
    return case, weak


def test_small_pivots_are_counted_and_used():
    """A row of 1e-6 leaves a pivot near 1e-12: counted below 1e-9, and not below 1e-16; the
    solution is that of the full matrix either way (relative 1e-4: the square of 1e-6 is left of
    sixteen digits), and bit for bit the same."""
    case, _ = weak_case()
    none, counted = case.factors(np.full(case.plan.row_size, 1e-16))
    assert counted == 0
    K, counted = case.factors(np.full(case.plan.row_size, 1e-9))
    assert counted == 1
    assert np.array_equal(K, none, equal_nan=True)
    gamma = np.ones(len(case.dense))
    a, _ = case.solution(K, np.zeros(6 * case.n), gamma)
    assert case.dense @ a == pytest.approx(gamma, abs=1e-4)


def test_dropped_rows_are_left_out():
    """With drop the counted row's multiplier is zero, and all else is the solution without it."""
    case, weak = weak_case()
    rng = np.random.default_rng(5)
    g, gamma = rng.normal(size=6 * case.n), rng.normal(size=len(case.dense))
    K, counted = case.factors(np.full(case.plan.row_size, 1e-9), drop=True)
    assert counted == 1
    a, multipliers = case.solution(K, g, gamma)
    assert multipliers[weak] == 0.0
    D, rest = np.delete(case.dense, weak, axis=0), np.delete(gamma, weak)
    wanted = np.linalg.solve(D @ D.T, rest - D @ g)
    scale = 1e3 * EPS * np.linalg.cond(D) ** 2
    assert np.delete(multipliers, weak) == pytest.approx(wanted, rel=scale, abs=scale)
    assert a == pytest.approx(g + D.T @ wanted, rel=scale, abs=scale)


def test_a_row_of_zeros_gives_nan_and_not_a_wrong_number():
    """Without drop a pivot that is not positive is counted, and so is what hangs on it, all of
    it NaN."""
    case = full_case("chain")
    case.scale_row(case.start[4], 0.0)
    K, counted = case.factors()
    assert counted >= 1
    a, multipliers = case.solution(K, np.zeros(6 * case.n), np.ones(len(case.dense)))
    assert np.isnan(multipliers[case.start[4]])
    assert np.isnan(a).any()
