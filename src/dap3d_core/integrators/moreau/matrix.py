"""The matrix of a pass of Newton's method for a group of contacts, and its factors.

Elimination is in one thread, and in the same order everywhere.
"""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.integrators.moreau.arrays import CONE, WHOLE, StepArrays
from dap3d_core.integrators.moreau.contact_set import DECLARED
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: Changes of slopes, over weights, that factors are kept with.
REUSED = 1e-2
#: Bits of a word.
BITS = 32


# ------------------------------------------------------------------ the order of bodies


@compiled
def lay_out(s: StepArrays, dense_size: int) -> bool:
    """Lay out the matrix of a group, K; False without room.

    dense_size: unknowns up to which it is a square; beyond that it has blocks.
    """
    n = s.used_count
    s.width, s.matrix_size, s.entry_count = 6 * n, 0, 0
    if 6 * n > dense_size:
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
    for n in range(s.row_count):
        k = s.rows[n]
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


# ------------------------------------------------------------------ entries and factors


@compiled
def is_factored(s: StepArrays, weight: float, feels: float) -> bool:
    """True if factors are those of slopes as now, near enough; else they will be."""
    same = s.factored == weight
    for q in range(s.chosen_count):
        c = s.chosen[q]
        B, old = s.B[c], s.B_factored[c]
        if s.kind[c] != CONE and B[4] + B[8] < 2.0:  # what slides feels its load
            same = False
        for k in range(9):
            same = same and abs(B[k] - old[k]) * weight <= REUSED
    if same:
        return True
    s.factored = weight if feels > 0.0 else 0.0
    for q in range(s.chosen_count):
        for k in range(9):
            s.B_factored[s.chosen[q], k] = s.B[s.chosen[q], k]
    return False


@compiled
def assemble(s: StepArrays, weight: float, feels: float) -> None:
    """Put the matrix of a Newton pass, M + J^T weight r B J + D^T weight s D.

    feels: as of ``try_pass``.
    """
    K = s.K
    zero(K[: s.matrix_size])
    for q in range(s.used_count):
        spin, m = s.spin[s.used[q]], s.mass[s.used[q]]
        start = block_at(s, q, q)
        for i in range(3):
            K[start + i * s.width + i] = m
            at = start + (3 + i) * s.width + 3
            K[at], K[at + 1], K[at + 2] = spin[3 * i], spin[3 * i + 1], spin[3 * i + 2]
    for q in range(s.chosen_count):
        c = s.chosen[q]
        for side in range(2):
            first = s.place[s.bodies[c, side]]
            if first >= 0:
                turned = s.turned
                put_turned(s.B[c], weight * s.r[c], s.J[c], 6 * side, turned)
                for other in range(2):
                    row = s.place[s.bodies[c, other]]
                    if row >= 0:
                        add_contact(s, block_at(s, row, first), s.J[c], 6 * other, turned)
        if s.under[c] >= 0 and feels > 0.0:
            add_pressed(s, c, weight)
        elif s.kind[c] != CONE and feels > 0.0:
            add_load(s, c, weight)
    for n in range(s.row_count):
        k = s.rows[n]
        for p in range(s.row_start[k], s.row_start[k + 1]):
            for q in range(s.row_start[k], s.row_start[k + 1]):
                start = block_at(s, s.place[s.row_body[p]], s.place[s.row_body[q]])
                for i in range(6):
                    at = start + i * s.width
                    part = weight * s.s[k] * s.D[p, i]
                    for j in range(6 if part != 0.0 else 0):
                        K[at + j] += part * s.D[q, j]


@compiled
def factor(s: StepArrays) -> None:
    """Overwrite K with its factors."""
    if s.width == 6 * s.used_count:
        factor_square(s.K, s.exchanged, s.width)
    else:
        factor_blocks(s.K, s.used_count, s.entry_start, s.entries, s.parent, s.turned)


@compiled
def solve_factored(s: StepArrays) -> None:
    """Overwrite ``change`` with K^-1 times it, of the bodies in the order of K."""
    if s.width == 6 * s.used_count:
        solve_square(s.K, s.exchanged, s.change, s.width)
    else:
        solve_blocks(s.K, s.change, s.used_count, s.entry_start, s.entries, s.turned)


@compiled
def add_load(s: StepArrays, c: int, weight: float) -> None:
    """Add to K that friction of a joint which slides grows with the joint's load."""
    k, z = s.key[c] - DECLARED, s.z[c]
    first, whole = s.load_row[k], z[0] if s.kind[c] == WHOLE else 0.0
    size, rim = math.sqrt(whole * whole + z[1] * z[1] + z[2] * z[2]), s.rim[c]
    if not 0.0 < rim < size:
        return
    for q in range(first, first + s.load_count[k]):
        load = s.y_free[q] + s.pull[q]
        if load < 0.0 and s.load_pushes[k] != 0:
            continue
        part = s.grip[k] * s.grip[k] * load / (rim * size) * weight * s.s[q]
        for p in range(s.row_start[q], s.row_start[q + 1]):
            for side in range(2):
                b, rows = s.bodies[c, side], s.J[c]
                if b == 0:
                    continue
                J = rows[6 * side :]
                start = block_at(s, s.place[b], s.place[s.row_body[p]])
                for i in range(6):
                    along = part * (whole * J[i] + z[1] * J[12 + i] + z[2] * J[24 + i])
                    at = start + i * s.width
                    for j in range(6):
                        s.K[at + j] += along * s.D[p, j]


@compiled
def add_pressed(s: StepArrays, c: int, weight: float) -> None:
    """Add to K that what resists rolling grows with what presses, where it yields."""
    u, z, J = s.under[c], s.z[c], s.J[c]
    size = math.sqrt(z[1] * z[1] + z[2] * z[2])
    if not 0.0 < s.rim[c] < size:
        return
    part = weight * s.r[u] / size
    for side in range(2):
        row = s.place[s.bodies[c, side]]
        for other in range(2 if row >= 0 else 0):
            column = s.place[s.bodies[u, other]]
            if column < 0:
                continue
            start, normal = block_at(s, row, column), s.J[u]
            for i in range(3, 6):
                k, at = 6 * side + i, start + i * s.width
                along = part * (z[1] * J[12 + k] + z[2] * J[24 + k])
                for j in range(6):
                    s.K[at + j] += along * normal[6 * other + j]


@compiled
def put_turned(B: Floats, weight: float, J: Floats, side: int, out: Floats) -> None:
    """Put weight B J of the columns of one body, (18,)."""
    for k in range(6):
        a, b, c = weight * J[side + k], weight * J[12 + side + k], weight * J[24 + side + k]
        out[k] = B[0] * a + B[1] * b + B[2] * c
        out[6 + k] = B[3] * a + B[4] * b + B[5] * c
        out[12 + k] = B[6] * a + B[7] * b + B[8] * c


@compiled
def add_contact(s: StepArrays, start: int, J: Floats, side: int, turned: Floats) -> None:
    """Add J^T of one body times ``turned`` of another one to their block of K."""
    K = s.K
    for i in range(6):
        a, b, c = J[side + i], J[12 + side + i], J[24 + side + i]
        at = start + i * s.width
        for k in range(6):
            K[at + k] += a * turned[k] + b * turned[6 + k] + c * turned[12 + k]


@compiled
def factor_square(K: Floats, exchanged: Integers, n: int) -> None:
    """Overwrite a flat matrix K (n n,) with its factors; exchanged: (n,) row taken for each."""
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(K[n * r + c]) > abs(K[n * best + c]):
                best = r
        exchanged[c], pivot = best, K[n * c + c : n * c + n]
        if best != c:
            other = K[n * best + c : n * best + n]
            for k in range(pivot.size):
                pivot[k], other[k] = other[k], pivot[k]
        for r in range(c + 1, n):
            row = K[n * r + c : n * r + n]
            if row[0] != 0.0:
                s = row[0] / pivot[0]
                row[0] = s
                for k in range(1, row.size):
                    row[k] -= s * pivot[k]


@compiled
def solve_square(K: Floats, exchanged: Integers, x: Floats, n: int) -> None:
    """Overwrite the first n of x with K^-1 x, by what ``factor_square`` has left."""
    for c in range(n):
        best = exchanged[c]
        x[c], x[best] = x[best], x[c]
        for r in range(c + 1, n):
            x[r] -= K[n * r + c] * x[c]
    for c in range(n - 1, -1, -1):
        s = x[c]
        for k in range(c + 1, n):
            s -= K[n * c + k] * x[k]
        x[c] = s / K[n * c + c]


@compiled
def factor_blocks(
    K: Floats, n: int, start: Integers, entries: Integers, at: Integers, scratch: Floats
) -> None:
    """Overwrite K with its factors, by blocks of 6 x 6.

    Rows are exchanged within blocks alone, so that what is zero stays so.

    Args:
        K: n blocks of the diagonal, and for each entry its block below the diagonal and that above.
        n: columns of blocks.
        start, entries: those of column a below the diagonal are in the rows
            ``entries[start[a] : start[a + 1]]``, all that elimination fills.
        at: (n,) scratch.
        scratch: (36,).
    """
    for a in range(n):
        invert(K[36 * a : 36 * a + 36], scratch)
        for e in range(start[a], start[a + 1]):
            multiply(K[36 * (n + 2 * e) :], K[36 * a :], scratch)
        for e in range(start[a], start[a + 1]):
            b, low = entries[e], K[36 * (n + 2 * e) :]
            high = K[36 * (n + 2 * e + 1) :]
            take(low, high, K[36 * b :])
            for f in range(start[b], start[b + 1]):
                at[entries[f]] = f
            for f in range(start[a], start[a + 1]):
                if entries[f] > b:
                    to = n + 2 * at[entries[f]]
                    take(K[36 * (n + 2 * f) :], high, K[36 * to :])
                    take(low, K[36 * (n + 2 * f + 1) :], K[36 * (to + 1) :])


@compiled
def solve_blocks(
    K: Floats, x: Floats, n: int, start: Integers, entries: Integers, scratch: Floats
) -> None:
    """Overwrite x (6 n,) with K^-1 x, by what ``factor_blocks`` has left; the others as there."""
    for a in range(n):
        for e in range(start[a], start[a + 1]):
            take_from(K[36 * (n + 2 * e) :], x[6 * a :], x[6 * entries[e] :])
    for a in range(n - 1, -1, -1):
        own = x[6 * a :]
        for e in range(start[a], start[a + 1]):
            take_from(K[36 * (n + 2 * e + 1) :], x[6 * entries[e] :], own)
        copy(scratch[:6], own[:6])
        for i in range(6):
            total = 0.0
            for k in range(6):
                total += K[36 * a + 6 * i + k] * scratch[k]
            own[i] = total


@compiled
def invert(A: Floats, exchanged: Floats) -> None:
    """Overwrite A (36,) with its inverse, by exchanges of rows; exchanged: (6,) scratch."""
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(A[6 * r + c]) > abs(A[6 * best + c]):
                best = r
        exchanged[c] = best
        pivot = 1.0 / A[6 * best + c]
        A[6 * best + c] = 1.0
        for k in range(6):
            A[6 * best + k], A[6 * c + k] = A[6 * c + k], pivot * A[6 * best + k]
        for r in range(6):
            if r != c:
                s, A[6 * r + c] = A[6 * r + c], 0.0
                for k in range(6):
                    A[6 * r + k] -= s * A[6 * c + k]
    for c in range(5, -1, -1):
        best = int(exchanged[c])
        if best != c:
            for r in range(6):
                A[6 * r + c], A[6 * r + best] = A[6 * r + best], A[6 * r + c]


@compiled
def multiply(A: Floats, B: Floats, scratch: Floats) -> None:
    """Overwrite a block A with A B."""
    for i in range(6):
        for k in range(6):
            scratch[k] = A[6 * i + k]
        for k in range(6):
            total = 0.0
            for j in range(6):
                total += scratch[j] * B[6 * j + k]
            A[6 * i + k] = total


@compiled
def take(A: Floats, B: Floats, out: Floats) -> None:
    """Take A B from a block."""
    for i in range(6):
        a, b, c, d, e, f = (
            A[6 * i],
            A[6 * i + 1],
            A[6 * i + 2],
            A[6 * i + 3],
            A[6 * i + 4],
            A[6 * i + 5],
        )
        for k in range(6):
            out[6 * i + k] -= (
                (a * B[k] + b * B[6 + k])
                + (c * B[12 + k] + d * B[18 + k])
                + (e * B[24 + k] + f * B[30 + k])
            )


@compiled
def take_from(A: Floats, x: Floats, out: Floats) -> None:
    """Take A x from six numbers."""
    for i in range(6):
        left = out[i]
        for k in range(6):
            left -= A[6 * i + k] * x[k]
        out[i] = left
