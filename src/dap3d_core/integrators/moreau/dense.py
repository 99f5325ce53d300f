"""Gauss elimination of a dense or banded matrix, in one thread and in the same order everywhere."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def solve_dense(K: Floats, x: Floats) -> None:
    """Overwrite x (n,) with K^-1 x, and K (n, n) with its factors; rows are exchanged."""
    solve_banded(pointer(K), x, x.size, x.size, 0, x.size)


@compiled
def solve_banded(K: Floats, x: Floats, n: int, stride: int, shift: int, reach: int) -> None:
    """Overwrite the first n of x with K^-1 x, and K with its factors; rows are exchanged.

    Args:
        K: flat; entry (r, c) is at ``stride * r + shift + c``.
        x: n numbers at least.
        n, stride, shift: as above.
        reach: entries beside the diagonal; K has room for twice as many to the right.
    """
    for c in range(n):
        last, right, best = min(n, c + reach + 1), min(n, c + 2 * reach + 1), c
        for r in range(c + 1, last):
            if abs(K[stride * r + shift + c]) > abs(K[stride * best + shift + c]):
                best = r
        here = stride * c + shift
        pivot = K[here + c : here + right]
        if best != c:
            other = stride * best + shift
            b = K[other + c : other + right]
            for k in range(pivot.size):
                pivot[k], b[k] = b[k], pivot[k]
            x[c], x[best] = x[best], x[c]
        for r in range(c + 1, last):
            start = stride * r + shift
            row = K[start + c : start + right]
            if row[0] != 0.0:
                s = row[0] / pivot[0]
                for k in range(1, row.size):
                    row[k] -= s * pivot[k]
                x[r] -= s * x[c]
    for c in range(n - 1, -1, -1):
        s, here = x[c], stride * c + shift
        for k in range(c + 1, min(n, c + 2 * reach + 1)):
            s -= K[here + k] * x[k]
        x[c] = s / K[here + c]
