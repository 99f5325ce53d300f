"""Combinations of many constraint rows that vanish.

By elimination first: rows whose pivots vanish in the static order of linear/ldlt/factor.py are left
out; each is then a combination of the rows kept, found by solving with their factors and refined.
That is a proof if these combinations vanish on D itself, and if the smallest singular value of the
rows kept, by inverse iteration, is not zero.

Where it is none (without pivoting a row may seem to depend on others that it does not), by block
inverse iteration: D D^T + eps W, with W the squared lengths of the rows, has factors, too; where a
combination of rows vanishes its inverse is 1 / eps, elsewhere no more than 1 / sigma^2. A block of
vectors that is solved for again and again turns into the space of the smallest singular values.
Which of them are zero is decided on D, not on D D^T: by the singular values of D^T X, which
rounding reaches at 1e-15 and not at its root.
"""

from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ldlt.factor import assemble, factor, solve
from dap3d_core.linear.ldlt.plan import Plan

#: eps: above what rounding leaves of a pivot that is zero, far below any other.
REGULAR = 1e-12
#: The block holds all singular values that this does not tell from zero when its largest one is
#: above this part of the largest: ten times sqrt(REGULAR).
APART = 1e-5
#: Each sweep leaves REGULAR / APART^2 = 1e-2 of what is above APART, at most.
FEWEST_SWEEPS, MOST_SWEEPS = 3, 12
#: Vectors to begin with.
MORE = 8
#: Solutions by elimination are good to the square of the condition; another gains as much again.
REFINED = 3


@compiled
def solve_each(nodes: Integers, columns: Integers, K: Floats, X: Floats) -> None:
    """Solve K z = x in place for each row x of X (vectors, row_size), with the factors of K."""
    for k in range(X.shape[0]):
        solve(nodes, columns, K, X[k])


@attrs.frozen(eq=False)
class Problem:
    """Rows that may depend on each other.

    Attributes:
        plan: the elimination program.
        chosen: (k,) the rows as places in the row vectors, ascending.
        blocks: (entries, 6) of the rows chosen; zero for others.
        place: (entries,) of each in D.
        square: (row_size,) squared length of each row; one for others.
        matrix: (6 n, k) D^T of these rows, sparse.
        largest: its largest singular value, to a few per cent.
        zero: a singular value not above this is zero.
    """

    plan: Plan
    chosen: Integers
    blocks: Floats
    place: Integers
    square: Floats
    matrix: Any
    largest: float
    zero: float

    @property
    def D(self) -> Floats:
        """(block_size,) the blocks of the rows chosen, zero for all others."""
        result = np.zeros(self.plan.block_size)
        result[self.place[:, None] + np.arange(6)] = self.blocks
        return result


def problem_of(plan: Plan, D: Floats, chosen: Integers, tolerance: float, blur: float) -> Problem:
    """Gather what both ways need.

    Args:
        plan: the elimination program.
        D: (block_size,) blocks as the joints gave them; not changed.
        chosen: rows that may depend on each other, as places in the row vectors, ascending.
        tolerance: a singular value below this part of the largest is zero.
        blur: one below this is zero, too.
    """
    place, row, body = plan.entries
    blocks = np.where(np.isin(row, chosen)[:, None], D[place[:, None] + np.arange(6)], 0.0)
    square: Floats = np.bincount(row, np.sum(blocks**2, axis=1), plan.row_size).astype(float)
    square[square == 0.0] = 1.0
    from scipy.sparse import csr_array

    columns = 6 * (body - 1)[:, None] + np.arange(6)
    shape = (plan.row_size, 6 * int(np.max(body)))
    whole = csr_array((blocks.ravel(), (np.repeat(row, 6), columns.ravel())), shape=shape)
    matrix = whole[chosen].T.tocsr()
    largest = _largest_value(matrix)
    zero = max(tolerance * largest, blur)
    return Problem(plan, chosen, blocks, place, square, matrix, largest, zero)


def by_elimination(problem: Problem, K: Floats) -> Floats | None:
    """A basis (redundant, k) of combinations that vanish; None where it is not proven to be one.

    Each has one row of weight 1 that no other has.

    Args:
        problem: the rows.
        K: (matrix_size,) factors of these rows without those that depend on earlier ones.
    """
    plan, chosen, matrix = problem.plan, problem.chosen, problem.matrix
    left_out = np.flatnonzero(inverse_pivots(plan, K)[chosen] == 0.0)
    basis = np.zeros((len(left_out), len(chosen)))
    basis[np.arange(len(left_out)), left_out] = 1.0
    missed = matrix @ basis.T
    for _ in range(REFINED):
        basis += _solved(problem, K, (matrix.T @ missed).T)
        missed = matrix @ basis.T
        if np.linalg.norm(missed) <= 0.1 * problem.zero:
            break
    if not np.linalg.norm(missed) <= problem.zero:  # NaN is no proof
        return None
    kept = np.setdiff1d(np.arange(len(chosen)), left_out)
    if len(kept):
        X = np.zeros((min(MORE, len(kept)), len(chosen)))
        X[:, kept] = np.random.default_rng(1).standard_normal((len(X), len(kept)))
        for _ in range(FEWEST_SWEEPS):
            X = np.linalg.qr(_solved(problem, K, X).T)[0].T
        if not np.linalg.svd(matrix @ X.T, compute_uv=False)[-1] > problem.zero:
            return None
    return basis


def by_iteration(problem: Problem) -> Floats:
    """An orthonormal basis (redundant, k) of combinations that vanish."""
    K, chosen = _factors(problem), problem.chosen
    rng = np.random.default_rng(1)
    X, count = np.zeros((0, len(chosen))), MORE
    while True:
        if count >= len(chosen):
            X = np.eye(len(chosen))
        else:
            X = np.vstack([X, rng.standard_normal((count - len(X), len(chosen)))])
        X, values = _iterate(problem, K, X)
        if values[-1] > APART * problem.largest or len(X) == len(chosen):
            return np.ascontiguousarray(X[values <= problem.zero])
        count = 2 * count


def _iterate(problem: Problem, K: Floats, X: Floats) -> tuple[Floats, Floats]:
    """Sweep until the singular values (ascending) of D^T on the space stand; and their vectors."""
    before = -1
    for sweep in range(1, MOST_SWEEPS + 1):
        Q = np.linalg.qr(_solved(problem, K, X * problem.square[problem.chosen]).T)[0]
        X = Q.T
        if sweep >= FEWEST_SWEEPS:
            _, values, right = np.linalg.svd(np.linalg.qr(problem.matrix @ Q, mode="r"))
            values = np.pad(values, (0, len(X) - len(values)))  # more rows than columns
            found = int(np.sum(values <= problem.zero))
            if found == before:
                break
            before = found
    return (right @ X)[::-1], values[::-1]


def _solved(problem: Problem, K: Floats, X: Floats) -> Floats:
    """-(D D^T)^-1 X (vectors, k), with the factors of it that stand in K."""
    full = np.zeros((len(X), problem.plan.row_size))
    full[:, problem.chosen] = X
    solve_each(problem.plan.nodes, problem.plan.columns, K, full)
    return full[:, problem.chosen]


def inverse_pivots(plan: Plan, K: Floats) -> Floats:
    """(row_size,) diagonal of the factors, inverted; zero for what was left out."""
    result = np.zeros(plan.row_size)
    for size, first, diagonal, *_ in plan.nodes[:-1]:
        result[first : first + size] = K[diagonal : diagonal + size * size : size + 1]
    return result


def _factors(problem: Problem) -> Floats:
    """K factored with the diagonal of each joint moved by REGULAR of its row's squared length."""
    plan = problem.plan
    K = np.zeros(plan.matrix_size)
    assemble(plan.targets, plan.contributions, problem.D, K)
    for size, first, diagonal, sign, *_ in plan.nodes[:-1]:
        if sign < 0:
            move = REGULAR * problem.square[first : first + size]
            K[diagonal : diagonal + size * size : size + 1] -= move
    factor(plan.nodes, plan.columns, plan.updates, K, np.zeros(plan.row_size), False)
    return K


def _largest_value(matrix: Any) -> float:
    """The largest singular value, to a few per cent."""
    x = np.random.default_rng(2).standard_normal(matrix.shape[1])
    for _ in range(20):
        x = matrix.T @ (matrix @ (x / np.linalg.norm(x)))
    return float(np.sqrt(np.linalg.norm(x)))
