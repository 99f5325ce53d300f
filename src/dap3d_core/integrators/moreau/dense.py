"""Gauss elimination of a dense matrix, in one thread and in the same order everywhere."""

# An element of an array, and what a compiled function returns, is Any to mypy.
# mypy: disable-error-code="no-any-return"

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def solve_dense(K: Floats, x: Floats) -> None:
    """Overwrite x (n,) with K^-1 x, and K (n, n) with its factors; rows are exchanged."""
    n = x.size
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(K[r, c]) > abs(K[best, c]):
                best = r
        if best != c:
            a, b = K[c], K[best]
            for k in range(n):
                a[k], b[k] = b[k], a[k]
            x[c], x[best] = x[best], x[c]
        pivot = K[c]
        for r in range(c + 1, n):
            row = K[r]
            if row[c] != 0.0:
                s = row[c] / pivot[c]
                for k in range(c + 1, n):
                    row[k] -= s * pivot[k]
                x[r] -= s * x[c]
    for c in range(n - 1, -1, -1):
        s = x[c]
        for k in range(c + 1, n):
            s -= K[c, k] * x[k]
        x[c] = s / K[c, c]
