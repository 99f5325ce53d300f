"""Impulses of rows: A Lambda = b, where some push and do not pull."""

import numpy as np

from dap3d_core.assembly.evaluate import largest, zero
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled

#: A row is met where it misses its change by no more than this part of the largest one.
MISS = 1e-8
#: Of a row of unit length no freedom is left below this part of what it had without joints.
FREEDOM = 1e-11
#: A rate is zero below this part of the largest change.
ZERO = 1e-12
#: Sweeps of rotations; a few are enough (they converge quadratically).
SWEEPS = 60


@compiled
def find_impulses(
    m: int, A: Floats, x: Floats, pushes: Integers, acts: Integers, space: Floats
) -> None:
    """The impulses Lambda of the first m rows, with A Lambda = b; of those that push 0 <= Lambda.

    Where a row that pushes would have to pull, it is left alone and its rate changes by more than
    b asks for: 0 <= Lambda, 0 <= A Lambda - b, and one of both is zero (Moreau's law). Rows that
    depend on each other share their impulse, by the least sum of squares. Where the least solution
    pulls, by the active sets of Lawson and Hanson (Solving Least Squares Problems, 23); rows that
    may pull are always in them.

    Args:
        m: number of rows.
        A: (m, m) symmetric, positive semidefinite: changes of the rows' rates by unit impulses;
            for rows that have unit length in the metric of the masses.
        x: (4, m); row 0 is b, the wanted changes, row 1 becomes the impulses, the others are
            scratch.
        pushes: (m,) 1 of rows that push, 0 of others.
        acts, space: scratch, (m,) and (2, m, m).
    """
    pulls = 0
    for k in range(m):
        acts[k] = 1
    least_solution(m, A, x[0], acts, x[1], space)
    for k in range(m):
        if (pushes[k] != 0) & (x[1, k] < 0.0):
            pulls = 1
    if pulls == 0:
        return
    seek_active(m, A, x, pushes, acts, space, ZERO * largest(x[0][:m]))
    for k in range(m):
        acts[k] = 1 - pushes[k] if x[2, k] <= 0.0 else 1
    least_solution(m, A, x[0], acts, x[1], space)
    for k in range(m):
        if (pushes[k] != 0) & (x[1, k] < 0.0):
            x[1, k] = 0.0


@compiled
def seek_active(
    m: int, A: Floats, x: Floats, pushes: Integers, acts: Integers, space: Floats, least: float
) -> None:
    """The rows that act, into row 2 of x their impulses; no rate below ``least`` is missing."""
    for k in range(m):
        acts[k] = 1 - pushes[k]
        x[2, k] = 0.0
    least_solution(m, A, x[0], acts, x[2], space)
    for _ in range(10 * m):
        best, rate = -1, least
        for k in range(m):
            if acts[k] == 0:
                missing = x[0, k]
                for q in range(m):
                    missing -= A[k, q] * x[2, q]
                if missing > rate:
                    best, rate = k, missing
        if best < 0:
            break
        acts[best] = 1
        for _ in range(m):
            least_solution(m, A, x[0], acts, x[3], space)
            way, last = 1.0, -1
            for k in range(m):
                if (pushes[k] != 0) & (acts[k] != 0) & (x[3, k] < 0.0):
                    part = x[2, k] / (x[2, k] - x[3, k])
                    if part < way:
                        way, last = part, k
            for k in range(m):
                x[2, k] += way * (x[3, k] - x[2, k])
            if last < 0:
                break
            acts[last], x[2, last] = 0, 0.0


@compiled
def missed_row(m: int, A: Floats, x: Floats, pushes: Integers) -> int:
    """The first row whose rate the impulses do not change as it should, as joints hold it; or -1.

    Arguments as of ``find_impulses``.
    """
    size = largest(x[0][:m])
    for k in range(m):
        left = -x[0, k]
        for q in range(m):
            left += A[k, q] * x[1, q]
        if pushes[k] != 0:
            left = min(left, 0.0)
        if abs(left) > MISS * size:
            return k
    return -1


@compiled
def least_solution(m: int, A: Floats, b: Floats, acts: Integers, x: Floats, space: Floats) -> None:
    """The least x of A x = b among the rows that act, as far as there is freedom; else zero.

    By the eigenvalues of A, which rotations of Jacobi find (Golub, Van Loan, Matrix Computations,
    8.5).
    """
    S, V = space[0], space[1]
    for i in range(m):
        for k in range(m):
            S[i, k] = 0.5 * (A[i, k] + A[k, i]) if (acts[i] != 0) & (acts[k] != 0) else 0.0
    diagonalise(m, S, V)
    zero(x[:m])
    for q in range(m):
        if S[q, q] > FREEDOM:
            part = 0.0
            for k in range(m):
                part += V[k, q] * b[k]
            part /= S[q, q]
            for k in range(m):
                if acts[k] != 0:
                    x[k] += part * V[k, q]


@compiled
def diagonalise(m: int, S: Floats, V: Floats) -> None:
    """Turn a symmetric matrix (m, m) into its eigenvalues; V: its eigenvectors, by columns."""
    for i in range(m):
        for k in range(m):
            V[i, k] = 1.0 if i == k else 0.0
    for _ in range(SWEEPS):
        left = 0
        for i in range(m):
            for k in range(i):
                left += rotate(m, S, V, k, i)
        if left == 0:
            break


@compiled
def rotate(m: int, S: Floats, V: Floats, p: int, q: int) -> int:
    """Turn the entry p, q of a symmetric matrix to zero; 0 where it is that, to rounding."""
    off = S[p, q]
    if abs(off) <= 1e-17 * (abs(S[p, p]) + abs(S[q, q])):
        return 0
    tau = (S[q, q] - S[p, p]) / (2.0 * off)
    tangent = 1.0 / (abs(tau) + np.sqrt(1.0 + tau * tau))
    tangent = -tangent if tau < 0.0 else tangent
    c = 1.0 / np.sqrt(1.0 + tangent * tangent)
    s = tangent * c
    for k in range(m):
        a, b = S[k, p], S[k, q]
        S[k, p], S[k, q] = c * a - s * b, s * a + c * b
    for k in range(m):
        a, b = S[p, k], S[q, k]
        S[p, k], S[q, k] = c * a - s * b, s * a + c * b
        a, b = V[k, p], V[k, q]
        V[k, p], V[k, q] = c * a - s * b, s * a + c * b
    S[p, q] = S[q, p] = 0.0
    return 1
