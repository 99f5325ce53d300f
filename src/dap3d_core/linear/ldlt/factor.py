"""The saddle-point matrix [I D^^T; D^ 0] by its blocks: scale, assemble, factor, multiply, solve.

Bodies are described in coordinates in which their mass matrix is the identity
(docs/decisions/0006): with M = diag(m I, J), J' = L L^T and B = A L^-T, a Jacobian block D becomes
D^ = [D_r / sqrt(m), D_w B] and a force (f, n) becomes (f / sqrt(m), B^T n). Eliminating a body
leaves -D^ D^^T between its joints.

What remains to be factored when the early bodies are gone is K, the compiled side of the
elimination program: its blocks stand by columns of the lower triangle. The pivot of a node is
L d L^T with d positive for a hub and negative for a joint (its ``sign``). In the place of the
pivot's diagonal 1/d is stored, below it L (one on its diagonal), and for a block A below the pivot
A L^-T.

Nodes of three and five rows (spherical and revolute joints) have their own code: the same lines,
put there again with the number of rows known, so that no loop remains. Panels have theirs, too
(linear/ldlt/panels.py).

With ``regularise`` the matrix is [I D^^T; D^ -E] with a positive diagonal E, the compliance of the
rows: it can be factored in any order, whatever the rank of D^ (Vanderbei, Symmetric quasidefinite
matrices, SIAM J. Optim. 5, 1995).
"""

from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where
from dap3d_core.linear.ldlt.panels import factor_panel, solve_panel_backwards, solve_panel_forwards
from dap3d_core.linear.ldlt.plan import COPY, DIAGONAL, PRODUCTS, TRANSPOSE
from dap3d_core.linear.ordering.ordering import LEAST_ROWS

#: Pivots are squares of lengths. Near a singular pose one is a hundredth in length of what it was
#: at the start, and the product of its node has fallen by as much: to LESS at least, where others
#: have grown.
SINGULAR_PIVOT_RATIO, SINGULAR_NODE_RATIO = 1e-4, 1e-2
#: Compliance of a row that is zero, as those of an open contact are: its multiplier is zero. A node
#: of three such rows is passed over.
IDLE = 1e40
#: What a row through a corner of a plate moves as a multiple of one through its middle, 1 + 3 + 3.
#: The least part of the squared length of a row that it then counts with, in passes.
CORNER, LEAST_ALIKE = 7.0, 0.125


@compiled_into
def add_rows_product(
    D: Floats, a: int, b: int, K: Floats, o: int, m: int, n: int, lower: bool, first: bool
) -> None:
    """K block (m, n) at o less the product of m rows of D at a with n rows at b, transposed.

    lower: the lower triangle alone. first: K held nothing before.
    """
    for r in range(m):
        x0, x1, x2 = D[a + 6 * r], D[a + 6 * r + 1], D[a + 6 * r + 2]
        x3, x4, x5 = D[a + 6 * r + 3], D[a + 6 * r + 4], D[a + 6 * r + 5]
        for c in range(r + 1 if lower else n):
            e = b + 6 * c
            s = (x0 * D[e] + x1 * D[e + 1] + x2 * D[e + 2]
                 + x3 * D[e + 3] + x4 * D[e + 4] + x5 * D[e + 5])  # fmt: skip
            K[o + r * n + c] = -s if first else K[o + r * n + c] - s


@compiled_into
def add_product_of(
    D: Floats, a: int, b: int, K: Floats, o: int, m: int, n: int, lower: bool, first: bool
) -> None:
    """``add_rows_product``, by sizes."""
    if m == 3 and n == 3:
        if lower:
            add_rows_product(D, a, b, K, o, 3, 3, True, first)
        else:
            add_rows_product(D, a, b, K, o, 3, 3, False, first)
    elif m == 5 and n == 5:
        if lower:
            add_rows_product(D, a, b, K, o, 5, 5, True, first)
        else:
            add_rows_product(D, a, b, K, o, 5, 5, False, first)
    else:
        add_rows_product(D, a, b, K, o, m, n, lower, first)


@compiled
def assemble(targets: Integers, contributions: Integers, D: Floats, K: Floats) -> None:
    """Fill K before its factorisation."""
    D, K = pointer(D), pointer(K)
    for q in range(targets.shape[0]):
        o, m, n, kind = targets[q, 0], targets[q, 1], targets[q, 2], targets[q, 5]
        first, last = targets[q, 3], targets[q, 4]
        if kind in (DIAGONAL, PRODUCTS):
            if first == last:
                for k in range(o, o + m * n):
                    K[k] = 0.0
            for c in range(first, last):
                a, b = contributions[c, 0], contributions[c, 1]
                add_product_of(D, a, b, K, o, m, n, kind == DIAGONAL, c == first)
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


@compiled
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
def weigh_alike(blocks: Integers, D: Floats, part: float, least: float, compliance: Floats) -> None:
    """As ``weigh_rows``, of what moves points by their directions alone, not by where these are.

    Rows that depend on each other share forces as feet of one stiffness do, wherever they stand.
    least: the part of the squared length that is left at least; less has rounding of its own.
    """
    for k in range(compliance.shape[0]):
        compliance[k] = 0.0
    for q in range(blocks.shape[0]):
        o, f = blocks[q, 0], blocks[q, 3]
        for r in range(blocks[q, 2]):
            compliance[f + r] += part * square_of_corner(D[o : o + 6], least)
            o += 6


@compiled
def square_of_corner(row: Floats, least: float) -> float:
    """The squared length of a row (6,), had it the lever of a corner; its own if it turns alone."""
    s = row[0] * row[0] + row[1] * row[1] + row[2] * row[2]
    turning = row[3] * row[3] + row[4] * row[4] + row[5] * row[5]
    return alike(s, turning, least)


@compiled
def alike(moving: float, turning: float, least: float) -> float:
    """As ``square_of_corner``, from both parts of the squared length of a row."""
    own, corner = moving + turning, CORNER * moving
    return where(
        (moving > 0.0) & (corner > least * own), corner, where(moving > 0.0, least, 1.0) * own
    )


@compiled
def regularise(nodes: Integers, compliance: Floats, K: Floats) -> None:
    """Subtract E from the pivots of the joints, between ``assemble`` and ``factor``.

    Of a row that is zero it is ``IDLE``.
    """
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        if nodes[k, 3] < 0:
            for r in range(m):
                K[d + r * (m + 1)] -= compliance[f + r] if compliance[f + r] != 0.0 else IDLE


@compiled_into
def factor_pivot(
    m: int, d: int, sign: float, K: Floats, smallest: Floats, x: int, drop: bool
) -> int:
    """L d L^T of the m rows at d; returns how many pivots were small."""
    counted = 0
    for c in range(m):
        s = K[d + c * m + c]
        small = not sign * s > smallest[x + c]
        counted += small
        inverse = 1.0 / s if sign * s > 0.0 else np.nan
        if drop and small:
            inverse = 0.0
        K[d + c * m + c] = inverse
        for r in range(c + 1, m):
            w = K[d + r * m + c]
            for t in range(c + 1, r):
                K[d + r * m + t] -= w * K[d + t * m + c]
            K[d + r * m + c] = w * inverse
            K[d + r * m + r] -= w * w * inverse
    return counted


@compiled_into
def divide_row(m: int, d: int, o: int, K: Floats) -> None:
    """One row a of m numbers at o becomes a L^-T."""
    for c in range(1, m):
        s = K[o + c]
        for t in range(c):
            s -= K[o + t] * K[d + c * m + t]
        K[o + c] = s


@compiled_into
def subtract_product(
    m: int, rows: int, cols: int, diagonal: bool, d: int, a: int, e: int, o: int, K: Floats
) -> None:
    """Subtract from the block at o what eliminates m rows at d: its rows at a, at e."""
    for r in range(rows):
        for c in range(r + 1 if diagonal else cols):
            s = K[o + r * cols + c]
            for t in range(m):
                s -= K[a + r * m + t] * K[d + t * m + t] * K[e + c * m + t]
            K[o + r * cols + c] = s


@compiled_into
def eliminate(k: int, m: int, program: Any, K: Floats, smallest: Floats, drop: bool) -> int:
    """Eliminate node k, of m rows; returns how many of its pivots were small."""
    nodes, columns, updates = program
    x, d, sign = nodes[k, 1], nodes[k, 2], float(nodes[k, 3])
    counted = factor_pivot(m, d, sign, K, smallest, x, drop)
    for q in range(nodes[k, 4], nodes[k + 1, 4]):
        o = columns[q, 0]
        for r in range(columns[q, 2]):
            divide_row(m, d, o + r * m, K)
    for q in range(nodes[k, 5], nodes[k + 1, 5]):
        a, e, o = updates[q, 0], updates[q, 1], updates[q, 2]
        rows, cols, diagonal = updates[q, 3], updates[q, 4], updates[q, 5] != 0
        if diagonal and rows == m:
            subtract_product(m, m, m, True, d, a, e, o, K)
        else:
            subtract_product(m, rows, cols, diagonal, d, a, e, o, K)
    return counted


@compiled_into
def is_idle(d: int, K: Floats) -> bool:
    """True if the three rows at d, factored, are zero: right-hand sides of theirs are as well."""
    return K[d] == -1.0 / IDLE and K[d + 4] == -1.0 / IDLE and K[d + 8] == -1.0 / IDLE


@compiled_into
def pass_over(d: int, K: Floats) -> bool:
    """Factor the three rows at d if they are zero; True if they are."""
    if K[d] == -IDLE and K[d + 4] == -IDLE and K[d + 8] == -IDLE:
        K[d] = K[d + 4] = K[d + 8] = -1.0 / IDLE
        return True
    return False


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
    K, smallest, program = pointer(K), pointer(smallest), (nodes, columns, updates)
    counted = 0
    for k in range(nodes.shape[0] - 1):
        m = nodes[k, 0]
        if m == 3:
            if not pass_over(nodes[k, 2], K):
                counted += eliminate(k, 3, program, K, smallest, drop)
        elif m == 5:
            counted += eliminate(k, 5, program, K, smallest, drop)
        elif m >= LEAST_ROWS:
            counted += factor_panel(k, program, K, smallest, drop)
        else:
            counted += eliminate(k, m, program, K, smallest, drop)
    return counted


@compiled
def have_pivots(nodes: Integers, K: Floats) -> bool:
    """True if no pivot in the factors of K is zero or has the wrong sign."""
    for k in range(nodes.shape[0] - 1):
        m, d = nodes[k, 0], nodes[k, 2]
        for r in range(m):
            pivot = K[d + r * (m + 1)]
            if pivot != pivot:
                return False
    return True


@compiled
def pivot_lengths(nodes: Integers, K: Floats, smallest: Floats, lengths: Floats) -> int:
    """Of each node the square root of its pivots' product, from the factors of K; 0 if none.

    Near a singular pose it goes linearly through zero. Each pivot is measured by ``smallest``: POOR
    of what it was at the start. Rows that nobody watches (it is zero) are left out. The single
    pivots would tell as much, but they change with the axes that rows are written in: where masses
    are very different, the small one wanders from row to row as the bodies turn, while the product
    stays.

    Returns the number of nodes with a pivot not above ``smallest`` and a product below LESS.
    """
    counted = 0
    for k in range(nodes.shape[0] - 1):
        m, f, d = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        product, small = 1.0, 0
        for r in range(m):
            if smallest[f + r] > 0.0:
                ratio = 1.0 / (abs(K[d + r * (m + 1)]) * smallest[f + r])
                small |= not ratio > 1.0
                product *= SINGULAR_PIVOT_RATIO * ratio
        if not product > SINGULAR_NODE_RATIO:
            counted += small
        lengths[k] = np.sqrt(product) if product > 0.0 else 0.0
    return counted


@compiled_into
def solve_forwards(
    k: int, m: int, nodes: Integers, columns: Integers, K: Floats, x: Floats
) -> None:
    """Forward step of node k, of m rows: updates its own unknowns and those below."""
    f, d = nodes[k, 1], nodes[k, 2]
    for c in range(1, m):
        s = x[f + c]
        for t in range(c):
            s -= K[d + c * m + t] * x[f + t]
        x[f + c] = s
    for c in range(m):
        x[f + c] *= K[d + c * m + c]
    for q in range(nodes[k, 4], nodes[k + 1, 4]):
        o, g = columns[q, 0], columns[q, 1]
        for r in range(columns[q, 2]):
            s = x[g + r]
            for t in range(m):
                s -= K[o + r * m + t] * x[f + t]
            x[g + r] = s


@compiled_into
def solve_backwards(
    k: int, m: int, nodes: Integers, columns: Integers, K: Floats, x: Floats
) -> None:
    """Backward step of node k, of m rows: updates its own unknowns by those below."""
    f, d = nodes[k, 1], nodes[k, 2]
    for q in range(nodes[k, 4], nodes[k + 1, 4]):
        o, g = columns[q, 0], columns[q, 1]
        for r in range(columns[q, 2]):
            for t in range(m):
                x[f + t] -= K[d + t * m + t] * K[o + r * m + t] * x[g + r]
    for c in range(m - 1, -1, -1):
        s = x[f + c]
        for t in range(c + 1, m):
            s -= K[d + t * m + c] * x[f + t]
        x[f + c] = s


@compiled_into
def substitute(
    k: int, nodes: Integers, columns: Integers, K: Floats, x: Floats, step: Any, panel_step: Any
) -> None:
    """A step of node k, or that of a panel, by its size; K, x: pointers."""
    m = nodes[k, 0]
    if m == 3:
        if not is_idle(nodes[k, 2], K):
            step(k, 3, nodes, columns, K, x)
    elif m == 5:
        step(k, 5, nodes, columns, K, x)
    elif m >= LEAST_ROWS:
        panel_step(k, nodes, columns, K, x)
    else:
        step(k, m, nodes, columns, K, x)


@compiled
def solve(nodes: Integers, columns: Integers, K: Floats, x: Floats) -> None:
    """Solve K z = x in place, with the factors of K."""
    K, x = pointer(K), pointer(x)
    for k in range(nodes.shape[0] - 1):
        substitute(k, nodes, columns, K, x, solve_forwards, solve_panel_forwards)
    for k in range(nodes.shape[0] - 2, -1, -1):
        substitute(k, nodes, columns, K, x, solve_backwards, solve_panel_backwards)


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
