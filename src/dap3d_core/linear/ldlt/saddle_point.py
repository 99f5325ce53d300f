"""The saddle-point matrix [I D^^T; D^ 0] by its blocks: scale them, multiply, solve.

Bodies are described in coordinates in which their mass matrix is the identity
(docs/decisions/0006): with M = diag(m I, J), J' = L L^T and B = A L^-T, a Jacobian block D becomes
D^ = [D_r / sqrt(m), D_w B] and a force (f, n) becomes (f / sqrt(m), B^T n). Eliminating a body
leaves -D^ D^^T between its joints, which linear/ldlt/factor.py factors.
"""

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.linear.ldlt.factor import solve


@compiled
def scale_blocks(blocks: Integers, D: Floats, metric: Floats) -> None:
    """Turn D into D^, in place.

    metric: (n+1, METRIC_WIDTH), with 1/sqrt(m) in column 0 and B by rows from column 7.
    """
    D = pointer(D)
    for q in range(blocks.shape[0]):
        o, b = blocks[q, 0], blocks[q, 1]
        s = metric[b, 0]
        b00, b01, b02 = metric[b, 7], metric[b, 8], metric[b, 9]
        b10, b11, b12 = metric[b, 10], metric[b, 11], metric[b, 12]
        b20, b21, b22 = metric[b, 13], metric[b, 14], metric[b, 15]
        for _ in range(blocks[q, 2]):
            D[o] *= s
            D[o + 1] *= s
            D[o + 2] *= s
            x, y, z = D[o + 3], D[o + 4], D[o + 5]
            D[o + 3] = x * b00 + y * b10 + z * b20
            D[o + 4] = x * b01 + y * b11 + z * b21
            D[o + 5] = x * b02 + y * b12 + z * b22
            o += 6


@compiled_into
def subtract_row_products(blocks: Integers, q: int, D: Floats, g: Floats, x: Floats) -> None:
    """Subtract D^ g from x, for block q."""
    o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
    g0, g1, g2, g3, g4, g5 = g[b], g[b + 1], g[b + 2], g[b + 3], g[b + 4], g[b + 5]
    for r in range(blocks[q, 2]):
        x[f + r] -= (D[o] * g0 + D[o + 1] * g1 + D[o + 2] * g2
                     + D[o + 3] * g3 + D[o + 4] * g4 + D[o + 5] * g5)  # fmt: skip
        o += 6


@compiled_into
def subtract_column_products(blocks: Integers, q: int, D: Floats, x: Floats, g: Floats) -> None:
    """Subtract D^^T x from g, for block q."""
    o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
    g0, g1, g2, g3, g4, g5 = g[b], g[b + 1], g[b + 2], g[b + 3], g[b + 4], g[b + 5]
    for r in range(f, f + blocks[q, 2]):
        g0 -= D[o] * x[r]
        g1 -= D[o + 1] * x[r]
        g2 -= D[o + 2] * x[r]
        g3 -= D[o + 3] * x[r]
        g4 -= D[o + 4] * x[r]
        g5 -= D[o + 5] * x[r]
        o += 6
    g[b], g[b + 1], g[b + 2], g[b + 3], g[b + 4], g[b + 5] = g0, g1, g2, g3, g4, g5


@compiled
def solve_saddle(
    blocks: Integers,
    hubs: Integers,
    nodes: Integers,
    columns: Integers,
    D: Floats,
    K: Floats,
    x: Floats,
    g: Floats,
) -> None:
    """Solve [I D^^T; D^ 0] (a; -lambda) = (g; x): g becomes a, and the rows of x become -lambda.

    With factors of a regularised K: [I D^^T; D^ -E] (a; -lambda) = (g; x).

    Args:
        g: (6 (n+1),) in the bodies' scaled coordinates; ground's six stay zero.
        x: (row_size,) right-hand side of the rows; the six of each hub are overwritten.
    """
    rows, D, bodies = x, pointer(D), pointer(g)
    x = pointer(x)
    for q in range(blocks.shape[0]):
        if blocks[q, 4] == 0:
            subtract_row_products(blocks, q, D, bodies, x)
    for q in range(hubs.shape[0]):
        for c in range(6):
            x[hubs[q, 1] + c] = g[6 * hubs[q, 0] + c]
    solve(nodes, columns, K, rows)
    for q in range(blocks.shape[0]):
        if blocks[q, 4] == 0:
            subtract_column_products(blocks, q, D, x, bodies)
    for q in range(hubs.shape[0]):
        for c in range(6):
            g[6 * hubs[q, 0] + c] = x[hubs[q, 1] + c]


@compiled
def add_product(blocks: Integers, D: Floats, g: Floats, residual: Floats) -> None:
    """Add D^ g to the residual, with g in scaled coordinates (6 (n+1),)."""
    for q in range(blocks.shape[0]):
        o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
        for r in range(blocks[q, 2]):
            residual[f + r] += (D[o] * g[b] + D[o + 1] * g[b + 1] + D[o + 2] * g[b + 2]
                                + D[o + 3] * g[b + 3] + D[o + 4] * g[b + 4]
                                + D[o + 5] * g[b + 5])  # fmt: skip
            o += 6
