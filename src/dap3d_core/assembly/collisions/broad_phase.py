"""Pairs of shapes that may touch: sweep and prune along the axis in which shapes spread most."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def sweep(
    order: Integers, centre: Floats, reach: Floats, body: Integers, axis: int, pairs: Integers
) -> int:
    """Pairs of balls that overlap; their number, which may be beyond the room for them.

    Args:
        order: shapes by where they begin along the axis.
        centre, reach: (m, 3), (m,) of their balls, m.
        body: (m,); shapes of one body make no pairs.
        axis: 0, 1 or 2.
        pairs: (capacity, 2), an output.
    """
    count, second, third = 0, (axis + 1) % 3, (axis + 2) % 3
    for a in range(order.size):
        i = order[a]
        end = centre[i, axis] + reach[i]
        for b in range(a + 1, order.size):
            j = order[b]
            if centre[j, axis] - reach[j] > end:
                break
            most = reach[i] + reach[j]
            x, y = centre[i, second] - centre[j, second], centre[i, third] - centre[j, third]
            if abs(x) <= most and abs(y) <= most and body[i] != body[j]:
                z = centre[i, axis] - centre[j, axis]
                if x * x + y * y + z * z <= most * most:
                    if count < pairs.shape[0]:
                        pairs[count, 0], pairs[count, 1] = i, j
                    count += 1
    return count


def near_pairs(
    shapes: Integers, centre: Floats, reach: Floats, body: Integers, room: int
) -> Integers:
    """(k, 2) pairs of those of some shapes whose balls overlap, in an order that is reproducible.

    Args:
        shapes: indices, of shapes that have an end.
        centre, reach, body: of all shapes, as of ``sweep``.
        room: pairs that are expected.
    """
    if len(shapes) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    axis = int(np.argmax(np.var(centre[shapes], axis=0)))
    order = shapes[np.argsort((centre[:, axis] - reach)[shapes], kind="stable")]
    while True:
        pairs = np.zeros((room, 2), dtype=np.int64)
        count = sweep(order, centre, reach, body, axis, pairs)
        if count <= room:
            return pairs[:count]
        room = count
