"""In which order bodies and joints are eliminated from the saddle-point matrix [M D^T; D 0].

Nodes are bodies and joints; joints between the same bodies are one node. Bodies with few joints
come first: each costs little and leaves a block between its joints (on a chain, D M^-1 D^T). A body
with many joints (a hub) would make all of them one dense block, so it waits. A joint's pivot exists
only when the rows eliminated so far are independent on the bodies eliminated so far. It does when

* a joint of the spanning tree comes after its outboard body, and
* a joint that closes a loop comes after all bodies of its loop.

Under these rules the cheapest node comes next (minimum degree, weighted by rows). Trees have no
fill at all. Where that makes wide fronts, as in nets of loops, separators wait besides
(nested_dissection.py), if it takes less work. More: docs/decisions/0006 and 0012.
"""

import heapq
from collections import deque
from collections.abc import Iterable, Sequence
from itertools import count, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Integers
from dap3d_core.linear.ordering.ordering import JointNode, Ordering

#: A body with this many joint nodes or more waits: eliminating it late costs less from here on.
HUB_DEGREE = 5

#: Joints between the same bodies share a node as long as their rows fit in one body's six.
NODE_ROWS = 6

#: Where the elimination of a node updates more rows than this, another order is tried.
WIDE = 48
#: Parts of so many nodes are not cut: minimum degree orders them as well.
LEAF = 120
#: Where a cut may stand, as parts of the weight on its left.
CUTS = (0.42, 0.46, 0.5, 0.54, 0.58)
#: Cuts of which the separator is looked for: those with the least weight along them.
TRIED = 4


def order_nodes(
    body_count: int,
    joint_slots: Sequence[tuple[int, ...]],
    joint_rows: Sequence[int],
    alone: int = 0,
) -> Ordering:
    """Find the order of elimination.

    Args:
        body_count: bodies without ground; they are numbered from 1.
        joint_slots: bodies of each joint, ground 0.
        joint_rows: rows of each joint.
        alone: so many joints, the last ones, share a node with no other.
    """
    nodes = _merge(joint_slots, joint_rows, alone)
    of_body: list[list[int]] = [[] for _ in range(body_count + 1)]
    for k, node in enumerate(nodes):
        for b in node.bodies:
            of_body[b].append(k)
    hubs = tuple(b for b in range(1, body_count + 1) if len(of_body[b]) >= HUB_DEGREE)
    early = tuple(b for b in range(1, body_count + 1) if len(of_body[b]) < HUB_DEGREE)
    size = [node.rows for node in nodes] + [6] * len(hubs)

    def eliminated(stage: Sequence[int] | None) -> Ordering:
        neighbours = _neighbours(nodes, of_body, early, hubs)
        waits = _waits(nodes, of_body, hubs) if hubs else {}
        order, below = _eliminate(neighbours, size, waits, stage, in_turn=True)
        place = {node: k for k, node in enumerate(order)}
        lists = tuple(tuple(sorted(place[m] for m in below[node])) for node in order)
        return Ordering(tuple(nodes), early, hubs, tuple(order), lists)

    found = eliminated(None)
    if found.widest > WIDE:
        from dap3d_core.linear.ordering.ordering import with_panels

        other = eliminated(dissect(_neighbours(nodes, of_body, early, hubs), size))
        found = with_panels(min(found, other, key=lambda ordering: ordering.work))
    return found


def _merge(
    joint_slots: Sequence[tuple[int, ...]], joint_rows: Sequence[int], alone: int
) -> list[JointNode]:
    found: dict[tuple[tuple[int, ...], bool], int] = {}
    keys: list[tuple[tuple[int, ...], bool]] = []
    joints: list[list[int]] = []
    rows: list[int] = []
    for joint, (slots, m) in enumerate(zip(joint_slots, joint_rows, strict=True)):
        others = tuple(sorted({b for b in slots if b}))
        key = others, 0 in slots or len(others) == 1
        node = found.get(key)
        is_alone = joint >= len(joint_slots) - alone
        if node is None or is_alone or rows[node] + m > NODE_ROWS:
            found[key] = len(keys)
            keys.append(key)
            joints.append([joint])
            rows.append(int(m))
        else:
            joints[node].append(joint)
            rows[node] += int(m)
    return [JointNode(*key, tuple(j), m) for key, j, m in zip(keys, joints, rows, strict=True)]


def _neighbours(
    nodes: Sequence[JointNode],
    of_body: Sequence[list[int]],
    early: Iterable[int],
    hubs: Sequence[int],
) -> list[set[int]]:
    """Pairs of joint nodes and hubs that share a block once the early bodies are eliminated."""
    result: list[set[int]] = [set() for _ in range(len(nodes) + len(hubs))]
    for b in early:
        for k in of_body[b]:
            result[k].update(of_body[b])
    for h, b in enumerate(hubs, start=len(nodes)):
        for k in of_body[b]:
            result[k].add(h)
            result[h].add(k)
    for k, others in enumerate(result):
        others.discard(k)
    return result


def _eliminate(
    neighbours: list[set[int]],
    size: Sequence[int],
    waits: dict[int, set[int]],
    stage: Sequence[int] | None = None,
    *,
    in_turn: bool = False,
) -> tuple[list[int], dict[int, set[int]]]:
    """Minimum degree, weighted by rows; no node is taken before the hubs that it waits for.

    With stages what can be taken of the lowest stage goes first. Among equals the lowest node is
    taken, or, ``in_turn``, the one that has waited longest: a chain is then eliminated from both
    ends at once, and no pivot waits for the one just before.
    """
    weight = [sum(size[m] for m in others) for others in neighbours]
    if stage is not None:  # a stage weighs more than all degrees
        total = 1 + sum(size)
        weight = [w + total * s for w, s in zip(weight, stage, strict=True)]
    turn = count() if in_turn else repeat(0)
    heap = [(w, next(turn), k) for k, w in enumerate(weight) if not waits.get(k)]
    heapq.heapify(heap)
    released: dict[int, list[int]] = {}
    for k, hubs in waits.items():
        for h in hubs:
            released.setdefault(h, []).append(k)
    gone = [False] * len(size)
    order: list[int] = []
    below: dict[int, set[int]] = {}
    while heap:
        w, _, k = heapq.heappop(heap)
        if gone[k] or w != weight[k]:
            continue
        gone[k] = True
        order.append(k)
        others = below[k] = neighbours[k]
        for m in others:
            mine = neighbours[m]
            gained = others - mine
            gained.discard(m)
            mine |= gained
            mine.discard(k)
            weight[m] += sum(size[x] for x in gained) - size[k]
            if not waits.get(m):
                heapq.heappush(heap, (weight[m], next(turn), m))
        for m in released.get(k, ()):
            waits[m].discard(k)
            if not waits[m]:
                heapq.heappush(heap, (weight[m], next(turn), m))
    return order, below


def _waits(
    nodes: Sequence[JointNode], of_body: Sequence[list[int]], hubs: Sequence[int]
) -> dict[int, set[int]]:
    """For each joint node the hubs (as nodes) that must be eliminated before it."""
    number = {b: len(nodes) + k for k, b in enumerate(hubs)}
    tree, up = _spanning_tree(nodes, of_body, number)
    waits: dict[int, set[int]] = {}
    for k, node in enumerate(nodes):
        if k in tree:
            before = {number[tree[k]]} if tree[k] in number else set()
        else:
            before = {number[b] for b in node.bodies if b in number} | _loop_hubs(node, up, number)
        if before:
            waits[k] = before
    return waits


def _spanning_tree(
    nodes: Sequence[JointNode], of_body: Sequence[list[int]], number: dict[int, int]
) -> tuple[dict[int, int], dict[int, int]]:
    """Tree joint -> its outboard body; body -> nearest hub above it (0 for none); from ground."""
    tree: dict[int, int] = {}
    above: dict[int, int] = {}
    queue: deque[int] = deque()

    def reach(k: int, b: int, hub: int) -> None:
        if b not in above:
            above[b] = hub
            queue.append(b)
            if k >= 0:
                tree[k] = b

    def grow() -> None:
        while queue:
            b = queue.popleft()
            for k in of_body[b]:
                others = [x for x in nodes[k].bodies if x != b]
                if k not in tree and len(others) == 1 and not nodes[k].grounded:
                    reach(k, others[0], b if b in number else above[b])

    for k, node in enumerate(nodes):
        if len(node.bodies) == 1:
            reach(k, node.bodies[0], 0)
    grow()
    # what floats: from its largest hub
    for b in sorted(range(1, len(of_body)), key=lambda b: -len(of_body[b])):
        if b not in above:
            reach(-1, b, 0)
            grow()
    return tree, above


def _loop_hubs(node: JointNode, above: dict[int, int], number: dict[int, int]) -> set[int]:
    """Hubs on the tree paths between the bodies of a closing node, and the one where they meet."""

    def chain(b: int) -> list[int]:
        found = []
        while b := above.get(b, 0):
            found.append(b)
        return found

    chains = [chain(b) for b in node.bodies]
    if len(node.bodies) != 2 or node.grounded:  # to ground, or between three and more: all
        return {number[h] for c in chains for h in c}
    common = [h for h in chains[0] if h in set(chains[1])]
    first = {common[0]} if common else set()
    return {number[h] for h in (set(chains[0]) ^ set(chains[1])) | first}


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
    return np.where(depth < 0, 0, deepest + 1 - depth).tolist()


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
