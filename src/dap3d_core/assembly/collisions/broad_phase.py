"""Pairs of shapes that may touch: a grid of cells, and the few larger ones one by one."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Per cent of the shapes that fit into a cell.
FIT = 95.0


@compiled
def meet(
    i: int, j: int, centre: Floats, reach: Floats, body: Integers, pairs: Integers, count: int
) -> int:
    """Append a pair whose balls overlap, of two bodies; the count, which may be beyond the room."""
    if body[i] == body[j]:
        return count
    most, square = reach[i] + reach[j], 0.0
    for k in range(3):
        square += (centre[i, k] - centre[j, k]) * (centre[i, k] - centre[j, k])
    if square > most * most:
        return count
    if count < pairs.shape[0]:
        pairs[count, 0], pairs[count, 1] = i, j
    return count + 1


@compiled
def place_of(x: int, y: int, z: int, size: int) -> int:
    """Place of a cell in a table; cells may share it."""
    return (x * 73856093 + y * 19349663 + z * 83492791) % size


@compiled
def grid_pairs(
    small: Integers, large: Integers, cells: Integers, centre: Floats, reach: Floats,
    body: Integers, head: Integers, following: Integers, pairs: Integers,
) -> int:  # fmt: skip
    """Pairs of balls that overlap; their number, which may be beyond the room for them.

    Args:
        small, large: shapes no wider than a cell, and others.
        cells: (k, 3) of the small ones, from 1 on.
        centre, reach: (m, 3), (m,) of the balls of all, m.
        body: (m,); shapes of one body make no pairs, and those of ground ask for none.
        head, following: tables of -1, of more places than small shapes, and as many.
        pairs: (capacity, 2), an output.
    """
    count = 0
    for a in range(small.size):
        at = place_of(cells[a, 0], cells[a, 1], cells[a, 2], head.size)
        following[a] = head[at]
        head[at] = a
    for a in range(small.size):
        i = small[a]
        for near in range(27 if body[i] > 0 else 0):
            x, y, z = cells[a, 0] + near // 9 - 1, cells[a, 1] + near // 3 % 3 - 1, near % 3 - 1
            z += cells[a, 2]
            b = head[place_of(x, y, z, head.size)]
            while b >= 0:
                if cells[b, 0] == x and cells[b, 1] == y and cells[b, 2] == z:
                    j = small[b]
                    if body[j] == 0 or b > a:
                        count = meet(i, j, centre, reach, body, pairs, count)
                b = following[b]
    for a in range(large.size):
        for b in range(small.size):
            count = meet(large[a], small[b], centre, reach, body, pairs, count)
        for b in range(a + 1, large.size):
            count = meet(large[a], large[b], centre, reach, body, pairs, count)
    return count


def near_pairs(
    shapes: Integers, centre: Floats, reach: Floats, body: Integers, room: int
) -> Integers:
    """(k, 2) pairs of those of some shapes whose balls overlap, in an order that is reproducible.

    Args:
        shapes: indices, of shapes that have an end.
        centre, reach, body: of all shapes, as of ``grid_pairs``.
        room: pairs that are expected.
    """
    if len(shapes) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    own = reach[shapes]
    fit = float(np.percentile(own, FIT, method="lower"))
    small, large = shapes[own <= fit], shapes[own > fit]
    places = centre[small]
    cells = 1 + ((places - places.min(axis=0)) / (2.0 * fit)).astype(np.int64)
    while True:
        pairs = np.zeros((room, 2), dtype=np.int64)
        head, following = np.full(2 * len(small) + 1, -1), np.zeros(len(small), dtype=np.int64)
        count = grid_pairs(small, large, cells, centre, reach, body, head, following, pairs)
        if count <= room:
            return pairs[:count]
        room = count
