"""Groups of contacts that feel each other, and the order of their bodies in a matrix."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.integrators.moreau.arrays import StepArrays
from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Bits of a word.
BITS = 32


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
    """Lay out the matrix of a group, K, as a square or by blocks; False without room."""
    n = s.used_count
    s.width, s.matrix_size, s.entry_count = 6 * n, 0, 0
    if 6 * n > s.dense_size:
        s.width, s.bit_size = 6, n * ((n + BITS - 1) // BITS)
        if s.bit_size > s.bits.size:
            return False
        connect(s)
        s.entry_count = order_bodies(s)
        s.matrix_size = 36 * (n + 2 * s.entry_count)
    else:
        s.matrix_size = 36 * n * n
    return s.matrix_size <= s.K.size and s.entry_count <= s.entries.size


@compiled
def connect(s: StepArrays) -> None:
    """Put which bodies of a group feel each other, as bits."""
    for k in range(s.bit_size):
        s.bits[k] = 0
    for q in range(s.chosen_count):
        i, j = s.bodies[s.chosen[q], 0], s.bodies[s.chosen[q], 1]
        if i > 0 and j > 0:
            join(s, s.place[i], s.place[j])
    for k in range(s.y.size):
        for p in range(s.row_start[k], s.row_start[k + 1]):
            for q in range(s.row_start[k], p):
                join(s, s.place[s.row_body[p]], s.place[s.row_body[q]])


@compiled
def join(s: StepArrays, i: int, j: int) -> None:
    """Set the bits of two bodies by place."""
    words = (s.used_count + BITS - 1) // BITS
    s.bits[i * words + j // BITS] |= 1 << (j % BITS)
    s.bits[j * words + i // BITS] |= 1 << (i % BITS)


@compiled
def bit_count(x: int) -> int:
    """The number of bits of a word."""
    x = x - ((x >> 1) & 0x55555555)
    x = (x & 0x33333333) + ((x >> 2) & 0x33333333)
    x = (x + (x >> 4)) & 0x0F0F0F0F
    return ((x * 0x01010101) >> 24) & 0xFF


@compiled
def order_bodies(s: StepArrays) -> int:
    """Order the bodies of a group by least degree, as they are eliminated; entries below diagonals.

    Those of column q are ``entries[entry_start[q] : entry_start[q + 1]]``, as far as there is
    room. Source: Rose, A graph-theoretic study of the numerical solution of
    sparse positive definite systems of linear equations (1972).
    """
    n, count = s.used_count, 0
    for v in range(n):
        s.parent[v] = degree_of(s, v)
        s.order[v] = -1
    for q in range(n):
        best = -1
        for v in range(n):
            if s.order[v] < 0 and (best < 0 or s.parent[v] < s.parent[best]):
                best = v
        s.order[best], s.queue[q], s.entry_start[q] = q, s.used[best], count
        count = eliminate(s, best, count)
    s.entry_start[n] = count
    for e in range(min(count, s.entries.size)):
        s.entries[e] = s.order[s.entries[e]]
    for q in range(n):
        s.used[q] = s.queue[q]
        s.place[s.used[q]] = q
    return count


@compiled
def degree_of(s: StepArrays, v: int) -> int:
    """Bodies that one feels."""
    words, found = (s.used_count + BITS - 1) // BITS, 0
    for w in range(v * words, (v + 1) * words):
        found += bit_count(s.bits[w])
    return found


@compiled
def eliminate(s: StepArrays, v: int, count: int) -> int:
    """Let the bodies that one feels feel each other in its place, and list them; the new count."""
    words, bits = (s.used_count + BITS - 1) // BITS, s.bits
    for u in range(s.used_count):
        if (bits[v * words + u // BITS] >> (u % BITS)) & 1 == 0:
            continue
        for w in range(words):
            bits[u * words + w] |= bits[v * words + w]
        for b in (u, v):
            bits[u * words + b // BITS] ^= 1 << (b % BITS)
        s.parent[u] = degree_of(s, u)
        if count < s.entries.size:
            s.entries[count] = u
        count += 1
    return count


@compiled
def block_at(s: StepArrays, p: int, q: int) -> int:
    """Where the block of bodies p and q, by place, begins in K; its rows are ``width`` apart."""
    if s.width != 6 or s.used_count == 1:
        return 6 * (p * s.width + q)
    if p == q:
        return 36 * p
    first, last = min(p, q), max(p, q)
    e = s.entry_start[first]
    while s.entries[e] != last:
        e += 1
    return 36 * (s.used_count + 2 * e + (1 if p < q else 0))
