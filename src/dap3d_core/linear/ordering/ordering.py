"""An elimination order: its nodes, and the work that it takes."""

from collections.abc import Iterator

import attrs


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
        """Multiplications of the factorisation, each with an addition."""
        return sum(work_of(m, w) for m, w in self._fronts())

    @property
    def widest(self) -> int:
        """Most rows that the elimination of one node updates."""
        return max((w for _, w in self._fronts()), default=0)

    def _fronts(self) -> Iterator[tuple[int, int]]:
        sizes = self.sizes
        for m, below in zip(sizes, self.below, strict=True):
            yield m, sum(sizes[k] for k in below)


def work_of(m: int, w: int) -> int:
    """Of a node of m rows that updates w: factors, division, update."""
    return m * (m + 1) * (m + 2) // 6 + m * (m + 1) // 2 * w + m * w * (w + 1) // 2
