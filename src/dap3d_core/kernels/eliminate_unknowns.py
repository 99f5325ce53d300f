"""Elimination of a joint's own unknowns s: from rows C(q, s) to rows of the bodies alone.

With G = dC/ds = Q [R; 0], by Householder reflections (Golub and Van Loan, Matrix Computations,
5.2), the first rows of Q^T C = 0 are solved for s, and the others are the rows of the joint. Plain
functions of numbers, which group loops call (interface/codegen/unknowns.py).
"""

import math

from dap3d_core.kernels.scalar_math import sqrt, where

#: Newton passes from what the last accepted step predicts: 1e-2 becomes 1e-16 in three.
PASSES = 4
#: The same from a start that a kernel guesses.
PASSES_OF_ROOT = 6
#: A last pass that changes the unknowns by more, of their size and one, has not found them.
LEFT = 1e-7


def eliminate(G, columns, signs=()):
    """Columns of R, Q^T of each column, and the signs of the diagonal of R.

    G by rows; columns of as many numbers as it has rows. A sign of zero is chosen so that no digits
    are lost. Signs that stay as they were chosen at first keep Q smooth: only where a column comes
    to lie along its sign does Q turn fast.
    """
    count, unknowns = len(G), len(G[0])
    found = [[row[c] for row in G] for c in range(unknowns)] + [list(c) for c in columns]
    chosen = []
    for j in range(unknowns):
        v, rest = found[j], 0.0
        for r in range(j + 1, count):
            rest = rest + v[r] * v[r]
        sign = where(v[j] > 0.0, -1.0, 1.0)
        if signs:
            sign = where(signs[j] == 0.0, sign, signs[j])
        length = sqrt(v[j] * v[j] + rest)
        along = sign * v[j]
        near = along > 0.0  # of v_j - sign |v| digits would be lost
        first = sign * where(near, -rest / where(near, along + length, 1.0), along - length)
        square = first * first + rest
        still = square == 0.0
        factor = where(still, 0.0, 2.0 / where(still, 1.0, square))
        for y in found[j + 1 :]:
            total = first * y[j]
            for r in range(j + 1, count):
                total = total + v[r] * y[r]
            total = total * factor
            y[j] = y[j] - total * first
            for r in range(j + 1, count):
                y[r] = y[r] - total * v[r]
        v[j] = sign * length
        chosen.append(sign)
    return found[:unknowns], found[unknowns:], chosen


def back_substituted(R, y):
    """The solution x of R x = y, R by columns."""
    x = list(y[: len(R)])
    for j in reversed(range(len(R))):
        x[j] = x[j] / R[j][j]
        for r in range(j):
            x[r] = x[r] - R[j][r] * x[j]
    return tuple(x)


def least_change(G, C):
    """The change x of the unknowns of least |C + G x|, reversed."""
    R, (y,), _ = eliminate(G, (C,))
    return back_substituted(R, y)


def solved(start, C, G):
    """The unknowns of least |C|, by Gauss and Newton; C, G: functions of them."""
    s = start
    for _ in range(PASSES):
        s = tuple(a - b for a, b in zip(s, least_change(G(*s), C(*s)), strict=True))
    return s


def settled(s, C, G):
    """The same unknowns; not numbers where they are not found, which shortens a step."""
    change = size = 0.0
    for a, b in zip(s, least_change(G(*s), C(*s)), strict=True):
        change, size = change + abs(b), size + abs(a)
    doubt = 0.0 * where(change > LEFT * (1.0 + size), math.inf, 0.0)
    return tuple(a + doubt for a in s)


def root(start, C, G):
    """The unknowns at which ``C(*s)`` is zero, and the sum of changes of the last Newton pass.

    For a kernel that finds a point of a curve or a surface: ``start`` a tuple near it, ``C`` a
    function that returns as many numbers, ``G`` one that returns the rows of their derivatives. The
    rates of the unknowns follow from those of C where they are wanted (implicit function theorem).
    """
    s = _plain(start)
    for _ in range(PASSES_OF_ROOT):
        s = tuple(a - b for a, b in zip(s, least_change(_plain(G(*s)), _plain(C(*s))), strict=True))
    last = C(*s)
    constant = next((c.constant for c in last if hasattr(c, "constant")), lambda x: x)
    slopes = tuple(tuple(map(constant, row)) for row in _plain(G(*s)))
    changes, left = least_change(slopes, last), 0.0
    for b in _plain(changes):
        left = left + where(b < 0.0, -b, b)
    return tuple(constant(a) - b for a, b in zip(s, changes, strict=True)), constant(left)


def _plain(x):
    return tuple(map(_plain, x)) if isinstance(x, tuple) else getattr(x, "plain", x)
