"""An elimination order: its nodes, and the work that it takes."""

from collections.abc import Iterator, Sequence

import attrs

#: A panel has at least and at most so many rows. Fewer are no faster than nodes are; more would
#: leave the working set of its products the first cache.
LEAST_ROWS, MOST_ROWS = 12, 48
#: Zeros that a panel may store, as part of its numbers.
ZEROS = 0.3


@attrs.frozen
class JointNode:
    """Joints between the same bodies.

    Attributes:
        bodies: without ground.
        grounded: whether ground is one of its bodies, too.
        joints: by index.
        rows: of all its joints.
    """

    bodies: tuple[int, ...]
    grounded: bool
    joints: tuple[int, ...]
    rows: int


@attrs.frozen
class Ordering:
    """The order of elimination.

    Attributes:
        nodes: joint nodes.
        early: bodies eliminated first, in any order.
        hubs: bodies that wait, ascending.
        order: what comes after the early bodies: k is a joint node where k < len(nodes), else hub
            k - len(nodes).
        below: for each entry of ``order`` the places in ``order`` that it updates, ascending.
        panels: places (first, last + 1) in ``order`` of what is eliminated together, and where the
            group ends whose part it is.
    """

    nodes: tuple[JointNode, ...]
    early: tuple[int, ...]
    hubs: tuple[int, ...]
    order: tuple[int, ...]
    below: tuple[tuple[int, ...], ...]
    panels: tuple[tuple[int, int, int], ...] = ()

    def is_hub(self, place: int) -> bool:
        """True if an index of ``order`` holds a hub, not a joint node."""
        return self.order[place] >= len(self.nodes)

    @property
    def sizes(self) -> list[int]:
        """Rows at each place of ``order``."""
        return [6 if k >= len(self.nodes) else self.nodes[k].rows for k in self.order]

    @property
    def work(self) -> int:
        """Multiplications for factors, divisions and updates, each with an addition."""
        return sum(
            m * (m + 1) * (m + 2) // 6 + m * (m + 1) // 2 * w + m * w * (w + 1) // 2
            for m, w in self._fronts()
        )

    @property
    def widest(self) -> int:
        """Most rows that the elimination of one node updates."""
        return max((w for _, w in self._fronts()), default=0)

    def _fronts(self) -> Iterator[tuple[int, int]]:
        """Of each node its rows, and how many it updates."""
        sizes = self.sizes
        for m, below in zip(sizes, self.below, strict=True):
            yield m, sum(sizes[k] for k in below)


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
