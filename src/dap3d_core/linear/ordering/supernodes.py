"""Nodes that are eliminated together, as one dense panel.

Late in the elimination of a net nodes of a few rows each update the same large dense block again
and again. Nodes that follow each other in the elimination tree, and whose columns hold nearly the
same rows, become one panel of many rows instead: few large products take the place of many small
ones, and the program is short. Zeros that a panel stores besides are bounded (relaxed supernodes:
Ashcraft, Grimes, ACM Trans. Math. Software 15, 1989).

The order changes along the tree alone (a postorder), which changes neither fill nor pivots.
"""

from collections.abc import Sequence

import attrs

from dap3d_core.linear.ordering.ordering import Ordering

#: A panel has at least and at most so many rows. Fewer are no faster than nodes are; more would
#: leave the working set of its products the first cache.
LEAST_ROWS, MOST_ROWS = 12, 48
#: Zeros that a panel may store, as part of its numbers.
ZEROS = 0.3


def with_panels(found: Ordering) -> Ordering:
    """The same elimination, ordered so that the nodes of each panel follow one another."""
    sizes = found.sizes
    parent = [min(below, default=-1) for below in found.below]
    rows_below = [sum(sizes[m] for m in below) for below in found.below]
    group = _groups(sizes, parent, rows_below, [found.is_hub(k) for k in range(len(sizes))])
    members: dict[int, list[int]] = {}
    for k, top in enumerate(group):
        members.setdefault(top, []).append(k)
    order: list[int] = []
    panels: list[tuple[int, int, int]] = []
    for top in _postorder(group, parent, list(members)):
        mine = members[top]
        if sum(sizes[k] for k in mine) >= LEAST_ROWS:
            first = len(order)
            panels += [(a, b, first + len(mine)) for a, b in _slices(mine, sizes, first)]
        order += mine
    place = {old: new for new, old in enumerate(order)}
    return attrs.evolve(
        found,
        order=tuple(found.order[k] for k in order),
        below=tuple(tuple(sorted(place[m] for m in found.below[k])) for k in order),
        panels=tuple(panels),
    )


def _groups(
    sizes: Sequence[int], parent: Sequence[int], rows_below: Sequence[int], hub: Sequence[bool]
) -> list[int]:
    """For each place the last place of its group."""
    count = len(sizes)
    rows, zeros = list(sizes), [0] * count  # of the group that ends at each place
    children: list[list[int]] = [[] for _ in range(count)]
    joined = list(range(count))
    for k in range(count):
        # numbers of each child's columns that would be zeros, the fewest first
        cost = sorted((rows[c] * (rows[k] + rows_below[k] - rows_below[c]), c) for c in children[k])
        for _, c in cost:
            if hub[c] != hub[k]:
                continue
            more = zeros[k] + zeros[c] + rows[c] * (rows[k] + rows_below[k] - rows_below[c])
            together = rows[k] + rows[c]
            if more <= ZEROS * together * (together / 2 + rows_below[k]):
                joined[c] = k
                rows[k], zeros[k] = together, more
        if parent[k] >= 0:
            children[parent[k]].append(k)
    for k in range(count - 1, -1, -1):
        joined[k] = joined[joined[k]]
    return joined


def _postorder(group: Sequence[int], parent: Sequence[int], tops: Sequence[int]) -> list[int]:
    """The groups, each after those below it in the tree of groups."""
    above = {top: group[parent[top]] if parent[top] >= 0 else -1 for top in tops}
    branches: dict[int, list[int]] = {}
    for top in sorted(tops):
        branches.setdefault(above[top], []).append(top)
    order: list[int] = []
    waiting = [-1]
    while waiting:  # parents first and from the right: reversed it is a postorder
        top = waiting.pop()
        order.append(top)
        waiting += branches.get(top, ())
    order.reverse()
    return order[:-1]


def _slices(members: Sequence[int], sizes: Sequence[int], first: int) -> list[tuple[int, int]]:
    """Places (first, last + 1) of the panels of a group, of about the same number of rows."""
    total = sum(sizes[k] for k in members)
    count = -(-total // MOST_ROWS)
    result: list[tuple[int, int]] = []
    begin = rows = 0
    for n, k in enumerate(members):
        rows += sizes[k]
        if rows * count >= total * (len(result) + 1):
            result.append((first + begin, first + n + 1))
            begin = n + 1
    return result
