"""Block LU of a matrix that is not symmetric, by a program of its nodes; real or complex.

Rows are exchanged within a node alone: the static order leaves every node's pivot block regular.
Inner loops run along rows, which compiled code turns into vector instructions; blocks are half
empty, so factors that are zero are passed over.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ordering.elimination_order import _eliminate, _waits
from dap3d_core.linear.ordering.ordering import JointNode

#: Unknowns of a body (position, velocity), and of a row (a multiplier of each level).
BODY_SIZE, ROW_SIZE = 12, 2


@compiled
def factor_diagonal(m: int, d: int, first: int, K: Any, pivots: Integers) -> bool:
    """P K = L U of a block of m rows at d, in place; reciprocals on U's diagonal. False: singular.

    pivots[first + c] is the row that was exchanged with row c.
    """
    for c in range(m):
        best, size = c, abs(K[d + c * m + c])
        for r in range(c + 1, m):
            if abs(K[d + r * m + c]) > size:
                best, size = r, abs(K[d + r * m + c])
        if not size > 0.0:
            return False
        pivots[first + c] = best
        if best != c:
            for k in range(m):
                a, b = d + c * m + k, d + best * m + k
                K[a], K[b] = K[b], K[a]
        inverse = 1.0 / K[d + c * m + c]
        K[d + c * m + c] = inverse
        for r in range(c + 1, m):
            s = K[d + r * m + c]
            if s != 0.0:
                s *= inverse
                K[d + r * m + c] = s
                for k in range(c + 1, m):
                    K[d + r * m + k] -= s * K[d + c * m + k]
    return True


@compiled
def factor_lu(
    nodes: Integers, columns: Integers, updates: Integers, K: Any, pivots: Integers
) -> bool:
    """Factor K in place.

    Args:
        nodes, columns, updates: of the plan.
        K: (matrix_size,) real or complex.
        pivots: (size,) row exchanges, an output.

    Returns:
        False where a pivot block is singular.
    """
    for k in range(nodes.shape[0] - 1):
        m, first, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        if not factor_diagonal(m, d, first, K, pivots):
            return False
        for q in range(nodes[k, 3], nodes[k + 1, 3]):
            left, right, n = columns[q, 0], columns[q, 1], columns[q, 3]
            for c in range(m):
                best = pivots[first + c]
                if best != c:
                    for j in range(n):
                        a, b = right + c * n + j, right + best * n + j
                        K[a], K[b] = K[b], K[a]
            for c in range(m):
                for r in range(c + 1, m):
                    s = K[d + r * m + c]
                    if s != 0.0:
                        for j in range(n):
                            K[right + r * n + j] -= s * K[right + c * n + j]
            for r in range(n):
                o = left + r * m
                for c in range(m):
                    s = K[o + c]
                    if s != 0.0:
                        s *= K[d + c * m + c]
                        K[o + c] = s
                        for j in range(c + 1, m):
                            K[o + j] -= s * K[d + c * m + j]
        for q in range(nodes[k, 4], nodes[k + 1, 4]):
            left, right, target = updates[q, 0], updates[q, 1], updates[q, 2]
            rows, n = updates[q, 3], updates[q, 4]
            for r in range(rows):
                o = target + r * n
                for c in range(m):
                    s = K[left + r * m + c]
                    if s != 0.0:
                        e = right + c * n
                        for j in range(n):
                            K[o + j] -= s * K[e + j]
    return True


@compiled
def solve_lu(nodes: Integers, columns: Integers, K: Any, pivots: Integers, x: Any) -> None:
    """Solve K z = x in place, with the factors of K."""
    count = nodes.shape[0] - 1
    for k in range(count):
        m, first, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for c in range(m):
            best = first + pivots[first + c]
            x[first + c], x[best] = x[best], x[first + c]
        for r in range(1, m):
            s = x[first + r]
            for c in range(r):
                s -= K[d + r * m + c] * x[first + c]
            x[first + r] = s
        for q in range(nodes[k, 3], nodes[k + 1, 3]):
            o, g = columns[q, 0], columns[q, 2]
            for r in range(columns[q, 3]):
                s = x[g + r]
                for c in range(m):
                    s -= K[o + c] * x[first + c]
                x[g + r] = s
                o += m
    for k in range(count - 1, -1, -1):
        m, first, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for q in range(nodes[k, 3], nodes[k + 1, 3]):
            o, g, n = columns[q, 1], columns[q, 2], columns[q, 3]
            for r in range(m):
                s = x[first + r]
                for c in range(n):
                    s -= K[o + c] * x[g + c]
                x[first + r] = s
                o += n
        for r in range(m - 1, -1, -1):
            s = x[first + r]
            for c in range(r + 1, m):
                s -= K[d + r * m + c] * x[first + c]
            x[first + r] = s * K[d + r * m + r]


@attrs.frozen(eq=False)
class LuPlan:
    """Arrays of the program; all entries are indices into flat arrays.

    Attributes:
        size: number of unknowns.
        matrix_size: length of the matrix's array, its blocks by rows.
        nodes: (n + 1, 5) unknowns, first unknown, place of the diagonal block, first column entry,
            first update; in the order of elimination.
        columns: (k, 4) neighbours eliminated later: place of the block below the diagonal, of the
            one to its right, first unknown, unknowns.
        updates: (u, 5) place of left and right factor and of the target, rows, columns.
        body_first, joint_first, element_first: (bodies + 1,), (joint nodes,), (elements with
            states,) first unknown.
        fill: blocks that are zero before the factorisation.
        place: (a, b) -> place of the block of rows of node a and columns of node b. Nodes are joint
            nodes, then bodies, then elements with states.
    """

    size: int
    matrix_size: int
    nodes: Integers
    columns: Integers
    updates: Integers
    body_first: Integers
    joint_first: Integers
    element_first: Integers
    fill: int
    place: dict[tuple[int, int], int]

    def body(self, b: int) -> int:
        """The node of body b (from 1)."""
        return len(self.joint_first) + b - 1

    def element(self, e: int) -> int:
        """The node of the states of element e."""
        return self.body(len(self.body_first) + e)


class StateNode(NamedTuple):
    """States of an element: how many, the bodies it acts on, and its joint node; -1 for none."""

    size: int
    bodies: tuple[int, ...]
    joint: int = -1


def make_lu_plan(
    body_count: int,
    nodes: Sequence[JointNode],
    coupled: Iterable[tuple[int, ...]],
    elements: Sequence[StateNode] = (),
    reading: Iterable[tuple[int, int]] = (),
) -> LuPlan:
    """Find the elimination program.

    Args:
        body_count: bodies without ground, numbered from 1.
        nodes: joint nodes, as ordering/elimination_order.py merges joints.
        coupled: bodies of each element that couples them directly, ground (0) allowed.
        elements: those with states of their own.
        reading: joint nodes, and bodies on which an element acts that reads their multipliers.
    """
    joints = len(nodes)
    sizes = [ROW_SIZE * node.rows for node in nodes] + [BODY_SIZE] * body_count
    sizes += [element.size for element in elements]
    neighbours: list[set[int]] = [set() for _ in sizes]
    of_body: list[list[int]] = [[] for _ in range(body_count + 1)]
    for k, node in enumerate(nodes):
        for b in node.bodies:
            of_body[b].append(k)
            neighbours[k].add(joints + b - 1)
            neighbours[joints + b - 1].add(k)
    for bodies in coupled:
        there = {joints + b - 1 for b in bodies if b}
        for a in there:
            neighbours[a] |= there - {a}
    for k, b in reading:
        neighbours[k].add(joints + b - 1)
        neighbours[joints + b - 1].add(k)
    for e, element in enumerate(elements, start=joints + body_count):
        for other in (*(joints + b - 1 for b in element.bodies if b), element.joint):
            if other >= 0:
                neighbours[e].add(other)
                neighbours[other].add(e)
    before = sum(len(others) for others in neighbours)
    waits = _waits(nodes, of_body, range(1, body_count + 1)) if nodes else {}
    order, below = _eliminate(neighbours, sizes, waits)
    return _lay_out(sizes, order, below, joints, before, len(elements))


def _lay_out(
    sizes: Sequence[int],
    order: Sequence[int],
    below: dict[int, set[int]],
    joints: int,
    before: int,
    elements: int,
) -> LuPlan:
    end = len(sizes) - elements
    rank = {node: k for k, node in enumerate(order)}
    first = [0] * len(sizes)
    place: dict[tuple[int, int], int] = {}
    size = start = 0
    for node in order:
        first[node] = start
        start += sizes[node]
    later = {node: sorted(below[node], key=rank.__getitem__) for node in order}
    for node in order:
        place[node, node] = size
        size += sizes[node] ** 2
        for other in later[node]:
            place[other, node], place[node, other] = size, size + sizes[node] * sizes[other]
            size += 2 * sizes[node] * sizes[other]
    rows: list[tuple[int, ...]] = []
    columns: list[tuple[int, ...]] = []
    updates: list[tuple[int, ...]] = []
    for node in order:
        begin = (sizes[node], first[node], place[node, node], len(columns), len(updates))
        rows.append(begin)
        for i in later[node]:
            columns.append((place[i, node], place[node, i], first[i], sizes[i]))
            updates.extend(
                (place[i, node], place[node, j], place[i, j], sizes[i], sizes[j])
                for j in later[node]
            )
    rows.append((0, start, size, len(columns), len(updates)))
    return LuPlan(
        size=start,
        matrix_size=size,
        nodes=np.array(rows, dtype=np.int64).reshape(-1, 5),
        columns=np.array(columns, dtype=np.int64).reshape(-1, 4),
        updates=np.array(updates, dtype=np.int64).reshape(-1, 5),
        body_first=np.array([0, *first[joints:end]], dtype=np.int64),
        joint_first=np.array(first[:joints], dtype=np.int64),
        element_first=np.array(first[end:], dtype=np.int64),
        fill=2 * len(columns) - before,
        place=place,
    )
