"""How many rows are independent, by singular values, elimination and inverse iteration."""

import numpy as np
import pytest
from support.graphs import (
    Case,
    full_case,
    hub_under_hub,
    ring,
    three_bodies_on_a_hub,
    tree,
    two_wheels,
    wheel,
)
from support.internals import rank
from support.plain import long_in_plain_python

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


WAYS = ("parts", "elimination", "iteration")


@pytest.fixture
def sparse(request, monkeypatch):
    """The sparse rank, made to go one of its three ways, whatever the number of rows."""
    if request.param != "parts":
        monkeypatch.setattr(rank, "PART_ROWS", 0)
    if request.param == "iteration":
        monkeypatch.setattr(rank, "by_elimination", lambda problem, K: None)
    return rank.sparse_rank


def projector(found):
    """(rows, rows) on the span of the combinations that vanish: the same for every basis of it."""
    P = np.zeros((found.rows, found.rows))
    for dependency in found.dependencies:
        N, rows = dependency.combinations, dependency.rows
        assert pytest.approx(np.eye(len(N)), abs=1e-12) == N @ N.T
        P[np.ix_(rows, rows)] = N.T @ N
    return P


@pytest.mark.every(5)
@long_in_plain_python
@pytest.mark.parametrize("sparse", WAYS, indirect=True)
@pytest.mark.parametrize("name", REDUNDANT)
def test_both_ranks_agree(name, sparse):
    """By the blocks the same rank is found as by singular values, the same combinations and the
    same sets of rows that depend on each other.
    Combinations are as good as rounding over the smallest singular value that is not zero, squared
    at worst before refinement: 1e-16 / 1e-4^2."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        case = Case(REDUNDANT[name](rng), rng)
        dense = rank.dense_rank(case.dense)
        found = sparse(case.plan, case.D, case.places, 6 * case.n)
        assert (dense.rank, dense.redundant, dense.dof) == (found.rank, found.redundant, found.dof)
        assert projector(found) == pytest.approx(projector(dense), abs=1e-8)
        sets = [[d.rows.tolist() for d in r.dependencies] for r in (dense, found)]
        assert sets[0] == sets[1]


def test_the_ways_are_the_ones_that_were_meant(monkeypatch):
    """A ring has a part: singular values, elimination, inverse iteration; a chain has none."""
    case = full_case("chain")
    assert rank.sparse_rank(case.plan, case.D, case.places, 6 * case.n).method == "leaves"
    rng = np.random.default_rng(0)
    case = Case(ring(9, 5), rng)
    methods = []
    for limit, proof in ((300, True), (0, True), (0, False)):
        monkeypatch.setattr(rank, "PART_ROWS", limit)
        if not proof:
            monkeypatch.setattr(rank, "by_elimination", lambda problem, K: None)
        methods.append(rank.sparse_rank(case.plan, case.D, case.places, 6 * case.n).method)
    assert methods == ["svd of parts", "elimination", "inverse iteration"]


@pytest.mark.parametrize("sparse", WAYS, indirect=True)
def test_sparse_rank_leaves_the_blocks_as_they_were(sparse):
    """D is the caller's, bit for bit."""
    case = full_case("wheel")
    before = case.D.copy()
    sparse(case.plan, case.D, case.places, 6 * case.n)
    assert np.array_equal(case.D, before)


@pytest.mark.parametrize("sparse", WAYS, indirect=True)
@pytest.mark.parametrize("factor", [1e3])
def test_rank_does_not_depend_on_the_size_of_a_row(sparse, factor):
    """A row a thousand times shorter or longer than the others is no less and no more a row."""
    rng = np.random.default_rng(5)
    case = Case(ring(6, 5), rng)
    before = sparse(case.plan, case.D, case.places, 6 * case.n)
    case.scale_row(7, factor)
    after = sparse(case.plan, case.D, case.places, 6 * case.n)
    assert before.rank == after.rank == np.linalg.matrix_rank(case.dense)
    assert np.array_equal(before.shared, after.shared)


@pytest.mark.parametrize("sparse", WAYS, indirect=True)
@pytest.mark.parametrize("name", ["no joints", "ring", "wheel", "two wheels", "floating"])
def test_independent_rows_are_found_independent(sparse, name):
    """Loops with freedoms enough: nothing depends on anything, by any way."""
    case = full_case(name)
    found = sparse(case.plan, case.D, case.places, 6 * case.n)
    assert (found.rank, found.dependencies) == (len(case.dense), ())
    assert found.shared.shape == (0,)


def test_a_pivot_that_rounding_hides_is_no_proof():
    """A row 1e-6 from another falls below the tolerance of pivots, the square, and depends on none:
    its combination does not vanish, elimination gives up, and inverse iteration counts the row."""
    rng = np.random.default_rng(3)
    case = Case(ring(7, 3), rng)
    row = case.start[1] + 1  # close to the row before it, by 1e-6 of its length
    joint, place = 1, case.plan.joint_block[1]
    for b, at in zip(case.joints[joint][0], place, strict=True):
        if b:
            case.D[at + 6 : at + 12] = case.D[at : at + 6] + 1e-6 * case.D[at + 6 : at + 12]
            case.dense[row, 6 * b - 6 : 6 * b] = case.D[at + 6 : at + 12]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rank, "PART_ROWS", 0)
        found = rank.sparse_rank(case.plan, case.D, case.places, 6 * case.n)
    assert found.method == "inverse iteration"
    assert found.rank == np.linalg.matrix_rank(case.dense, tol=1e-10) == 24


def test_dense_rank_names_the_rows_of_a_dependency():
    """Row 3 = row 0 + 2 row 1 of 5: these take part, rows 2 and 4 do not; the combination vanishes
    to rounding, and no row at all is rank 0."""
    rng = np.random.default_rng(4)
    D = rng.normal(size=(5, 12))
    D[3] = D[0] + 2.0 * D[1]
    found = rank.dense_rank(D)
    assert (found.rows, found.columns, found.rank, found.redundant, found.dof) == (5, 12, 4, 1, 8)
    assert found.shared.tolist() == [0, 1, 3]
    (dependency,) = found.dependencies
    assert dependency.combinations @ D[[0, 1, 3]] == pytest.approx(np.zeros((1, 12)), abs=1e-14)
    weights = dependency.combinations[0] / dependency.combinations[0, 2]
    assert weights == pytest.approx([-1.0, -2.0, 1.0], abs=1e-13)
    assert rank.dense_rank(np.zeros((0, 6))).rank == 0
    assert rank.dense_rank(np.zeros((2, 6))).rank == 0


def test_rows_that_depend_on_different_ones_are_told_apart():
    """Rows 0, 3 and 5 vanish in one combination, rows 1 and 4 in another, whatever the mixture of
    the two that the singular vectors are."""
    rng = np.random.default_rng(6)
    D = rng.normal(size=(6, 12))
    D[5] = D[0] - 3.0 * D[3]
    D[4] = 0.5 * D[1]
    found = rank.dense_rank(D)
    assert [d.rows.tolist() for d in found.dependencies] == [[0, 3, 5], [1, 4]]
    assert [d.combinations.shape for d in found.dependencies] == [(1, 3), (1, 2)]
    for dependency in found.dependencies:
        assert dependency.combinations @ D[dependency.rows] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("blur", [0.0, 1e-7])
def test_a_row_within_the_blur_is_dependent(blur):
    """Two rows 1e-9 apart: independent to rounding, dependent where 1e-7 is no difference."""
    rng = np.random.default_rng(7)
    D = rng.normal(size=(3, 6))
    D[2] = D[1] + 1e-9 * rng.normal(size=6)
    assert rank.dense_rank(D, blur).redundant == int(blur > 0.0)
