"""The elimination program: it solves the saddle-point equations of any graph of bodies and joints.

Random joints are made as joints are: their rows do not feel a common rigid motion of their bodies,
so each body gets a random orthogonal 6 x 6 frame X and a joint the blocks R X of its bodies, with R of all
bodies adding up to zero (ground takes any rest). The static order relies on that.
"""

import numpy as np
import pytest

from dap3d_core.kernels.cache import compiled_in, jit_is_on
from dap3d_core.linear.blocks import add_product, assemble, factor, scale_blocks, solve_saddle
from dap3d_core.linear.plan import make_plan
from dap3d_core.linear.rank import dense_rank, sparse_rank

EPS = np.finfo(float).eps


def _solve(blocks, hubs, nodes, columns, D, K, x, g):
    solve_saddle(blocks, hubs, nodes, columns, D, K, x, g)


def _product(blocks, D, g, out):
    add_product(blocks, D, g, out)


#: What compiled code alone may call, with a door to Python.
solve_from_python = compiled_in(None, "", _solve)
product_from_python = compiled_in(None, "", _product)


# ------------------------------------------------------------------ graphs


def chain(n, rows=3):
    """Ground - 1 - 2 - ... - n."""
    return n, [((k, k - 1), rows) for k in range(1, n + 1)]


def star(n, rows=3):
    """Body 1 on ground, and n arms on body 1."""
    return n + 1, [((1, 0), rows)] + [((k, 1), rows) for k in range(2, n + 2)]


def free_star(n, rows=5):
    """A floating body with n arms."""
    return n + 1, [((k, 1), rows) for k in range(2, n + 2)]


def tree(n, rng):
    """Each body hangs on an earlier one, on few of them mostly, so that hubs appear."""
    joints = [((1, 0), 5)]
    for k in range(2, n + 1):
        parent = int(rng.integers(0, k)) if rng.uniform() < 0.5 else int(rng.integers(0, min(k, 3)))
        joints.append(((k, parent), int(rng.integers(1, 7))))
    return n, joints


def ring(n, rows=3):
    """A closed loop of n bodies through ground."""
    return n, [*chain(n, rows)[1], ((n, 0), rows)]


def wheel(n, grounded):
    """A hub with n spokes whose rims are joined in a loop: 3 + n + n joints."""
    joints = [((k, 1), 3) for k in range(2, n + 2)]
    joints += [((k, k % (n + 1) + 1 if k <= n else 2), 1) for k in range(2, n + 2)]
    return n + 1, joints + ([((1, 0), 4)] if grounded else [])


def two_wheels(n):
    """Two hubs on ground that share all their spokes' far ends: every loop runs through both."""
    joints = [((1, 0), 5), ((2, 0), 5)]
    for k in range(3, n + 3):
        joints += [((k, 1), 3), ((k, 2), 2)]
    return n + 2, joints


def hub_under_hub(n):
    """A hub on a hub by way of one body, loops among the arms of each and between the two."""
    joints = [((1, 0), 5), ((2, 1), 5), ((3, 2), 3)]
    first = list(range(4, 4 + n))
    second = list(range(4 + n, 4 + 2 * n))
    joints += [((k, 1), 4) for k in first] + [((k, 3), 4) for k in second]
    joints += [((first[0], first[1]), 1), ((second[0], second[1]), 1), ((first[2], second[2]), 2)]
    return 3 + 2 * n, [*joints, ((second[3], 0), 1), ((3, 0), 1)]


def several_between_a_pair(rng):
    """Joints between the same bodies: within six rows one node, beyond another."""
    return 3, [((1, 0), 2), ((2, 1), 1), ((1, 2), 2), ((2, 1), 2), ((1, 0), 3), ((3, 2), 4),
               ((2, 3), 1), ((1, 0), 1)]  # fmt: skip


def three_body_joints(rng):
    """Joints between three bodies, in any order of slots, ground among them."""
    return 7, [((1, 0), 5), ((2, 1), 5), ((3, 1), 5), ((3, 2, 1), 1), ((4, 3, 2), 2), ((4, 0), 3),
               ((5, 6, 4), 3), ((6, 5), 4), ((7, 0, 5), 2)]  # fmt: skip


def gears_to_ground(rng):
    """Two hubs, one on the other, and a joint of the inner one's arms that also takes ground.

    Its loop runs through ground and thus through the outer hub, which is dear and waits long.
    """
    joints = [((1, 0), 2), ((2, 1), 6), ((3, 2), 6), ((4, 2), 6), ((3, 0, 4), 2)]
    joints += [((k, 1), 2) for k in range(5, 15)] + [((k, 2), 2) for k in range(15, 18)]
    return 17, [*joints, ((5, 6), 3), ((7, 8), 3), ((9, 10), 3)]


def three_bodies_on_a_hub(rng):
    """Gears: joints between an arm, its neighbour and the carrier, which is a hub."""
    joints = [((1, 0), 5)] + [((k, 1), 5) for k in range(2, 9)]
    joints += [((k, k + 1, 1), 1) for k in range(2, 6)] + [((7, 0, 8), 1)]
    return 8, joints


def floating(rng):
    """Two components that hang on nothing, a body alone, and one on ground."""
    return 9, [((1, 2), 3), ((2, 3), 5), ((3, 1), 2), ((4, 5), 6), ((6, 0), 6), ((7, 6), 2),
               ((9, 7), 1)]  # fmt: skip


def random_graph(rng):
    """Any tree with closing joints put on it, as many as degrees of freedom allow."""
    n = int(rng.integers(4, 14))
    n, joints = tree(n, rng)
    joints = [(slots, min(m, 4)) for slots, m in joints]
    for _ in range(int(rng.integers(1, n))):
        count = 3 if rng.uniform() < 0.2 else 2
        slots = tuple(int(b) for b in rng.permutation(n + 1)[:count])
        joints.append((slots, int(rng.integers(1, 3))))
    return n, joints


GRAPHS = {
    "no joints": lambda rng: (3, []),
    "chain": lambda rng: chain(9),
    "welded chain": lambda rng: chain(5, 6),
    "star": lambda rng: star(12),
    "free star": lambda rng: free_star(9),
    "tree": lambda rng: tree(25, rng),
    "ring": lambda rng: ring(7),
    "wheel": lambda rng: wheel(8, True),
    "free wheel": lambda rng: wheel(6, False),
    "two wheels": lambda rng: two_wheels(7),
    "hub under hub": lambda rng: hub_under_hub(6),
    "several between a pair": several_between_a_pair,
    "three bodies": three_body_joints,
    "three bodies on a hub": three_bodies_on_a_hub,
    "gears to ground": gears_to_ground,
    "floating": floating,
}
RANDOM = {f"random {k}": random_graph for k in range(20 if jit_is_on() else 5)}
all_graphs = pytest.mark.parametrize("name", [*GRAPHS, *RANDOM])


class Case:
    """A graph with random blocks: the program's arrays, and the dense matrix they stand for.

    Attributes:
        plan, D: the program and its blocks, unscaled.
        dense: (rows, 6 n) the same Jacobian, rows in the order of the joints.
        metric: (n+1, 16) masses and inertias of one; bodies not turned.
        places: (rows,) place of each row in the row vectors.
        start: (joints + 1,) first row of each joint.
    """

    def __init__(self, graph, rng):
        self.n, joints = graph
        slots, rows = [s for s, _ in joints], [m for _, m in joints]
        self.plan = make_plan(self.n, slots, rows)
        frames = np.linalg.qr(rng.normal(size=(self.n + 1, 6, 6)))[0]
        self.D = np.zeros(self.plan.block_size)
        self.dense = np.zeros((sum(rows), 6 * self.n))
        self.places = np.zeros(sum(rows), dtype=np.int64)
        self.start = np.concatenate([[0], np.cumsum(rows)]).astype(int).tolist()
        self.joints = joints
        for joint, (bodies, m) in enumerate(joints):
            first = self.start[joint]
            R = rng.normal(size=(len(bodies), m, 6))
            R[-1] = -R[:-1].sum(axis=0)
            for slot, b in enumerate(bodies):
                block = R[slot] @ frames[b]
                place = self.plan.joint_block[joint][slot]
                self.D[place : place + 6 * m] = block.ravel()
                if b:
                    self.dense[first : first + m, 6 * b - 6 : 6 * b] = block
            self.places[first : first + m] = self.plan.joint_row[joint] + np.arange(m)
        self.metric = np.zeros((self.n + 1, 16))
        self.metric[1:, [0, 1, 4, 6, 7, 11, 15]] = 1.0

    def scale_row(self, row, factor):
        """Multiply one row, given by its place among all, in both forms."""
        joint = int(np.searchsorted(self.start, row, side="right")) - 1
        self.dense[row] *= factor
        for b, place in zip(self.joints[joint][0], self.plan.joint_block[joint], strict=True):
            if b:
                at = place + 6 * (row - self.start[joint])
                self.D[at : at + 6] *= factor

    @property
    def is_full(self):
        """Whether the rows are independent, with room to spare for rounding."""
        if not self.dense.size:
            return True
        values = np.linalg.svd(self.dense, compute_uv=False)
        return len(self.dense) <= self.dense.shape[1] and values[-1] > 1e-3 * values[0]

    def factors(self, smallest=None, drop=False):
        """K with the factors, and how many pivots were counted."""
        plan, K = self.plan, np.full(self.plan.matrix_size, np.nan)
        smallest = np.zeros(plan.row_size) if smallest is None else smallest
        assemble(plan.targets, plan.contributions, self.D, K)
        return K, factor(plan.nodes, plan.columns, plan.updates, K, smallest, drop)

    def solution(self, K, g, gamma):
        """v_dot (6 n,) and lambda (rows,) by the program."""
        plan = self.plan
        x, force = np.zeros(plan.row_size), np.concatenate([np.zeros(6), g])
        x[self.places] = gamma
        solve_from_python(plan.blocks, plan.hubs, plan.nodes, plan.columns, self.D, K, x, force)
        return force[6:], -x[self.places]


def full_case(name, seed=0):
    """A case of this name with independent rows."""
    for attempt in range(100):
        rng = np.random.default_rng([seed, attempt, len(name), *name.encode()])
        case = Case((GRAPHS | RANDOM)[name](rng), rng)
        if case.is_full:
            return case
    raise AssertionError(f"{name}: no case with independent rows")


# ------------------------------------------------------------------ what the program solves


@all_graphs
def test_solution_is_that_of_the_dense_saddle_point_matrix(name):
    """The program solves [I D^T; D 0] (a; -lambda) = (g; gamma) as LU with pivoting does.

    It works on D D^T, whose condition is that of D squared: the relative error is some rounding
    times that. 1e3 is for growth along the elimination; 3 was the worst of 3000 random graphs.
    """
    case = full_case(name)
    rng = np.random.default_rng(1)
    m, columns = case.dense.shape
    g, gamma = rng.normal(size=columns), rng.normal(size=m)
    K, counted = case.factors()
    assert counted == 0
    a, multipliers = case.solution(K, g, gamma)
    matrix = np.block([[np.eye(columns), case.dense.T], [case.dense, np.zeros((m, m))]])
    wanted = np.linalg.solve(matrix, np.concatenate([g, gamma]))
    condition = np.linalg.cond(case.dense) if m else 1.0
    error = np.max(np.abs(np.concatenate([a, -multipliers]) - wanted))
    assert error <= 1e3 * EPS * condition**2 * np.max(np.abs(wanted))


@all_graphs
def test_rows_eliminated_so_far_are_independent_on_the_bodies_eliminated_so_far(name):
    """What the static order promises at each of its places, and what makes every pivot exist.

    Singular values of the prefix and of the same rows on all bodies: where these are independent
    (above 1e-3), those do not vanish (1e-9 is far above rounding).
    """
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
    product_from_python(case.plan.blocks, case.D, np.concatenate([np.zeros(6), a]), out)
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
    product_from_python(case.plan.blocks, case.D, np.concatenate([np.zeros(6), a]), out)
    assert out[case.places] == pytest.approx(case.dense @ (scaling @ a), abs=1e-12)


# ------------------------------------------------------------------ what it costs


@pytest.mark.parametrize("name", ["chain", "welded chain", "star", "free star", "tree"])
def test_trees_have_no_fill(name):
    """No block of the factors of a tree was zero before: an exact count."""
    for seed in range(5):
        assert full_case(name, seed).plan.fill == 0


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

    Pivots are squares of lengths and 1e-10 of a row's is zero: for graphs as these, whose joints
    are of one size, rounding is far below and a true pivot far above.
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


# ------------------------------------------------------------------ small pivots


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
    """Without drop a pivot that is not positive is counted, and what hangs on it is NaN."""
    case = full_case("chain")
    case.scale_row(case.start[4], 0.0)
    K, counted = case.factors()
    assert counted == 1
    a, multipliers = case.solution(K, np.zeros(6 * case.n), np.ones(len(case.dense)))
    assert np.isnan(multipliers[case.start[4]])
    assert np.isnan(a).any()
