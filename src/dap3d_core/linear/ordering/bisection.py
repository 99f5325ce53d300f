"""An elimination cut in two halves that share nothing, and a top that both lead to.

Subtrees of the elimination tree know nothing of each other: they are dealt out to two halves, and
what is above all of them is the top. The order becomes first half, second half, top, each in the
order it had, which changes neither fill nor pivots. All nodes of a body that is eliminated early
lie on one path to the root, so that no such body has nodes in both halves.
"""

import heapq
from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.linear.ordering.elimination_order import Ordering, work_of

Integers = NDArray[np.int64]

#: What a row costs beside the factorisation (its Jacobian, assembly, solution), as multiplications.
ROW_WORK = 100
#: How many subtrees are opened at most in search of equal halves, and how many of them in a row
#: without making the slower half any faster.
MOST_OPENED, PATIENCE = 2000, 200
#: The slower half and the top together may have this part of the work; else nothing is cut.
LARGEST_PART = 0.85
#: So much longer the longer half may be for the sake of neighbours that stay together.
UNEVEN = 1.05
#: An order that can be cut may take so many times the work of one that cannot.
MORE_WORK = 1.1

#: The parts, in the order of elimination.
FIRST, SECOND, TOP = range(3)


@attrs.frozen(eq=False)
class Halves:
    """Where the parts of a plan begin and end, and the program of the second half.

    Each half adds to the top in a place of its own: the first one where the top's numbers stand,
    the second one in a copy that follows the last number of K and of the row vectors.

    Attributes:
        nodes, rows, targets: (4,) first of each part in the plan's tables, and the end.
        matrix: (2,) place of the top in K, and how many numbers it has.
        columns, updates: as the plan's; the second half's targets in the top are those of the copy.
        node_part: (joint nodes,) part of each.
        body_part: (n + 1,) part of each body: of the half that has nodes of it.
    """

    nodes: Integers
    rows: Integers
    targets: Integers
    matrix: Integers
    columns: Integers
    updates: Integers
    node_part: Integers
    body_part: Integers


def in_halves(found: Ordering) -> Ordering:
    """The same elimination as first half, second half, top; as it was where that does not pay."""
    part = _deal_out(found)
    if part is None:
        return found
    order = sorted(range(len(part)), key=part.__getitem__)  # stable
    place = {old: new for new, old in enumerate(order)}
    return attrs.evolve(
        found,
        order=tuple(found.order[k] for k in order),
        below=tuple(tuple(sorted(place[m] for m in found.below[k])) for k in order),
        panels=tuple(
            sorted((place[a], place[b - 1] + 1, place[end - 1] + 1) for a, b, end in found.panels)
        ),
        parts=(part.count(FIRST), part.count(FIRST) + part.count(SECOND)),
    )


def _deal_out(found: Ordering) -> list[int] | None:
    """The part of each place of the order; None where no two halves share the work."""
    sizes, count = found.sizes, len(found.order)
    unit = list(range(count))  # the last place of what stays together: places of one group
    for first, last, end in found.panels:
        unit[first:last] = [end - 1] * (last - first)
    weight, parent = [0] * count, [-1] * count
    for k, below in enumerate(found.below):
        weight[unit[k]] += work_of(sizes[k], sum(sizes[m] for m in below)) + ROW_WORK * sizes[k]
        if unit[k] == k and below:
            parent[k] = unit[below[0]]
    branches: list[list[int]] = [[] for _ in range(count)]
    total = list(weight)  # of a subtree
    for k in range(count):
        if unit[k] == k and parent[k] >= 0:
            branches[parent[k]].append(k)
            total[parent[k]] += total[k]
    roots = [k for k in range(count) if unit[k] == k and parent[k] < 0]
    best = _open_subtrees(roots, branches, weight, total)
    if best is None:
        return None
    part = [TOP] * count
    for half, subtrees in enumerate(best):
        for k in subtrees:
            part[k] = half
    for k in range(count - 1, -1, -1):
        if unit[k] == k and parent[k] >= 0 and part[parent[k]] != TOP:
            part[k] = part[parent[k]]
    return [part[unit[k]] for k in range(count)]


def _open_subtrees(
    roots: Sequence[int],
    branches: Sequence[Sequence[int]],
    weight: Sequence[int],
    total: Sequence[int],
) -> tuple[list[int], list[int]] | None:
    """Two lists of subtrees of about the same weight, with little above them."""
    heap = [(-total[k], k) for k in roots]
    heapq.heapify(heap)
    everything = sum(total[k] for k in roots)
    least, best, top = LARGEST_PART * everything, None, 0
    waited = 0
    for _ in range(MOST_OPENED):
        if not heap or waited > PATIENCE or top >= least:
            break
        heaviest = -heap[0][0]
        waited += 1
        # what any way to deal them out will take
        if top + max(heaviest, (everything - top) / 2) < least:
            halves = _dealt(heap)
            longest = top + max(sum(total[k] for k in half) for half in halves)
            if longest < least:
                least, best, waited = longest, halves, 0
        _, k = heapq.heappop(heap)
        top += weight[k]
        for branch in branches[k]:
            heapq.heappush(heap, (-total[branch], branch))
    return best


def _dealt(heap: Sequence[tuple[int, int]]) -> tuple[list[int], list[int]]:
    """Subtrees in two lists of about the same weight, in the order of their places.

    Neighbours stay together where that costs little: their bodies and joints mostly follow each
    other in memory. Else the heaviest goes first, each to the lighter half.
    """
    halves: tuple[list[int], list[int]] = ([], [])
    load = [0, 0]
    for negative, k in sorted(heap):
        lighter = int(load[1] < load[0])
        halves[lighter].append(k)
        load[lighter] -= negative
    in_order = sorted((k, -negative) for negative, k in heap)
    sums = np.cumsum([0] + [weight for _, weight in in_order])
    n = int(np.argmin(np.abs(sums - sums[-1] / 2)))
    if max(sums[n], sums[-1] - sums[n]) <= UNEVEN * max(load):
        places = [k for k, _ in in_order]
        return places[:n], places[n:]
    first, second = sorted(halves, key=lambda half: min(half, default=-1))
    return first, second


def halves_of(
    found: Ordering,
    starts: Sequence[int],
    nodes: Integers,
    targets: Integers,
    columns: Integers,
    updates: Integers,
) -> Halves:
    """The tables of an order that ``in_halves`` has cut.

    Args:
        found: the order.
        starts: (places + 1,) first row of each place.
        nodes, targets, columns, updates: of the plan.
    """
    second, top = found.parts
    rows = np.array([0, starts[second], starts[top], starts[-1]])
    bounds = np.searchsorted(nodes[:, 1], rows)
    begins = nodes[bounds, 2]
    matrix = np.array([begins[TOP], begins[3] - begins[TOP]])
    mine = slice(nodes[bounds[SECOND], 5], nodes[bounds[TOP], 5])
    own_updates = updates.copy()
    own_updates[mine, 2] += np.where(own_updates[mine, 2] >= matrix[0], matrix[1], 0)
    mine = slice(nodes[bounds[SECOND], 4], nodes[bounds[TOP], 4])
    own_columns = columns.copy()
    own_columns[mine, 1] += np.where(own_columns[mine, 1] >= rows[TOP], rows[3] - rows[TOP], 0)
    part = np.searchsorted([second, top], np.arange(len(found.order)), side="right")
    node_part = np.zeros(len(found.nodes), dtype=np.int64)
    of_body: dict[int, int] = {}
    for place, k in enumerate(found.order):
        if k < len(found.nodes):
            node_part[k] = part[place]
            for b in found.nodes[k].bodies:
                of_body[b] = min(of_body.get(b, TOP), int(part[place]))
    for place, k in enumerate(found.order):
        if k >= len(found.nodes):
            of_body[found.hubs[k - len(found.nodes)]] = int(part[place])
    count = len(found.early) + len(found.hubs)
    body_part = np.full(count + 1, TOP)
    free = [b for b in range(1, count + 1) if b not in of_body]
    for n, b in enumerate(free):
        of_body[b] = int(2 * n >= len(free))
    for b, where in of_body.items():
        body_part[b] = where
    return Halves(
        nodes=bounds.astype(np.int64),
        rows=rows.astype(np.int64),
        targets=np.searchsorted(np.maximum.accumulate(targets[:, 0]), begins).astype(np.int64),
        matrix=matrix.astype(np.int64),
        columns=own_columns,
        updates=own_updates,
        node_part=node_part,
        body_part=body_part.astype(np.int64),
    )
