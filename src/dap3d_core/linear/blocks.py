"""The compiled side of the elimination program: scale, assemble, factor, solve.

Bodies are described in coordinates in which their mass matrix is the identity
(docs/decisions/0006): with M = diag(m I, J), J' = L L^T and B = A L^-T, a Jacobian block D becomes
D^ = [D_r / sqrt(m), D_w B] and a force (f, n) becomes (f / sqrt(m), B^T n). The saddle-point matrix
is then [I D^^T; D^ 0], and eliminating a body leaves -D^ D^^T between its joints.

K holds the blocks that remain, by columns of the lower triangle. The pivot of a node is L L^T for a
hub and -L L^T for a joint (its ``sign``). The diagonal of L is stored inverted.

With ``regularise`` the matrix is [I D^^T; D^ -E] with a positive diagonal E, the compliance of the
rows: it can be factored in any order, whatever the rank of D^ (Vanderbei, Symmetric quasidefinite
matrices, SIAM J. Optim. 5, 1995).
"""

import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.cache import compiled, compiled_inside
from dap3d_core.linear.plan import COPY, DIAGONAL, PRODUCTS, TRANSPOSE, Integers

Floats = NDArray[np.float64]


@compiled
def scale_blocks(blocks: Integers, D: Floats, metric: Floats) -> None:
    """Turn D into D^, in place.

    metric: (n+1, 16), with 1/sqrt(m) in column 0 and B by rows from column 7.
    """
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


@compiled
def assemble(targets: Integers, contributions: Integers, D: Floats, K: Floats) -> None:
    """Fill K before its factorisation."""
    for q in range(targets.shape[0]):
        o, m, n, kind = targets[q, 0], targets[q, 1], targets[q, 2], targets[q, 5]
        first, last = targets[q, 3], targets[q, 4]
        if kind in (DIAGONAL, PRODUCTS):
            if first == last:
                for k in range(o, o + m * n):
                    K[k] = 0.0
            for c in range(first, last):
                a, b = contributions[c, 0], contributions[c, 1]
                for r in range(m):
                    x0, x1, x2 = D[a], D[a + 1], D[a + 2]
                    x3, x4, x5 = D[a + 3], D[a + 4], D[a + 5]
                    e = b
                    for k in range(o + r * n, o + r * n + (r + 1 if kind == DIAGONAL else n)):
                        s = (x0 * D[e] + x1 * D[e + 1] + x2 * D[e + 2]
                             + x3 * D[e + 3] + x4 * D[e + 4] + x5 * D[e + 5])  # fmt: skip
                        K[k] = -s if c == first else K[k] - s
                        e += 6
                    a += 6
        elif kind == COPY:
            b = contributions[first, 0]
            for k in range(m * n):
                K[o + k] = D[b + k]
        elif kind == TRANSPOSE:
            b = contributions[first, 0]
            for r in range(m):
                for k in range(n):
                    K[o + r * n + k] = D[b + k * m + r]
        else:  # IDENTITY
            for r in range(m):
                for k in range(n):
                    K[o + r * n + k] = 1.0 if r == k else 0.0


@compiled_inside
def weigh_rows(blocks: Integers, D: Floats, part: float, compliance: Floats) -> None:
    """E of each joint row, ``part`` of the squared length of the row in D^; zero on hub rows."""
    for k in range(compliance.shape[0]):
        compliance[k] = 0.0
    for q in range(blocks.shape[0]):
        o, f = blocks[q, 0], blocks[q, 3]
        for r in range(blocks[q, 2]):
            s = 0.0
            for c in range(o, o + 6):
                s += D[c] * D[c]
            compliance[f + r] += part * s
            o += 6


@compiled
def regularise(nodes: Integers, compliance: Floats, K: Floats) -> None:
    """Subtract E from the pivots of the joints, between ``assemble`` and ``factor``."""
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        if nodes[k, 3] < 0:
            for r in range(m):
                K[d + r * (m + 1)] -= compliance[f + r]


@compiled
def factor(
    nodes: Integers, columns: Integers, updates: Integers, K: Floats, smallest: Floats, drop: bool
) -> int:
    """Factor K in place.

    Args:
        nodes, columns, updates: of the plan.
        K: filled by ``assemble``.
        smallest: (rows,) a pivot not above this is counted.
        drop: True to leave a counted row out (its unknown becomes zero). False to use it all the
            same; where it is not positive at all its unknowns become NaN.

    Returns:
        number of counted pivots.
    """
    counted = 0
    for k in range(nodes.shape[0] - 1):
        m, x, d, sign = nodes[k, 0], nodes[k, 1], nodes[k, 2], float(nodes[k, 3])
        for c in range(m):
            for r in range(c, m):
                s = sign * K[d + r * m + c]
                for t in range(c):
                    s -= K[d + r * m + t] * K[d + c * m + t]
                if r == c:
                    small = not s > smallest[x + c]
                    counted += small
                    if drop and small:
                        K[d + c * m + c] = 0.0
                    else:
                        K[d + c * m + c] = 1.0 / np.sqrt(s) if s > 0.0 else np.nan
                else:
                    K[d + r * m + c] = s * K[d + c * m + c]
        for q in range(nodes[k, 4], nodes[k + 1, 4]):
            o = columns[q, 0]
            for _ in range(columns[q, 2]):
                for c in range(m):
                    s = K[o + c]
                    for t in range(c):
                        s -= K[o + t] * K[d + c * m + t]
                    K[o + c] = s * K[d + c * m + c]
                o += m
        for q in range(nodes[k, 5], nodes[k + 1, 5]):
            a, e, o = updates[q, 0], updates[q, 1], updates[q, 2]
            rows, cols, diagonal = updates[q, 3], updates[q, 4], updates[q, 5]
            for r in range(rows):
                for c in range(r + 1 if diagonal else cols):
                    s = 0.0
                    for t in range(m):
                        s += K[a + r * m + t] * K[e + c * m + t]
                    K[o + r * cols + c] -= sign * s
    return counted


@compiled_inside
def pivot_lengths(nodes: Integers, K: Floats, smallest: Floats, lengths: Floats) -> None:
    """Square roots of the pivots, from the factors of K; of a pivot that is not positive, 0.

    Near a singular pose they go linearly through zero. Rows that nobody watches (``smallest`` is
    zero) give 1.
    """
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        for r in range(m):
            length = 1.0 / K[d + r * (m + 1)] if smallest[f + r] > 0.0 else 1.0
            lengths[f + r] = length if length > 0.0 else 0.0


@compiled_inside
def solve(nodes: Integers, columns: Integers, K: Floats, x: Floats) -> None:
    """Solve K z = x in place, with the factors of K."""
    count = nodes.shape[0] - 1
    for k in range(count):
        m, f, d, sign = nodes[k, 0], nodes[k, 1], nodes[k, 2], float(nodes[k, 3])
        for c in range(m):
            s = x[f + c]
            for t in range(c):  # x holds sign * y so far
                s -= sign * K[d + c * m + t] * x[f + t]
            x[f + c] = sign * s * K[d + c * m + c]
        for q in range(nodes[k, 4], nodes[k + 1, 4]):
            o, g = columns[q, 0], columns[q, 1]
            for r in range(columns[q, 2]):
                s = 0.0
                for t in range(m):
                    s += K[o + t] * x[f + t]
                x[g + r] -= s
                o += m
    for k in range(count - 1, -1, -1):
        m, f, d, sign = nodes[k, 0], nodes[k, 1], nodes[k, 2], float(nodes[k, 3])
        for q in range(nodes[k, 4], nodes[k + 1, 4]):
            o, g = columns[q, 0], columns[q, 1]
            for r in range(columns[q, 2]):
                s = sign * x[g + r]
                for t in range(m):
                    x[f + t] -= K[o + t] * s
                o += m
        for c in range(m - 1, -1, -1):
            s = x[f + c]
            for t in range(c + 1, m):
                s -= K[d + t * m + c] * x[f + t]
            x[f + c] = s * K[d + c * m + c]


@compiled_inside
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
    for q in range(blocks.shape[0]):
        if blocks[q, 4] == 0:
            o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
            for r in range(blocks[q, 2]):
                x[f + r] -= (D[o] * g[b] + D[o + 1] * g[b + 1] + D[o + 2] * g[b + 2]
                             + D[o + 3] * g[b + 3] + D[o + 4] * g[b + 4]
                             + D[o + 5] * g[b + 5])  # fmt: skip
                o += 6
    for q in range(hubs.shape[0]):
        for c in range(6):
            x[hubs[q, 1] + c] = g[6 * hubs[q, 0] + c]
    solve(nodes, columns, K, x)
    for q in range(blocks.shape[0]):
        if blocks[q, 4] == 0:
            o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
            for r in range(blocks[q, 2]):
                for c in range(6):
                    g[b + c] -= D[o + c] * x[f + r]
                o += 6
    for q in range(hubs.shape[0]):
        for c in range(6):
            g[6 * hubs[q, 0] + c] = x[hubs[q, 1] + c]


@compiled_inside
def add_product(blocks: Integers, D: Floats, g: Floats, residual: Floats) -> None:
    """Add D^ g to the residual, with g in scaled coordinates (6 (n+1),)."""
    for q in range(blocks.shape[0]):
        o, b, f = blocks[q, 0], 6 * blocks[q, 1], blocks[q, 3]
        for r in range(blocks[q, 2]):
            residual[f + r] += (D[o] * g[b] + D[o + 1] * g[b + 1] + D[o + 2] * g[b + 2]
                                + D[o + 3] * g[b + 3] + D[o + 4] * g[b + 4]
                                + D[o + 5] * g[b + 5])  # fmt: skip
            o += 6
