"""Block LU of a matrix that is not symmetric, by the program of plan.py; real or complex.

Rows are exchanged within a node alone: the static order leaves every node's pivot block regular.
Inner loops run along rows, which compiled code turns into vector instructions; blocks are half
empty, so factors that are zero are passed over.
"""

from typing import Any

from dap3d_core.kernels.array_types import Integers
from dap3d_core.kernels.runtime.cache import compiled


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
