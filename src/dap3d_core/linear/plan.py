"""The static elimination program of a model: where each block stands, which products are made."""

from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.linear.ordering import Ordering, order_nodes

Integers = NDArray[np.int64]


@attrs.frozen(eq=False)
class Plan:
    """Arrays of the program; all entries are indices into flat arrays.

    Attributes:
        ordering: what was found, for reports.
        joint_row: (joints,) place of each joint's first row in the row vectors (gamma, nu, C, x).
        joint_block: per joint the places in D of its blocks, one a slot (ground's a spare place).
        row_size: length of the row vectors: all rows, and six for each hub.
        block_size, matrix_size: lengths of D and K.
        blocks: (b, 5) of D: place, body, rows, first row, 1 if its body is a hub.
        targets: (t, 6) of K: place, rows, columns, first and last+1 contribution, kind (see below).
        contributions: (c, 2) places in D of the two factors.
        nodes: (n + 1, 6) rows, first row, place of the diagonal block, sign, first column entry,
            first update.
        columns: (k, 3) blocks below the diagonal: place in K, first row, rows.
        updates: (u, 6) place of left and right factor and of the target in K, rows, columns, 1 on
            the diagonal.
        hubs: (h, 2) body and first row of each body that waits.
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

    @property
    def fill(self) -> int:
        """Blocks of K that are zero before the factorisation."""
        first, last, kind = self.targets[:, 3], self.targets[:, 4], self.targets[:, 5]
        return int(np.sum((kind == PRODUCTS) & (first == last)))


#: Kinds of a target: off-diagonal sum of products, diagonal sum of products, copy of a block of D
#: by rows or transposed, identity.
PRODUCTS, DIAGONAL, COPY, TRANSPOSE, IDENTITY = range(5)


def make_plan(
    body_count: int, joint_slots: Sequence[tuple[int, ...]], joint_rows: Sequence[int]
) -> Plan:
    """Find the elimination program of a model's sparsity.

    Args:
        body_count: bodies without ground, numbered from 1.
        joint_slots: bodies of each joint by slot, ground 0.
        joint_rows: rows of each joint.
    """
    found = order_nodes(body_count, joint_slots, joint_rows)
    node_count = len(found.nodes)
    sizes = [6 if k >= node_count else found.nodes[k].rows for k in found.order]
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64).tolist()
    place = {node: k for k, node in enumerate(found.order)}
    hubs = {b: node_count + h for h, b in enumerate(found.hubs)}

    blocks, block_of, joint_row, joint_block, block_size = _lay_blocks(
        found, joint_slots, joint_rows, place, starts, hubs
    )
    diagonal, column_of, columns, column_start, matrix_size = _lay_matrix(found, sizes, starts)
    targets, contributions = _targets(found, sizes, place, diagonal, column_of, block_of)
    updates, update_start = _updates(found, sizes, diagonal, column_of)
    signs = [1 if k >= node_count else -1 for k in found.order]
    begins = zip(starts[:-1], diagonal, signs, column_start[:-1], update_start[:-1], strict=True)
    nodes = [(size, *begin) for size, begin in zip(sizes, begins, strict=True)]
    nodes.append((0, starts[-1], matrix_size, 0, column_start[-1], update_start[-1]))
    hub_rows = [(b, starts[place[hubs[b]]]) for b in found.hubs]
    return Plan(
        ordering=found,
        joint_row=np.array(joint_row, dtype=np.int64),
        joint_block=tuple(joint_block),
        row_size=starts[-1],
        block_size=block_size,
        matrix_size=matrix_size,
        blocks=_table(blocks, 5),
        targets=targets,
        contributions=contributions,
        nodes=_table(nodes, 6),
        columns=_table(columns, 3),
        updates=updates,
        hubs=_table(hub_rows, 2),
    )


def _table(rows: Sequence[Sequence[int]], width: int) -> Integers:
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


def _lay_matrix(
    found: Ordering, sizes: Sequence[int], starts: Sequence[int]
) -> tuple[list[int], list[dict[int, int]], list[tuple[int, ...]], list[int], int]:
    """Places of the blocks of K: column by column, the diagonal block first."""
    diagonal: list[int] = []
    column_of: list[dict[int, int]] = []
    columns: list[tuple[int, ...]] = []
    column_start = [0]
    size = 0
    for k, below in enumerate(found.below):
        diagonal.append(size)
        size += sizes[k] * sizes[k]
        places = {}
        for m in below:
            places[m] = size
            columns.append((size, starts[m], sizes[m]))
            size += sizes[m] * sizes[k]
        column_of.append(places)
        column_start.append(len(columns))
    return diagonal, column_of, columns, column_start, size


def _targets(
    found: Ordering,
    sizes: Sequence[int],
    place: dict[int, int],
    diagonal: Sequence[int],
    column_of: Sequence[dict[int, int]],
    block_of: dict[tuple[int, int], int],
) -> tuple[Integers, Integers]:
    """What each block of K is made of before the factorisation."""
    node_count = len(found.nodes)
    products: dict[int, list[tuple[int, int]]] = {}
    of_body: dict[int, list[int]] = {}
    for k, node in enumerate(found.nodes):
        for b in node.bodies:
            of_body.setdefault(b, []).append(k)
    for b in found.early:
        at = sorted((place[k], block_of[k, b]) for k in of_body.get(b, ()))
        for n, (column, right) in enumerate(at):
            products.setdefault(diagonal[column], []).append((right, right))
            for row, left in at[n + 1 :]:
                products.setdefault(column_of[column][row], []).append((left, right))
    targets: list[tuple[int, ...]] = []
    contributions: list[tuple[int, int]] = []

    def add(
        where: int, rows: int, cols: int, kind: int, made_of: Sequence[tuple[int, int]]
    ) -> None:
        first = len(contributions)
        contributions.extend(made_of)
        targets.append((where, rows, cols, first, len(contributions), kind))

    for column, entry in enumerate(found.order):
        m = sizes[column]
        is_hub = entry >= node_count
        kind = IDENTITY if is_hub else DIAGONAL
        add(diagonal[column], m, m, kind, () if is_hub else products.get(diagonal[column], ()))
        for row, where in column_of[column].items():
            other = found.order[row]
            if is_hub != (other >= node_count):
                joint, hub = (other, entry) if is_hub else (entry, other)
                block = block_of.get((joint, found.hubs[hub - node_count]))
                if block is not None:
                    add(where, sizes[row], m, COPY if is_hub else TRANSPOSE, [(block, block)])
                    continue
            add(where, sizes[row], m, PRODUCTS, products.get(where, ()))
    return _table(targets, 6), _table(contributions, 2)


def _updates(
    found: Ordering,
    sizes: Sequence[int],
    diagonal: Sequence[int],
    column_of: Sequence[dict[int, int]],
) -> tuple[Integers, list[int]]:
    """Products that the elimination of each node subtracts from later blocks."""
    updates: list[tuple[int, ...]] = []
    starts = [0]
    for k, below in enumerate(found.below):
        mine = column_of[k]
        for n, right in enumerate(below):
            here = mine[right]
            updates.append((here, here, diagonal[right], sizes[right], sizes[right], 1))
            later = column_of[right]
            updates.extend(
                (mine[left], here, later[left], sizes[left], sizes[right], 0)
                for left in below[n + 1 :]
            )
        starts.append(len(updates))
    return _table(updates, 6), starts
