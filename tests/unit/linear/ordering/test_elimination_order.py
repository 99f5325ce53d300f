"""Nets of loops: nested dissection keeps their fill low, panels factor them."""

from math import log2

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from support.graphs import Case, chain, check_solution, star
from support.internals import make_plan, rank
from support.nets import fourbars, ladder, plate_net, rod_net
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.linear.ordering import elimination_order, ordering

EPS = np.finfo(float).eps


def arguments(graph):
    n, joints = graph
    return n, [slots for slots, _ in joints], [rows for _, rows in joints]


@pytest.mark.slow
@pytest.mark.parametrize("net", [rod_net, plate_net])
def test_fill_of_a_net_grows_as_nested_dissection_promises(net):
    """Of k x k knots the fill is O(k^2 log k), the work O(k^3) (George 1973): from k to 2 k fill
    grows by 4 (1 + 1 / log k), work by 8, and lower terms, here a fifth, in which leaves that
    minimum degree orders play a part."""
    small, large = (elimination_order.order_nodes(*arguments(net(k))) for k in (14, 28))
    fill = [sum(map(len, found.below)) for found in (small, large)]
    assert fill[1] <= 1.2 * 4 * (1 + 1 / log2(14)) * fill[0]
    assert large.work <= 1.2 * 8 * small.work


def test_the_cheaper_order_is_taken(monkeypatch):
    """On a net of plates nested dissection takes less work than minimum degree alone; where it
    takes more, minimum degree stays."""
    n, slots, rows = arguments(plate_net(18))
    dissected = elimination_order.order_nodes(n, slots, rows).work
    monkeypatch.setattr(elimination_order, "WIDE", 10**9)
    greedy = elimination_order.order_nodes(n, slots, rows).work
    assert dissected < 0.8 * greedy
    monkeypatch.setattr(elimination_order, "WIDE", 0)
    monkeypatch.setattr(elimination_order, "dissect", lambda neighbours, weight: range(len(weight)))
    assert elimination_order.order_nodes(n, slots, rows).work == greedy


def test_separators_separate():
    """No edge joins nodes of stage 0 that belong to different leaves, and leaves are small."""
    n, slots, rows = arguments(plate_net(20))
    found = elimination_order.order_nodes(n, slots, rows)
    of_body = [set() for _ in range(n + 1)]
    for k, node in enumerate(found.nodes):
        for b in node.bodies:
            of_body[b].add(k)
    neighbours = [set().union(*(of_body[b] for b in node.bodies)) - {k}
                  for k, node in enumerate(found.nodes)]  # fmt: skip
    stage = elimination_order.dissect(neighbours, [node.rows for node in found.nodes])
    edges = [(k, m) for k, others in enumerate(neighbours) for m in others
             if stage[k] == stage[m] == 0]  # fmt: skip
    graph = coo_array((np.ones(len(edges)), np.transpose(edges)), shape=(len(stage),) * 2)
    assert np.bincount(connected_components(graph)[1]).max() <= elimination_order.LEAF
    assert max(stage) >= 3
    top = [k for k, s in enumerate(stage) if s == max(stage)]
    assert len(top) <= 25  # 20 joints lie between two lines of bodies: the least there can be


@pytest.mark.parametrize("family", [fourbars, ladder])
def test_cost_of_a_row_of_loops_is_linear(family):
    """From 200 to 300 and on to 400 loops the program grows by the same numbers, to a few blocks of
    its ends; a row of four-bars has no fill, a ladder at most one block for a joint."""
    sizes = []
    for count in (200, 300, 400):
        made = make_plan(*arguments(family(count)))
        sizes.append([made.matrix_size, len(made.updates), made.ordering.work, made.fill])
        assert made.fill <= (0 if family is fourbars else len(made.ordering.nodes))
        assert made.ordering.panels == ()
    small, medium, large = np.array(sizes)
    assert np.all(np.abs((large - medium) - (medium - small)) <= 0.02 * (medium - small))


@pytest.mark.parametrize("graph", [chain(800), star(400)])
def test_trees_are_not_dissected(graph, monkeypatch):
    """Their fronts are narrow: no other order is tried, no panel made."""
    monkeypatch.delattr(elimination_order, "dissect")
    assert elimination_order.order_nodes(*arguments(graph)).panels == ()


@pytest.fixture(params=[0.3, 0.9] if jit_is_on() else [0.3])
def panels_everywhere(request, monkeypatch):
    """Dissection down to four nodes and panels, whatever the size, many zeros in them."""
    monkeypatch.setattr(elimination_order, "WIDE", 0)
    monkeypatch.setattr(elimination_order, "LEAF", 4)
    monkeypatch.setattr(ordering, "ZEROS", request.param)


NETS = {
    "rods": lambda: rod_net(6),
    "plates": lambda: plate_net(8),
    "long plates": lambda: plate_net(11, 2),
}


@pytest.mark.every(4)
@pytest.mark.parametrize("name", NETS)
def test_nets_are_solved(name, panels_everywhere):
    """With panels of all kinds: some gather from small nodes, some update small ones."""
    case = Case(NETS[name](), np.random.default_rng(1))
    assert len(case.plan.ordering.panels) >= 3
    check_solution(case)


@settings(max_examples=60 if jit_is_on() else 10, deadline=None)
@given(
    st.integers(3, 12),
    st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12), st.integers(1, 3)), max_size=30),
    st.integers(0, 2**32 - 1),
)
def test_random_graphs_are_solved(n, pairs, seed):
    """Whatever is joined to what: with the usual order, and with panels, the same solution."""
    joints = [((a % (n + 1), b % (n + 1)), m) for a, b, m in pairs if a % (n + 1) != b % (n + 1)]
    case = Case((n, joints), np.random.default_rng(seed))
    if not case.is_full:
        return
    check_solution(case)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(elimination_order, "WIDE", 0)
        patch.setattr(elimination_order, "LEAF", 2)
        patch.setattr(ordering, "ZEROS", 0.9)
        check_solution(Case((n, joints), np.random.default_rng(seed)))


def test_each_row_of_the_matrix_is_in_one_node():
    """Nodes and their rows follow one another; panels have as many rows as they may."""
    made = make_plan(*arguments(rod_net(14)))
    rows, first = made.nodes[:-1, 0], made.nodes[:-1, 1]
    assert np.array_equal(np.cumsum(rows)[:-1], first[1:])
    assert made.nodes[-1, 1] == made.row_size == rows.sum()
    panels = rows[rows > 6]
    assert len(panels) == len(made.ordering.panels) > 10
    assert panels.min() >= ordering.LEAST_ROWS
    assert panels.max() <= ordering.MOST_ROWS + 6


def test_the_fill_that_is_reported_is_that_of_the_matrix():
    """Blocks of the Cholesky factor of a random matrix of this pattern, less those of the matrix.
    Fill of a pattern is that of numbers without cancellation; hubs are not among these."""
    case = Case(plate_net(7), np.random.default_rng(2))
    made = case.plan
    nodes = made.ordering.nodes
    joint = np.array([[not set(a.bodies).isdisjoint(b.bodies) for a in nodes] for b in nodes])
    joint = joint[np.ix_(made.ordering.order, made.ordering.order)]
    filled = joint.copy()
    for k in range(len(filled)):
        below = k + 1 + np.flatnonzero(filled[k + 1 :, k])
        filled[np.ix_(below, below)] = True
    assert made.fill == (np.sum(filled) - np.sum(joint)) // 2
    assert made.unfilled_size == 9 * (np.sum(joint) + len(joint)) // 2


def test_rows_that_depend_on_others_are_found_in_panels(panels_everywhere, monkeypatch):
    """Pivots of panels vanish as those of small nodes do: the rank is that of singular values."""
    monkeypatch.setattr(rank, "PART_ROWS", 0)
    case = Case(plate_net(6, 4), np.random.default_rng(3))
    assert len(case.dense) > case.dense.shape[1]
    found = rank.sparse_rank(case.plan, case.D, case.places, 6 * case.n)
    assert found.rank == np.linalg.matrix_rank(case.dense)


def test_small_pivots_of_panels_are_counted_or_dropped(panels_everywhere):
    """A row of 1e-6 leaves a pivot near 1e-12, below 1e-9: used, or left out."""
    case = Case(plate_net(8), np.random.default_rng(4))
    first, last = case.plan.nodes[:-1][case.plan.nodes[:-1, 0] > 6][0, :2][::-1]
    weak = int(np.flatnonzero(case.places == first + last // 2)[0])
    case.scale_row(weak, 1e-6)
    smallest = np.full(case.plan.row_size, 1e-9)
    plain, counted = case.factors()
    assert counted == 0
    K, counted = case.factors(smallest)
    assert counted == 1
    assert np.array_equal(K, plain, equal_nan=True)
    K, counted = case.factors(smallest, drop=True)
    assert counted == 1
    gamma = np.random.default_rng(5).normal(size=len(case.dense))
    _, multipliers = case.solution(K, np.zeros(6 * case.n), gamma)
    assert multipliers[weak] == 0.0
    D = np.delete(case.dense, weak, axis=0)
    wanted = np.linalg.solve(D @ D.T, np.delete(gamma, weak))
    scale = 1e3 * EPS * np.linalg.cond(D) ** 2 * np.max(np.abs(wanted))
    assert np.delete(multipliers, weak) == pytest.approx(wanted, abs=scale)


def test_the_program_is_found_once_for_all_runs_and_steps(monkeypatch):
    """Symbolic work is done when a scene is compiled; runs and their steps repeat none of it."""
    calls = []

    def counted(*given, **options):
        calls.append(given)
        return elimination_order.order_nodes(*given, **options)

    monkeypatch.setattr("dap3d_core.linear.ldlt.plan.order_nodes", counted)
    scene = dap.Scene(name="two rods")
    outer = "ground.O"
    for k in range(2):
        scene.add_body(f"b{k}", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(k + 0.5, 0.0, 0.0))
        inner = scene.add_point(f"in{k}", f"b{k}", (-0.5, 0.0, 0.0))
        scene.add_joint("sph", f"J{k}", P_i=inner, P_j=outer)
        outer = scene.add_point(f"out{k}", f"b{k}", (0.5, 0.0, 0.0))
    compiled = dap.compile(scene)
    program = compiled.evaluator.plan.updates
    steps = [dap.simulate(compiled, t_end=0.1, dt=0.1).stats.steps for _ in range(2)]
    assert min(steps) > 0
    assert len(calls) == 1
    assert compiled.evaluator.system.updates is program
