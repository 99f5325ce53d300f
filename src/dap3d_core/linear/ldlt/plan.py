"""The static elimination program of a model: the place of each block, the products that are formed.

K is stored by nodes: below the square block of a node's own rows those of the rows that it updates,
all of them with as many numbers as the node has rows. A panel (ordering/ordering.py) is one node
of many rows; what is assembled into it, and what small nodes subtract from it, is in blocks of
its own until the panel's turn comes, so that small nodes know nothing of panels.
"""

from collections.abc import Iterable, Iterator, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Integers
from dap3d_core.linear.ordering.elimination_order import order_nodes
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
    return table_of(updates, 6), begins


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


@attrs.frozen(eq=False)
class Plan:
    """Arrays of the program; all entries are indices into flat arrays.

    Attributes:
        ordering: what was found, for reports.
        joint_row: (joints,) place of each joint's first row in the row vectors (gamma, nu, C, x).
        joint_block: per joint the places in D of its blocks, one a slot (ground's a spare place).
        row_size: length of the row vectors: all rows, six for each hub.
        block_size, matrix_size: lengths of D and K.
        blocks: (b, 5) of D: place, body, rows, first row, 1 if its body is a hub.
        targets: (t, 6) of K: place, rows, columns, first and last+1 contribution, kind (see below).
        contributions: (c, 2) places in D of the two factors.
        nodes: (n + 1, 6) rows, first row, place of the diagonal block, sign, first column entry,
            first update.
        columns: (k, 3) blocks below the diagonal: place in K, first row, rows.
        updates: (u, 6) place of left and right factor and of the target in K, rows, columns, 1 on
            the diagonal. A panel's have twice the length of the target's rows added to the last
            number; before them stand the blocks that it gathers, with minus that number.
        hubs: (h, 2) body and first row of each body that waits.
        fill: blocks, one for two joint nodes or hubs, that are zero before the factorisation.
        unfilled_size: numbers of the blocks that are not, and of the diagonal blocks.
    """

    ordering: Ordering
    joint_row: Integers
    joint_block: tuple[tuple[int, ...], ...]
    row_size: int
    block_size: int
    matrix_size: int
    blocks: Integers
    targets: Integers
    contributions: Integers
    nodes: Integers
    columns: Integers
    updates: Integers
    hubs: Integers
    fill: int
    unfilled_size: int

    @property
    def entries(self) -> tuple[Integers, Integers, Integers]:
        """Of each row of each block of D: its place in D, its row in the row vectors, its body."""
        heights = self.blocks[:, 2]
        within = np.arange(heights.sum()) - np.repeat(np.cumsum(heights) - heights, heights)
        place, row, body = (np.repeat(self.blocks[:, c], heights) for c in (0, 3, 1))
        return place + 6 * within, row + within, body

    @property
    def work(self) -> int:
        """Estimate of the multiplications of one factorisation and what goes with it."""
        nodes, updates = self.nodes, self.updates
        rows = np.repeat(nodes[:-1, 0], np.diff(nodes[:, 5]))
        products = rows * updates[:, 3] * updates[:, 4] // (1 + (updates[:, 5] != 0))
        own = int(np.sum(nodes[:-1, 0] ** 3)) // 6
        return int(np.sum(products)) + own + ROW_WORK * int(np.sum(self.blocks[:, 2]))


#: Multiplications for one row of a block of D: evaluated, scaled, multiplied.
ROW_WORK = 36

#: Kinds of a target: off-diagonal sum of products, diagonal sum of products, copy of a block of D
#: by rows or transposed, identity.
PRODUCTS, DIAGONAL, COPY, TRANSPOSE, IDENTITY = range(5)


def make_plan(
    body_count: int,
    joint_slots: Sequence[tuple[int, ...]],
    joint_rows: Sequence[int],
    alone: int = 0,
) -> Plan:
    """Find the elimination program of a model's sparsity.

    Args:
        body_count: bodies without ground, numbered from 1.
        joint_slots: bodies of each joint by slot, ground 0.
        joint_rows: rows of each joint.
        alone: so many joints, the last ones, share a node with no other.
    """
    found = order_nodes(body_count, joint_slots, joint_rows, alone)
    node_count, sizes = len(found.nodes), found.sizes
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64).tolist()
    place = {node: k for k, node in enumerate(found.order)}
    hubs = {b: node_count + h for h, b in enumerate(found.hubs)}

    blocks, block_of, joint_row, joint_block, block_size = _lay_blocks(
        found, joint_slots, joint_rows, place, starts, hubs
    )
    made_of = _contents(found, place, block_of)
    matrix = lay_matrix(found, starts, made_of)
    targets, contributions = _targets(found, starts, matrix, made_of)
    updates, update_start = list_updates(found, starts, matrix)
    hub_rows = [(b, starts[place[hubs[b]]]) for b in found.hubs]
    filled = sum(1 for row, column in made_of if row != column)
    nodes, columns = _nodes(found, starts, matrix, update_start), table_of(matrix.columns, 3)
    return Plan(
        ordering=found,
        joint_row=np.array(joint_row, dtype=np.int64),
        joint_block=tuple(joint_block),
        row_size=starts[-1],
        block_size=block_size,
        matrix_size=matrix.size,
        blocks=table_of(blocks, 5),
        targets=targets,
        contributions=contributions,
        nodes=nodes,
        columns=columns,
        updates=updates,
        hubs=table_of(hub_rows, 2),
        fill=sum(map(len, found.below)) - filled,
        unfilled_size=sum(m * m for m in sizes)
        + sum(sizes[row] * sizes[column] for row, column in made_of if row != column),
    )


def _nodes(
    found: Ordering, starts: Sequence[int], matrix: FactorLayout, update_start: Sequence[int]
) -> Integers:
    rows = []
    for k, (first, last, _) in enumerate(matrix.spans):
        size, sign = starts[last] - starts[first], 1 if found.is_hub(first) else -1
        begin = matrix.column_start[k], update_start[k]
        rows.append((size, starts[first], matrix.place[k], sign, *begin))
    rows.append((0, starts[-1], matrix.size, 0, matrix.column_start[-1], update_start[-1]))
    return table_of(rows, 6)


def table_of(rows: Sequence[Sequence[int]], width: int) -> Integers:
    """Integers in rows of a width, of no rows as well."""
    return np.array(rows, dtype=np.int64).reshape(-1, width)


def _lay_blocks(
    found: Ordering,
    joint_slots: Sequence[tuple[int, ...]],
    joint_rows: Sequence[int],
    place: dict[int, int],
    starts: Sequence[int],
    hubs: dict[int, int],
) -> tuple[
    list[tuple[int, ...]], dict[tuple[int, int], int], list[int], list[tuple[int, ...]], int
]:
    """Places of the blocks of D: by node, then body, the node's joints below one another."""
    blocks: list[tuple[int, ...]] = []
    block_of: dict[tuple[int, int], int] = {}
    joint_row = [0] * len(joint_slots)
    joint_block: list[tuple[int, ...]] = [()] * len(joint_slots)
    size = 6 * max((int(m) for m in joint_rows), default=0)  # the spare place, for ground
    for k, node in enumerate(found.nodes):
        first_row = starts[place[k]]
        for b in node.bodies:
            blocks.append((size, b, node.rows, first_row, int(b in hubs)))
            block_of[k, b] = size
            size += 6 * node.rows
        offset = 0
        for joint in node.joints:
            joint_row[joint] = first_row + offset
            slots = joint_slots[joint]
            joint_block[joint] = tuple(block_of[k, b] + 6 * offset if b else 0 for b in slots)
            offset += int(joint_rows[joint])
    return blocks, block_of, joint_row, joint_block, size


def _contents(
    found: Ordering, place: dict[int, int], block_of: dict[tuple[int, int], int]
) -> Contents:
    """Contributions to the nonzero blocks of K (row, column; indices in the order).

    Pairs of blocks of D whose products are summed up, or one block that is copied.
    """
    products: Contents = {}
    hubs = {b: place[len(found.nodes) + h] for h, b in enumerate(found.hubs)}
    of_body: dict[int, list[int]] = {}
    for k, node in enumerate(found.nodes):
        for b in node.bodies:
            of_body.setdefault(b, []).append(k)
    for b in found.early:
        at = sorted((place[k], block_of[k, b]) for k in of_body.get(b, ()))
        for n, (column, right) in enumerate(at):
            products.setdefault((column, column), []).append((right, right))
            for row, left in at[n + 1 :]:
                products.setdefault((row, column), []).append((left, right))
    for b, hub in hubs.items():
        for k in of_body.get(b, ()):
            block = block_of[k, b]
            products[max(place[k], hub), min(place[k], hub)] = [(block, block)]
    return products


def _targets(
    found: Ordering, starts: Sequence[int], matrix: FactorLayout, contents: Contents
) -> tuple[Integers, Integers]:
    """Contributions to each block of K before the factorisation."""
    targets: list[tuple[int, ...]] = []
    contributions: list[tuple[int, int]] = []

    def add(
        where: int, rows: int, cols: int, kind: int, made_of: Sequence[tuple[int, int]]
    ) -> None:
        first = len(contributions)
        contributions.extend(made_of)
        targets.append((where, rows, cols, first, len(contributions), kind))

    sizes = found.sizes
    for k, (first, last, _) in enumerate(matrix.spans):
        if last - first > 1:  # a panel: all zero, until it gathers its blocks
            add(matrix.place[k], matrix.heights[k], starts[last] - starts[first], PRODUCTS, ())
        for column in range(first, last):
            m = sizes[column]
            is_hub = found.is_hub(column)
            kind = IDENTITY if is_hub else DIAGONAL
            add(matrix.diagonal[column], m, m, kind, contents.get((column, column), ()))
            for row, where in matrix.blocks[column].items():
                kind = PRODUCTS
                if is_hub != found.is_hub(row) and (row, column) in contents:
                    kind = COPY if is_hub else TRANSPOSE
                add(where, sizes[row], m, kind, contents.get((row, column), ()))
    return table_of(targets, 6), table_of(contributions, 2)
