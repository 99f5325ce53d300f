"""Panels: nodes of many rows, which loops in nets leave behind (ordering/ordering.py).

Written for throughput: inner loops hold four by four sums in registers, so that each number loaded
serves four products. Factors are stored as those of small nodes (factor.py), but while a panel is
factored they are those of Cholesky, with inverse diagonal: products then need no third factor.
"""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled, compiled_into


@compiled
def factor_panel(k: int, program: Any, K: Floats, smallest: Floats, drop: bool) -> int:
    """Gather, factor and apply node k, a panel; its small pivots. Arguments as of ``factor``.

    Its rows stand one after another in K, m numbers each, the diagonal block first.
    """
    nodes, columns, updates = program
    m, x, d, sign = nodes[k, 0], nodes[k, 1], nodes[k, 2], float(nodes[k, 3])
    q, last = nodes[k, 5], nodes[k + 1, 5]
    while q < last and updates[q, 5] < 0:
        gather(updates[q, 0], updates[q, 2], updates[q, 3], updates[q, 4], -updates[q, 5], K)
        q += 1
    counted = factor_diagonal(m, x, d, sign, K, smallest, drop)
    rows = 0
    for p in range(nodes[k, 4], nodes[k + 1, 4]):
        rows += columns[p, 2]
    divide(d + m * m, rows, m, d, K)
    while q < last:
        subtract(updates[q], m, sign, K)
        q += 1
    store(m, rows, d, sign, K)
    return counted


@compiled
def store(m: int, rows: int, d: int, sign: float, K: Floats) -> None:
    """From sign L L^T with inverse diagonal to L d L^T, and the rows below from A L^-T of the one
    to that of the other.
    """
    for c in range(m):
        inverse = K[d + c * m + c]
        length = 1.0 / inverse if inverse != 0.0 else 0.0
        for r in range(c + 1, m):
            K[d + r * m + c] *= inverse
        for r in range(m, m + rows):
            K[d + r * m + c] *= length
        K[d + c * m + c] = sign * inverse * inverse


@compiled
def gather(source: int, target: int, rows: int, cols: int, flag: int, K: Floats) -> None:
    """Add a block of its own (rows x cols) to its place in a panel; of a diagonal one the lower
    triangle. flag: 2 * (numbers in a row of the panel) + (1 on the diagonal).
    """
    stride, diagonal = flag >> 1, flag & 1
    for r in range(rows):
        for c in range(r + 1 if diagonal else cols):
            K[target + r * stride + c] += K[source + r * cols + c]


@compiled_into
def four_products(
    K: Floats, o: int, m: int, x: Floats, f: int, n: int
) -> tuple[float, float, float, float]:
    """Products of four rows at o, m numbers each, with x from f on, of their first n numbers."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for t in range(n):
        b = x[f + t]
        s0 += K[o + t] * b
        s1 += K[o + m + t] * b
        s2 += K[o + 2 * m + t] * b
        s3 += K[o + 3 * m + t] * b
    return s0, s1, s2, s3


@compiled
def factor_diagonal(
    m: int, x: int, d: int, sign: float, K: Floats, smallest: Floats, drop: bool
) -> int:
    """Cholesky factors of sign times the block of m rows at d, four rows at a time."""
    counted = 0
    for c in range(m):
        i = d + c * m
        s = sign * K[i + c]
        for t in range(c):
            s -= K[i + t] * K[i + t]
        small = not s > smallest[x + c]
        counted += small
        inverse = 1.0 / np.sqrt(s) if s > 0.0 else np.nan
        if drop and small:
            inverse = 0.0
        K[i + c] = inverse
        r = c + 1
        while r + 3 < m:
            o = d + r * m
            s0, s1, s2, s3 = four_products(K, o, m, K, i, c)
            K[o + c] = (sign * K[o + c] - s0) * inverse
            K[o + m + c] = (sign * K[o + m + c] - s1) * inverse
            K[o + 2 * m + c] = (sign * K[o + 2 * m + c] - s2) * inverse
            K[o + 3 * m + c] = (sign * K[o + 3 * m + c] - s3) * inverse
            r += 4
        while r < m:
            o = d + r * m
            s = 0.0
            for t in range(c):
                s += K[o + t] * K[i + t]
            K[o + c] = (sign * K[o + c] - s) * inverse
            r += 1
    return counted


@compiled
def divide(o: int, rows: int, m: int, d: int, K: Floats) -> None:
    """Solve X L^T = B in place for the rows at o, with the factors of the block at d."""
    r = 0
    while r + 3 < rows:
        for c in range(m):
            i = d + c * m
            s0, s1, s2, s3 = four_products(K, o, m, K, i, c)
            b = K[i + c]
            K[o + c] = (K[o + c] - s0) * b
            K[o + m + c] = (K[o + m + c] - s1) * b
            K[o + 2 * m + c] = (K[o + 2 * m + c] - s2) * b
            K[o + 3 * m + c] = (K[o + 3 * m + c] - s3) * b
        o += 4 * m
        r += 4
    while r < rows:
        for c in range(m):
            i = d + c * m
            s = 0.0
            for t in range(c):
                s += K[o + t] * K[i + t]
            K[o + c] = (K[o + c] - s) * K[i + c]
        o += m
        r += 1


@compiled
def subtract(update: Integers, m: int, sign: float, K: Floats) -> None:
    """Subtract sign A B^T from the target; of a diagonal one the lower triangle.

    update: places of A, of m columns, of B and of the target; its rows and columns; and, as of
    ``gather``, a flag with the numbers from row to row of the target (0: its columns).
    """
    a, b, target, rows, cols = update[0], update[1], update[2], update[3], update[4]
    stride, diagonal = update[5] >> 1, update[5] & 1
    if stride == 0:
        stride = cols
    r = 0
    while r < rows:
        height = min(4, rows - r)
        end = min(cols, r + height) if diagonal else cols
        c = 0
        while c < end:
            width = min(4, end - c)
            o = target + r * stride + c
            if height == 4 and width == 4 and not (diagonal and c + 3 > r):
                tile(a + r * m, b + c * m, o, m, stride, sign, K)
            else:
                for i in range(height):
                    for j in range(width):
                        if not (diagonal and c + j > r + i):
                            s = 0.0
                            p, e = a + (r + i) * m, b + (c + j) * m
                            for t in range(m):
                                s += K[p + t] * K[e + t]
                            K[o + i * stride + j] -= sign * s
            c += 4
        r += 4


@compiled
def tile(a: int, b: int, o: int, m: int, stride: int, sign: float, K: Floats) -> None:
    """Four rows by four columns of ``subtract``."""
    s00, s01, s02, s03 = 0.0, 0.0, 0.0, 0.0
    s10, s11, s12, s13 = 0.0, 0.0, 0.0, 0.0
    s20, s21, s22, s23 = 0.0, 0.0, 0.0, 0.0
    s30, s31, s32, s33 = 0.0, 0.0, 0.0, 0.0
    for t in range(m):
        a0, a1, a2, a3 = K[a + t], K[a + m + t], K[a + 2 * m + t], K[a + 3 * m + t]
        b0, b1, b2, b3 = K[b + t], K[b + m + t], K[b + 2 * m + t], K[b + 3 * m + t]
        s00, s01, s02, s03 = s00 + a0 * b0, s01 + a0 * b1, s02 + a0 * b2, s03 + a0 * b3
        s10, s11, s12, s13 = s10 + a1 * b0, s11 + a1 * b1, s12 + a1 * b2, s13 + a1 * b3
        s20, s21, s22, s23 = s20 + a2 * b0, s21 + a2 * b1, s22 + a2 * b2, s23 + a2 * b3
        s30, s31, s32, s33 = s30 + a3 * b0, s31 + a3 * b1, s32 + a3 * b2, s33 + a3 * b3
    o1, o2, o3 = o + stride, o + 2 * stride, o + 3 * stride
    K[o] -= sign * s00
    K[o + 1] -= sign * s01
    K[o + 2] -= sign * s02
    K[o + 3] -= sign * s03
    K[o1] -= sign * s10
    K[o1 + 1] -= sign * s11
    K[o1 + 2] -= sign * s12
    K[o1 + 3] -= sign * s13
    K[o2] -= sign * s20
    K[o2 + 1] -= sign * s21
    K[o2 + 2] -= sign * s22
    K[o2 + 3] -= sign * s23
    K[o3] -= sign * s30
    K[o3 + 1] -= sign * s31
    K[o3 + 2] -= sign * s32
    K[o3 + 3] -= sign * s33


@compiled
def solve_panel_forwards(k: int, nodes: Integers, columns: Integers, K: Floats, x: Floats) -> None:
    """Forward step of node k: updates its own unknowns and those below."""
    m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
    for c in range(1, m):
        s = 0.0
        for t in range(c):
            s += K[d + c * m + t] * x[f + t]
        x[f + c] -= s
    for c in range(m):
        x[f + c] *= K[d + c * m + c]
    for q in range(nodes[k, 4], nodes[k + 1, 4]):
        o, g, last = columns[q, 0], columns[q, 1], columns[q, 1] + columns[q, 2]
        while g + 3 < last:
            s0, s1, s2, s3 = four_products(K, o, m, x, f, m)
            x[g] -= s0
            x[g + 1] -= s1
            x[g + 2] -= s2
            x[g + 3] -= s3
            o += 4 * m
            g += 4
        while g < last:
            s = 0.0
            for t in range(m):
                s += K[o + t] * x[f + t]
            x[g] -= s
            o += m
            g += 1


@compiled
def solve_panel_backwards(k: int, nodes: Integers, columns: Integers, K: Floats, x: Floats) -> None:
    """Backward step of node k: updates its own unknowns by those below."""
    m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
    for c in range(m):
        inverse = K[d + c * m + c]
        x[f + c] = x[f + c] / inverse if inverse != 0.0 else 0.0
    for q in range(nodes[k, 4], nodes[k + 1, 4]):
        o, g, last = columns[q, 0], columns[q, 1], columns[q, 1] + columns[q, 2]
        while g + 3 < last:
            a0, a1, a2, a3 = x[g], x[g + 1], x[g + 2], x[g + 3]
            for t in range(m):
                x[f + t] -= (K[o + t] * a0 + K[o + m + t] * a1 + K[o + 2 * m + t] * a2
                             + K[o + 3 * m + t] * a3)  # fmt: skip
            o += 4 * m
            g += 4
        while g < last:
            for t in range(m):
                x[f + t] -= K[o + t] * x[g]
            o += m
            g += 1
    for c in range(m):
        x[f + c] *= K[d + c * m + c]
    for c in range(m - 1, -1, -1):
        for t in range(c):
            x[f + t] -= K[d + c * m + t] * x[f + c]
