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

from dap3d_core.linear.ordering.ordering import JointNode, Ordering

#: A body with this many joint nodes or more waits: eliminating it late costs less from here on.
HUB_DEGREE = 5

#: Joints between the same bodies share a node as long as their rows fit in one body's six.
NODE_ROWS = 6

#: Where the elimination of a node updates more rows than this, another order is tried.
WIDE = 48


def order_nodes(
    body_count: int,
    joint_slots: Sequence[tuple[int, ...]],
    joint_rows: Sequence[int],
) -> Ordering:
    """Find the order of elimination.

    Args:
        body_count: bodies without ground; they are numbered from 1.
        joint_slots: bodies of each joint, ground 0.
        joint_rows: rows of each joint.
    """
    nodes = _merge(joint_slots, joint_rows)
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
        from dap3d_core.linear.ordering.nested_dissection import dissect
        from dap3d_core.linear.ordering.supernodes import with_panels

        other = eliminated(dissect(_neighbours(nodes, of_body, early, hubs), size))
        found = with_panels(min(found, other, key=lambda ordering: ordering.work))
    return found


def _merge(joint_slots: Sequence[tuple[int, ...]], joint_rows: Sequence[int]) -> list[JointNode]:
    found: dict[tuple[tuple[int, ...], bool], int] = {}
    keys: list[tuple[tuple[int, ...], bool]] = []
    joints: list[list[int]] = []
    rows: list[int] = []
    for joint, (slots, m) in enumerate(zip(joint_slots, joint_rows, strict=True)):
        others = tuple(sorted({b for b in slots if b}))
        key = others, 0 in slots or len(others) == 1
        node = found.get(key)
        if node is None or rows[node] + m > NODE_ROWS:
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
