"""Layout of the blocks of K, and of the updates of each node to later ones."""

from collections.abc import Iterable, Iterator, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.linear.ordering.ordering import Ordering

#: Blocks of K (row, column) and the pairs of blocks of D that they are made of.
Contents = dict[tuple[int, int], list[tuple[int, int]]]


@attrs.frozen(eq=False)
class FactorLayout:
    """The layout of K. A node is one place of the order, or the places of a panel.

    Attributes:
        spans: places (first, last + 1) of each node, and where its group ends (of no panel: there).
        place: where each node's numbers begin in K.
        heights: rows of each node, those that it updates included.
        column_start: (nodes + 1,) first of each node's ``columns``.
        columns: rows that a node updates: place in K, first row, rows.
        diagonal: for each place of the order its diagonal block; of a panel, where it waits.
        blocks: for each place the blocks below; of a panel, those that are not zero.
        size: length of K.
    """

    spans: list[tuple[int, int, int]]
    place: list[int]
    heights: list[int]
    column_start: list[int]
    columns: list[tuple[int, ...]]
    diagonal: list[int]
    blocks: list[dict[int, int]]
    size: int


def lay_matrix(found: Ordering, starts: Sequence[int], contents: Contents) -> FactorLayout:
    """Places of the blocks of K, node by node.

    Args:
        found: the order.
        starts: (places + 1,) first row of each place.
        contents: what is not zero before the factorisation.
    """
    sizes = found.sizes
    spans = list(_spans(found))
    waiting = _waiting(found, spans, contents) if found.panels else {}
    result = FactorLayout(spans, [], [], [0], [], [], [], 0)
    size = 0
    for first, last, end in spans:
        result.place.append(size)
        m = starts[last] - starts[first]
        start, below = size, _below(found, last, end)
        size += m * m
        if last - first == 1:
            places = {}
            for row in below:
                places[row] = size
                result.columns.append((size, starts[row], sizes[row]))
                size += sizes[row] * m
            result.diagonal.append(start)
            result.blocks.append(places)
        else:
            for top, bottom in _runs(below):
                result.columns.append((size, starts[top], starts[bottom] - starts[top]))
                size += (starts[bottom] - starts[top]) * m
        result.heights.append((size - start) // m)
        result.column_start.append(len(result.columns))
        if last - first > 1:
            for column in range(first, last):
                result.diagonal.append(size)
                size += sizes[column] ** 2
                places = {}
                for row in sorted(waiting.get(column, ())):
                    places[row] = size
                    size += sizes[row] * sizes[column]
                result.blocks.append(places)
    return attrs.evolve(result, size=size)


def _spans(found: Ordering) -> Iterator[tuple[int, int, int]]:
    k = 0
    for first, last, end in found.panels:
        yield from ((n, n + 1, n + 1) for n in range(k, first))
        yield first, last, end
        k = last
    yield from ((n, n + 1, n + 1) for n in range(k, len(found.order)))


def _below(found: Ordering, last: int, end: int) -> list[int]:
    """Places that a node updates: what follows in its group, and what the group updates."""
    return [*range(last, end), *found.below[end - 1]]


def _runs(places: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Ranges (first, last + 1) of ascending places that follow each other."""
    first = last = -1
    for k in places:
        if k != last:
            if first >= 0:
                yield first, last
            first = k
        last = k + 1
    if first >= 0:
        yield first, last


def _waiting(
    found: Ordering, spans: Sequence[tuple[int, int, int]], contents: Contents
) -> dict[int, set[int]]:
    """For each place of a panel the rows of its blocks that others than panels write to."""
    panel = [False] * len(found.order)
    for first, last, _ in found.panels:
        panel[first:last] = [True] * (last - first)
    result: dict[int, set[int]] = {}
    for row, column in contents:
        if row != column and panel[column]:
            result.setdefault(column, set()).add(row)
    for first, last, _ in spans:
        if last - first == 1:
            below = found.below[first]
            for n, column in enumerate(below):
                if panel[column]:
                    result.setdefault(column, set()).update(below[n + 1 :])
    return result


def list_updates(
    found: Ordering, starts: Sequence[int], matrix: FactorLayout
) -> tuple[NDArray[np.int64], list[int]]:
    """Products that the elimination of each node subtracts from later blocks, (u, 6), by nodes.

    Returns:
        the table (linear/ldlt/plan.py) and, (nodes + 1,), each node's first entry.
    """
    sizes, diagonal = found.sizes, matrix.diagonal
    updates: list[tuple[int, ...]] = []
    begins = [0]
    panels = _Panels(found, starts, matrix) if found.panels else None
    for k, (first, last, _) in enumerate(matrix.spans):
        if last - first == 1:
            mine, below = matrix.blocks[first], found.below[first]
            for n, right in enumerate(below):
                here = mine[right]
                updates.append((here, here, diagonal[right], sizes[right], sizes[right], 1))
                later = matrix.blocks[right]
                updates.extend(
                    (mine[left], here, later[left], sizes[left], sizes[right], 0)
                    for left in below[n + 1 :]
                )
        else:
            assert panels is not None
            updates.extend(panels.gathered(k))
            updates.extend(panels.products(k))
        begins.append(len(updates))
    return np.array(updates, dtype=np.int64).reshape(-1, 6), begins


class _Panels:
    """Addresses in the columns of nodes, by places of the order."""

    def __init__(self, found: Ordering, starts: Sequence[int], matrix: FactorLayout) -> None:
        self.found, self.starts, self.matrix = found, starts, matrix
        self.sizes = found.sizes
        self.node = [k for k, span in enumerate(matrix.spans) for _ in range(*span[:2])]
        self.rows: list[dict[int, int]] = [{} for _ in matrix.spans]

    def address(self, row: int, column: int) -> int:
        """Offset of the block (row, column) in the columns of its node."""
        k = self.node[column]
        first, last, end = self.matrix.spans[k]
        at = self.rows[k]
        if not at:
            count = 0
            for place in (*range(first, last), *_below(self.found, last, end)):
                at[place] = count
                count += self.sizes[place]
        offset = self.starts[column] - self.starts[first]
        return self.matrix.place[k] + at[row] * self.width(k) + offset

    def width(self, k: int) -> int:
        """Numbers in a row of a node."""
        first, last, _ = self.matrix.spans[k]
        return self.starts[last] - self.starts[first]

    def gathered(self, k: int) -> Iterator[tuple[int, ...]]:
        """Blocks that were assembled apart from a panel and are added to it."""
        flag, matrix, sizes = 2 * self.width(k), self.matrix, self.sizes
        for column in range(*matrix.spans[k][:2]):
            m, at = sizes[column], matrix.diagonal[column]
            yield at, at, self.address(column, column), m, m, -(flag + 1)
            for row, block in matrix.blocks[column].items():
                yield block, block, self.address(row, column), sizes[row], m, -flag

    def products(self, k: int) -> Iterator[tuple[int, ...]]:
        """Updates by a panel: ranges of rows from ranges of columns of one node."""
        first, last, end = self.matrix.spans[k]
        runs = list(_runs(_below(self.found, last, end)))
        for n, run in enumerate(runs):
            for begin, close in self._pieces(run):
                right = self.address(begin, first)
                cols = self.starts[close] - self.starts[begin]
                flag = 2 * self.width(self.node[begin])
                yield right, right, self.address(begin, begin), cols, cols, flag + 1
                for top, bottom in ((close, run[1]), *runs[n + 1 :]):
                    if top < bottom:
                        rows = self.starts[bottom] - self.starts[top]
                        left = self.address(top, first)
                        yield left, right, self.address(top, begin), rows, cols, flag

    def _pieces(self, run: tuple[int, int]) -> Iterator[tuple[int, int]]:
        """A range of places cut where another node begins."""
        begin = run[0]
        while begin < run[1]:
            end = min(run[1], self.matrix.spans[self.node[begin]][1])
            yield begin, end
            begin = end
