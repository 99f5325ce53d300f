"""Gauss elimination of a dense matrix, in one thread and in the same order everywhere."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled


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
        for i in range(6):
            scratch[i], own[i] = own[i], 0.0
        for i in range(6):
            for k in range(6):
                own[i] += K[36 * a + 6 * i + k] * scratch[k]


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
            scratch[k], A[6 * i + k] = A[6 * i + k], 0.0
        for j in range(6):
            for k in range(6):
                A[6 * i + k] += scratch[j] * B[6 * j + k]


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
        for k in range(6):
            out[i] -= A[6 * i + k] * x[k]
