"""The inverse of a small matrix, of the equations of normal forces."""

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import compiled


@compiled
def invert(A: Floats, count: int) -> None:
    """The inverse of a matrix, behind it in each row of A (count, 2 count), takes its place.

    Not numbers where it has none.
    """
    n = 2 * count
    for k in range(count):
        best = k
        for r in range(k + 1, count):
            best = r if abs(A[r * n + k]) > abs(A[best * n + k]) else best
        for q in range(k, n):
            A[k * n + q], A[best * n + q] = A[best * n + q], A[k * n + q]
        pivot = A[k * n + k]
        for q in range(k, n):
            A[k * n + q] /= pivot
        for r in range(count):
            w = A[r * n + k]
            for q in range(k, n):
                A[r * n + q] -= w * A[k * n + q] if r != k else 0.0
