"""Groups of contacts that feel each other, and the order of their bodies in a matrix."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.integrators.moreau.arrays import StepArrays
from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def root_of(parent: Integers, b: int) -> int:
    """The least body of a group; ways to it become shorter."""
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    return b


@compiled
def find_groups(s: StepArrays) -> None:
    """Find the group of each contact; where there are joints, all are one."""
    for b in range(s.parent.size):
        s.parent[b] = b
    for c in range(s.contact_count):
        i, j = s.bodies[c, 0], s.bodies[c, 1]
        if i > 0 and j > 0:
            i, j = root_of(s.parent, i), root_of(s.parent, j)
            s.parent[max(i, j)] = min(i, j)
    for c in range(s.contact_count):
        i = s.bodies[c, 0] if s.bodies[c, 0] > 0 else s.bodies[c, 1]
        s.group[c] = root_of(s.parent, i) if s.y.size == 0 else 0


@compiled
def choose(s: StepArrays, group: int) -> None:
    """Take the contacts of a group, all for -1, and their bodies; where there are joints, all."""
    for b in range(s.place.size):
        s.place[b] = -1 if s.y.size == 0 else 0
    s.chosen_count = s.used_count = 0
    for c in range(s.contact_count):
        if group < 0 or s.group[c] == group:
            s.chosen[s.chosen_count] = c
            s.chosen_count += 1
            for side in range(2):
                s.place[s.bodies[c, side]] = 0
    s.place[0] = -1
    for b in range(1, s.place.size):
        if s.place[b] == 0:
            s.used[s.used_count] = b
            s.place[b] = s.used_count
            s.used_count += 1


@compiled
def lay_out(s: StepArrays) -> bool:
    """Lay out the matrix of a group, K; False without room."""
    size = 6 * s.used_count
    s.stride, s.shift, s.reach, s.matrix_size = size, 0, size, size * size
    if size > s.dense_size:
        s.reach = 6 * order_bodies(s) + 5
        s.stride, s.shift = 3 * s.reach, s.reach
        s.matrix_size = size * (s.stride + 1)
    return s.matrix_size <= s.K.size


@compiled
def order_bodies(s: StepArrays) -> int:
    """Order the bodies of a group so that those that feel each other are near; how near.

    Source: Cuthill, McKee, Reducing the bandwidth of sparse symmetric matrices (1969).
    """
    connect(s)
    for b in range(s.place.size):
        s.place[b] = -1
    done = 0
    for q in range(s.used_count):
        start = s.used[q]
        if s.place[start] < 0:
            end = walk(s, start, done)
            far = s.queue[end - 1]
            for k in range(done, end):
                s.place[s.queue[k]] = -1
            done = walk(s, far, done)
    widest = 0
    for q in range(done):
        s.used[q] = b = s.queue[q]
        edge = s.first_edge[b]
        while edge >= 0:
            widest = max(widest, abs(q - s.place[s.edge_end[edge]]))
            edge = s.next_edge[edge]
    return widest


@compiled
def connect(s: StepArrays) -> None:
    """List the neighbours of each body of a group; ``parent`` has their number."""
    for b in range(s.parent.size):
        s.first_edge[b], s.parent[b] = -1, 0
    count = 0
    for q in range(s.chosen_count):
        i, j = s.bodies[s.chosen[q], 0], s.bodies[s.chosen[q], 1]
        if i > 0 and j > 0:
            count = add_edge(s, i, j, add_edge(s, j, i, count))
    for k in range(s.y.size):
        for p in range(s.row_start[k], s.row_start[k + 1]):
            for q in range(s.row_start[k], s.row_start[k + 1]):
                if p != q:
                    count = add_edge(s, s.row_body[p], s.row_body[q], count)


@compiled
def add_edge(s: StepArrays, i: int, j: int, count: int) -> int:
    """Add j to the neighbours of i; the number of edges."""
    s.edge_end[count], s.next_edge[count] = j, s.first_edge[i]
    s.first_edge[i] = count
    s.parent[i] += 1
    return count + 1


@compiled
def walk(s: StepArrays, start: int, done: int) -> int:
    """Queue what is connected with a body, level by level, few neighbours first; the new length."""
    s.queue[done], s.place[start] = start, done
    at, end = done, done + 1
    while at < end:
        first, edge = end, s.first_edge[s.queue[at]]
        while edge >= 0:
            b = s.edge_end[edge]
            if s.place[b] < 0:
                s.place[b], k = 0, end
                while k > first and s.parent[s.queue[k - 1]] > s.parent[b]:
                    s.queue[k] = s.queue[k - 1]
                    k -= 1
                s.queue[k] = b
                end += 1
            edge = s.next_edge[edge]
        for k in range(first, end):
            s.place[s.queue[k]] = k
        at += 1
    return end
