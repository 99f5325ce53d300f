"""Spanning forest of a mechanism: which joints carry joint coordinates, which keep their rows.

Where joints close loops one joint of each loop is cut: its rows are kept and solved for with
multipliers on the tree of the others. A kept row is a load that is carried from its two bodies to
ground, and two of them couple where they meet on the way. So few rows want to be kept, near ground.
Forests that keep the fewest rows and forests of the shortest ways are made, and the one of least
work is taken (docs/decisions/0038). No loop is cut at a body without mass if it can be helped: that
would move freely under the row, and the matrix of kept rows lose all digits of the others.
"""

from collections import defaultdict
from collections.abc import Container, Mapping, Sequence
from heapq import heappop, heappush

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Integers
from dap3d_core.registry.suggestions import some

#: Multiplications to carry one row over one body.
CARRY = 24
#: Joints of a loop that words name.
MOST_NAMES = 5


@attrs.frozen
class Cut:
    """A joint that closes a loop and keeps its rows.

    Attributes:
        joint: its place among the joints of the model.
        rows: number of its rows.
        loop: the joints of the forest that close the loop with it, from its one body to the other;
            free bodies are left out.
        node_count: bodies that its rows are carried over, those between the loop and ground, too.
    """

    joint: int
    rows: int
    loop: tuple[int, ...]
    node_count: int

    def words(self, names: Sequence[str]) -> str:
        """The reason why its rows are kept, by the names of the model's joints."""
        return f"it closes a loop with {some([names[k] for k in self.loop], MOST_NAMES)}"


@attrs.frozen(eq=False)
class SpanningForest:
    """The joints of a forest, and those that are cut.

    Attributes:
        joint: (n,) joint between parent and child; -1: the child is free.
        parent, child: (n,) bodies, ground 0, parents before their children and every body behind
            the one before it where it hangs on that; a free body has ground as parent.
        cuts: joints that close loops, in the order of the model.
        work: estimate of the multiplications for the kept rows in one right-hand side.
    """

    joint: Integers
    parent: Integers
    child: Integers
    cuts: tuple[Cut, ...]
    work: int

    @property
    def kept_rows(self) -> int:
        """Number of rows of the cuts."""
        return sum(cut.rows for cut in self.cuts)


def spanning_forest(
    body_count: int, ends: Mapping[int, tuple[int, int]], rows: Sequence[int],
    light: Container[int] = (),
) -> SpanningForest:  # fmt: skip
    """The forest of least work for its kept rows; of equal ones the one that keeps fewest rows.

    Args:
        body_count: number of bodies without ground.
        ends: the two bodies, ground 0, of each joint that may be in the forest, by its place.
        rows: number of rows of every joint of the model.
        light: bodies next to no mass, whose joints are to be in the forest.
    """
    near: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for joint, (a, b) in sorted(ends.items()):
        near[a].append((joint, b))
        near[b].append((joint, a))
    few_rows = _Forest(body_count, ends, rows, near, light, shallow=False)
    if len(few_rows.up) - few_rows.free == len(ends):  # there are no loops
        return few_rows.result()
    short_ways = _Forest(body_count, ends, rows, near, light, shallow=True)
    return min(few_rows.result(), short_ways.result(), key=lambda forest: forest.work)


class _Forest:
    """One spanning forest, grown from ground joint by joint.

    Attributes:
        up: body -> (joint, parent), in the order of growth; joint -1 for a free body.
        depth: body -> joints between it and ground.
        branch: body -> the one next to ground that it hangs on.
        free: number of free bodies.
    """

    def __init__(
        self,
        body_count: int,
        ends: Mapping[int, tuple[int, int]],
        rows: Sequence[int],
        near: Mapping[int, list[tuple[int, int]]],
        light: Container[int],
        *,
        shallow: bool,
    ) -> None:
        self._ends, self._rows = ends, rows
        self.up: dict[int, tuple[int, int]] = {}
        self.depth, self.branch = {0: 0}, {0: 0}
        self.free = 0
        heap: list[tuple[bool, int, int, int, int, int]] = []

        def add(body: int) -> None:
            level = self.depth[body] + 1
            for joint, other in near.get(body, ()):
                if other not in self.depth:
                    first, second = -rows[joint], level
                    key = (second, first) if shallow else (first, second)
                    is_heavy = body not in light and other not in light
                    heappush(heap, (is_heavy, *key, joint, body, other))

        add(0)
        for root in range(body_count + 1):
            if root not in self.depth:
                self.up[root], self.depth[root], self.branch[root] = (-1, 0), 1, root
                self.free += 1
                add(root)
            while heap:
                *_, joint, parent, child = heappop(heap)
                if child not in self.depth:
                    self.up[child], self.depth[child] = (joint, parent), self.depth[parent] + 1
                    self.branch[child] = self.branch[parent] or child
                    add(child)

    def result(self) -> SpanningForest:
        """The forest with its bodies depth first, and what it cuts."""
        order = self._depth_first()
        joints = np.array([self.up[b][0] for b in order], dtype=np.int64)
        parents = np.array([self.up[b][1] for b in order], dtype=np.int64)
        in_forest = set(joints.tolist())
        found = [self._cut(k) for k in sorted(self._ends) if k not in in_forest]
        cuts, meetings = tuple(cut for cut, _ in found), [body for _, body in found]
        work = self._carry_work(cuts, meetings, order) + self._factor_work(cuts) if cuts else 0
        return SpanningForest(joints, parents, np.array(order, dtype=np.int64), cuts, work)

    def _depth_first(self) -> list[int]:
        """Bodies behind their parents, in the order in which they grew."""
        children: dict[int, list[int]] = defaultdict(list)
        for body, (_, parent) in self.up.items():
            children[parent].append(body)
        order, todo = [], children[0][::-1]
        while todo:
            order.append(body := todo.pop())
            todo += children[body][::-1]
        return order

    def _cut(self, joint: int) -> tuple[Cut, int]:
        """A joint that is not in the forest, and the body where the ways from its two meet."""
        one, other = self._ends[joint]
        from_one, from_other = [], []
        while one != other:
            if self.depth[one] >= self.depth[other]:
                k, one = self.up[one]
                from_one.append(k)
            else:
                k, other = self.up[other]
                from_other.append(k)
        whole = (*from_one, *reversed(from_other))
        loop = tuple(k for k in whole if k >= 0)
        return Cut(joint, self._rows[joint], loop, len(whole) + self.depth[one]), one

    def _carry_work(
        self, cuts: Sequence[Cut], meetings: Sequence[int], order: Sequence[int]
    ) -> int:
        """Multiplications to carry rows to ground, and for the matrix of those that meet."""
        carried = dict.fromkeys((0, *order), 0)  # rows that pass each body
        for cut, meeting in zip(cuts, meetings, strict=True):
            for body in self._ends[cut.joint]:
                carried[body] += cut.rows
            carried[meeting] -= cut.rows
        for body in reversed(order):
            carried[self.up[body][1]] += carried[body]
        work = 0
        for body in order:
            joint, count = self.up[body][0], carried[body]
            freedoms = 6 - self._rows[joint] if joint >= 0 else 6
            work += CARRY * count + freedoms * count * (count + 1) // 2
        return work

    def _factor_work(self, cuts: Sequence[Cut]) -> int:
        """Multiplications to factor the matrix of all rows within its profile.

        Rows couple where they are carried over the same body next to ground.
        """
        place, work = 0, 0
        first_of: dict[int, int] = {}
        for cut in cuts:
            branches = {self.branch[body] for body in self._ends[cut.joint]} - {0}
            first = min((first_of.setdefault(body, place) for body in branches), default=place)
            for row in range(place, place + cut.rows):
                work += (row - first + 1) * (row - first + 2) // 2
            place += cut.rows
        return work
