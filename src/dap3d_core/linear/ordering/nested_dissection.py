"""Nested dissection: which nodes of a graph wait, and how long, so that little fill appears.

A set of nodes (a separator) cuts the graph in two halves; eliminated after both, it lets no fill
stand between them. The halves are cut again, and so on (George, SIAM J. Numer. Anal. 10, 1973). On
a k x k net the factors then hold of the order of k^2 log k blocks and cost k^3.

No geometry is known here: distances along the graph from nodes far apart take the place of
coordinates. A half ends at the weighted median of one of them, or of a difference of two; the
separator is the least vertex cover of the edges that are cut (Koenig: by a maximum matching), so it
has no node too many. Of several cuts the lightest is taken.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Integers

#: Parts of so many nodes are not cut: minimum degree orders them as well.
LEAF = 120
#: Where a cut may stand, as parts of the weight on its left.
CUTS = (0.42, 0.46, 0.5, 0.54, 0.58)
#: Cuts of which the separator is looked for: those with the least weight along them.
TRIED = 4


def dissect(neighbours: Sequence[set[int]], weight: Sequence[int]) -> list[int]:
    """The stage of each node: 0 goes first, the first separator last.

    Args:
        neighbours: of each node, both ways.
        weight: of each node.
    """
    from scipy.sparse import csr_array

    count = len(neighbours)
    starts = np.concatenate([[0], np.cumsum([len(others) for others in neighbours])])
    entries = np.fromiter((m for others in neighbours for m in others), np.int64, int(starts[-1]))
    graph = csr_array((np.ones(len(entries), dtype=np.int8), entries, starts), shape=(count, count))
    depth = np.full(count, -1)
    weights = np.asarray(weight, dtype=np.int64)
    waiting = [(np.arange(count), 0)]
    while waiting:
        nodes, level = waiting.pop()
        part = graph[nodes][:, nodes]
        for piece in _pieces(part):
            if len(piece) <= LEAF:
                continue
            mine = part if len(piece) == len(nodes) else part[piece][:, piece]
            chosen = nodes[piece]
            left, right, separator = _cut(mine, weights[chosen])
            depth[chosen[separator]] = level
            waiting += [(chosen[half], level + 1) for half in (left, right) if len(half)]
    deepest = int(np.max(depth, initial=-1))
    stages: list[int] = np.where(depth < 0, 0, deepest + 1 - depth).tolist()
    return stages


def _pieces(graph: Any) -> list[Integers]:
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(graph, directed=False)
    if count == 1:
        return [np.arange(graph.shape[0])]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.cumsum(np.bincount(label))[:-1])


def _cut(graph: Any, weight: Integers) -> tuple[Integers, Integers, Integers]:
    """Two halves of a connected graph and the separator between them."""
    total = int(np.sum(weight))
    rows = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))
    sides: list[tuple[int, int, NDArray[np.bool_]]] = []
    for coordinate in _coordinates(graph):
        order = np.argsort(coordinate, kind="stable")
        before = np.cumsum(weight[order])
        for part in CUTS:
            count = min(int(np.searchsorted(before, part * total)) + 1, len(weight) - 1)
            side = np.ones(len(weight), dtype=bool)
            side[order[:count]] = False
            cut = side[rows] != side[graph.indices]
            edge = np.zeros(len(weight), dtype=bool)
            edge[rows[cut]] = True
            sides.append((int(np.sum(weight[edge])), len(sides), side))
    sides.sort(key=lambda entry: entry[:2])
    found = [_separated(graph, rows, side) for *_, side in sides[:TRIED]]
    where = min(found, key=lambda where: _cost(where, weight))
    left, right, separator = (np.flatnonzero(where == k) for k in range(3))
    return left, right, separator


def _cost(where: Integers, weight: Integers) -> float:
    """Weight of the separator, by how uneven the halves are."""
    left, right, separator = np.bincount(where, weight, 3)
    uneven = max(left, right) / max(1.0, left + right)
    return float(separator * (1.0 + 2.0 * max(0.0, uneven - 0.55)))


def _coordinates(graph: Any) -> list[Integers]:
    """Distances from nodes far apart, and differences of them."""
    a = int(np.argmax(_distances(graph, 0)))
    from_a = _distances(graph, a)
    b = int(np.argmax(from_a))
    from_b = _distances(graph, b)
    c = int(np.argmax(np.minimum(from_a, from_b)))
    from_c = _distances(graph, c)
    d = int(np.argmax(np.minimum(np.minimum(from_a, from_b), from_c)))
    from_d = _distances(graph, d)
    return [from_a, from_c, from_a - from_b, from_a - from_c, from_b - from_c, from_c - from_d,
            from_a + from_c - from_b - from_d, from_a + from_d - from_b - from_c]  # fmt: skip


def _distances(graph: Any, start: int) -> Integers:
    """Edges from a node to each node."""
    from scipy.sparse.csgraph import dijkstra

    return np.asarray(dijkstra(graph, indices=start, unweighted=True), dtype=np.int64)


def _separated(graph: Any, rows: Integers, side: NDArray[np.bool_]) -> Integers:
    """0 and 1 for the nodes of the halves, 2 for the least vertex cover of what is cut."""
    where: Integers = side.astype(np.int64)
    cut = ~side[rows] & side[graph.indices]
    where[_cover(rows[cut], graph.indices[cut])] = 2
    return where


def _cover(tails: Integers, heads: Integers) -> Integers:
    """The least set of nodes that holds an end of each edge between tails and heads.

    Koenig: with a maximum matching, the tails that no alternating path from an unmatched tail
    reaches, and the heads that one reaches.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order, maximum_bipartite_matching

    left, tail = np.unique(tails, return_inverse=True)
    right, head = np.unique(heads, return_inverse=True)
    a, b = len(left), len(right)
    edges = csr_array((np.ones(len(tail), dtype=np.int8), (tail, head)), shape=(a, b))
    match = maximum_bipartite_matching(edges, perm_type="column")  # of each tail, or -1
    free, held, source = np.flatnonzero(match < 0), np.flatnonzero(match >= 0), a + b
    begin = np.concatenate([tail, a + match[held], np.full(len(free), source)])
    end = np.concatenate([a + head, held, free])
    shape = source + 1, source + 1
    walk = csr_array((np.ones(len(begin), dtype=np.int8), (begin, end)), shape=shape)
    reached = np.zeros(source + 1, dtype=bool)
    reached[breadth_first_order(walk, source, return_predecessors=False)] = True
    return np.concatenate([left[~reached[:a]], right[reached[a:source]]])
