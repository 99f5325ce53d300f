"""Dense equations: least solutions where rows may depend on each other, and a small inverse.

Least solutions by Householder reflections with exchanges of columns, and then from the right for
those that are left over (Golub, Van Loan, Matrix Computations, 5.5): of all x that leave the least
of A x - b the shortest, as by singular values. Matrices may be larger than what is used of them.
"""

# mypy: disable-error-code="no-any-return"

import math

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def factor_least(
    A: Floats, m: int, n: int, part: float, least: float, w: Floats, order: Integers
) -> int:
    """Factor the first m rows and n columns of A in place; their rank.

    Args:
        A: (m, n) or larger.
        part, least: columns depend on others where no more than this part of the longest is left
            of each, or no more than ``least``.
        w: (3, n) or larger, numbers of the reflections; the last row is scratch.
        order: (n,) the columns as they were exchanged.
    """
    rank, cut = 0, least
    for c in range(n):
        order[c] = c
    for k in range(min(m, n)):
        best, largest = longest_column(A, k, m, n, w[2])
        cut = max(cut, part * largest) if k == 0 else cut
        if not largest > cut:
            break
        if best != k:
            order[k], order[best] = order[best], order[k]
            for r in range(m):
                A[r, k], A[r, best] = A[r, best], A[r, k]
        end = -largest if A[k, k] > 0.0 else largest
        w[0, k], scale = (end - A[k, k]) / end, 1.0 / (A[k, k] - end)
        reflect(A, k, m, n, scale, w)
        A[k, k] = end
        rank = k + 1
    if rank < n:
        fold(A, rank, n, w)
    return rank


@compiled
def longest_column(A: Floats, k: int, m: int, n: int, square: Floats) -> tuple[int, float]:
    """The column that is the longest from row k on, and its length."""
    for c in range(k, n):
        square[c] = 0.0
    for r in range(k, m):
        row = A[r]
        for c in range(k, n):
            square[c] += row[c] * row[c]
    best = k
    for c in range(k + 1, n):
        best = c if square[c] > square[best] else best
    return best, math.sqrt(square[best])


@compiled
def reflect(A: Floats, k: int, m: int, n: int, scale: float, w: Floats) -> None:
    """Reflect the columns behind k by that of k, which is scaled."""
    s, top = w[2], A[k]
    for c in range(k + 1, n):
        s[c] = top[c]
    for r in range(k + 1, m):
        row = A[r]
        row[k] *= scale
        v = row[k]
        for c in range(k + 1, n):
            s[c] += v * row[c]
    for c in range(k + 1, n):
        s[c] *= w[0, k]
        top[c] -= s[c]
    for r in range(k + 1, m):
        row = A[r]
        v = row[k]
        for c in range(k + 1, n):
            row[c] -= v * s[c]


@compiled
def fold(A: Floats, rank: int, n: int, w: Floats) -> None:
    """Turn the columns behind the rank into those before, by reflections from the right."""
    for k in range(rank - 1, -1, -1):
        square = A[k, k] * A[k, k]
        for c in range(rank, n):
            square += A[k, c] * A[k, c]
        end = -math.sqrt(square) if A[k, k] > 0.0 else math.sqrt(square)
        w[1, k], scale = (end - A[k, k]) / end, 1.0 / (A[k, k] - end)
        A[k, k] = end
        for c in range(rank, n):
            A[k, c] *= scale
        for r in range(k):
            s = A[r, k]
            for c in range(rank, n):
                s += A[r, c] * A[k, c]
            s *= w[1, k]
            A[r, k] -= s
            for c in range(rank, n):
                A[r, c] -= s * A[k, c]


@compiled
def solve_least(
    A: Floats, m: int, n: int, rank: int, w: Floats, order: Integers, b: Floats, x: Floats
) -> None:
    """The least solution x (n,) of A x = b (m,), which is overwritten; A, w, order: its factors."""
    for k in range(rank):
        s = b[k]
        for r in range(k + 1, m):
            s += A[r, k] * b[r]
        s *= w[0, k]
        b[k] -= s
        for r in range(k + 1, m):
            b[r] -= s * A[r, k]
    for k in range(rank - 1, -1, -1):
        s = b[k]
        for c in range(k + 1, rank):
            s -= A[k, c] * b[c]
        b[k] = s / A[k, k]
    for c in range(n):
        x[order[c]] = b[c] if c < rank else 0.0
    unfold(A, n, rank, w, order, x)


@compiled
def put_null(A: Floats, n: int, rank: int, w: Floats, order: Integers, k: int, x: Floats) -> None:
    """Put vector k of an orthonormal basis of those x (n,) with A x = 0; A, w, order: factors."""
    for c in range(n):
        x[order[c]] = 1.0 if c == rank + k else 0.0
    unfold(A, n, rank, w, order, x)


@compiled
def unfold(A: Floats, n: int, rank: int, w: Floats, order: Integers, x: Floats) -> None:
    """Undo ``fold`` in x (n,)."""
    for k in range(rank if rank < n else 0):
        s = x[order[k]]
        for c in range(rank, n):
            s += A[k, c] * x[order[c]]
        s *= w[1, k]
        x[order[k]] -= s
        for c in range(rank, n):
            x[order[c]] -= s * A[k, c]


@compiled
def invert(A: Floats, count: int) -> float:
    """The inverse of a matrix, behind it in each row of A (count, 2 count), takes its place.

    Not numbers where it has none. Returns the determinant.
    """
    n, determinant = 2 * count, 1.0
    for k in range(count):
        best = k
        for r in range(k + 1, count):
            best = r if abs(A[r * n + k]) > abs(A[best * n + k]) else best
        for q in range(k, n):
            A[k * n + q], A[best * n + q] = A[best * n + q], A[k * n + q]
        pivot = A[k * n + k]
        determinant *= pivot if best == k else -pivot
        for q in range(k, n):
            A[k * n + q] /= pivot
        for r in range(count):
            w = A[r * n + k]
            for q in range(k, n):
                A[r * n + q] -= w * A[k * n + q] if r != k else 0.0
    return determinant
