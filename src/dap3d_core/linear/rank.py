"""How many constraint rows are independent, and which are not (spec 8)."""

import attrs
import numpy as np

from dap3d_core.linear.blocks import Floats, assemble, factor, scale_blocks
from dap3d_core.linear.plan import Integers, Plan

#: Up to this many rows the rank comes from singular values.
DENSE_ROWS = 1000

#: Beyond, a pivot of the block factorisation counts as zero below this part of its row's squared
#: length.
PIVOT_TOLERANCE = 1e-10


@attrs.frozen(eq=False)
class Rank:
    """Independence of the rows of a Jacobian.

    Attributes:
        rows, columns: size of the Jacobian.
        rank: number of independent rows.
        tolerance: below this (relative to the largest) a singular value or pivot counts as zero.
        method: "svd" or "pivots".
        shared: rows that take part in a dependency (svd), or that were found dependent on earlier
            ones (pivots).
        dependencies: (redundant, rows) an orthonormal basis of the combinations of rows that
            vanish; empty for pivots.
    """

    rows: int
    columns: int
    rank: int
    tolerance: float
    method: str
    shared: tuple[int, ...]
    dependencies: Floats

    @property
    def redundant(self) -> int:
        """Number of redundant rows."""
        return self.rows - self.rank

    @property
    def dof(self) -> int:
        """Degrees of freedom: columns less rank."""
        return self.columns - self.rank


def dense_rank(D: Floats) -> Rank:
    """Rank of D (rows, columns) by singular values.

    Zero is what is below max(rows, columns) eps 100 of the largest.
    """
    rows, columns = D.shape
    tolerance = max(rows, columns) * np.finfo(float).eps * 100
    if not rows:
        return Rank(0, columns, 0, tolerance, "svd", (), np.zeros((0, 0)))
    left, values, _ = np.linalg.svd(D)
    rank = int(np.sum(values > tolerance * values[0]))
    null = left[:, rank:].T
    shared = np.flatnonzero(np.max(np.abs(null), axis=0) > 1e-8) if len(null) else ()
    return Rank(rows, columns, rank, tolerance, "svd", tuple(int(k) for k in shared), null)


def factor_independent(plan: Plan, D: Floats, K: Floats) -> None:
    """Fill and factor K, leaving out rows that depend on those before; their unknowns become zero.

    Args:
        plan: the elimination program.
        D: (block_size,) scaled blocks.
        K: (matrix_size,) gets the factors.
    """
    assemble(plan.targets, plan.contributions, D, K)
    heights = plan.blocks[:, 2]
    within = np.arange(heights.sum()) - np.repeat(np.cumsum(heights) - heights, heights)
    place = np.repeat(plan.blocks[:, 0], heights) + 6 * within
    squares = np.sum(D[place[:, None] + np.arange(6)] ** 2, axis=1)
    row = np.repeat(plan.blocks[:, 3], heights) + within
    smallest = PIVOT_TOLERANCE * np.bincount(row, squares, minlength=plan.row_size)
    factor(plan.nodes, plan.columns, plan.updates, K, smallest, True)


def sparse_rank(plan: Plan, D: Floats, metric: Floats, row_places: Integers, columns: int) -> Rank:
    """Rank by the pivots of the block factorisation, for many rows.

    The order of elimination is static, so this is weaker than singular values: a row counts as
    dependent when what is left of it, after the rows before it, is below sqrt(PIVOT_TOLERANCE) of
    its length.

    Args:
        plan: the elimination program.
        D: (block_size,) blocks as the joints gave them; not changed.
        metric: (n+1, 16) of bodies as placed.
        row_places: (rows,) place of each row in the row vectors.
        columns: 6 n.
    """
    D = D.copy()
    scale_blocks(plan.blocks, D, metric)
    K = np.zeros(plan.matrix_size)
    factor_independent(plan, D, K)
    inverse_pivot = np.ones(plan.row_size)
    for size, first, diagonal, *_ in plan.nodes[:-1]:
        inverse_pivot[first : first + size] = K[diagonal : diagonal + size * size : size + 1]
    dependent = tuple(int(k) for k in np.flatnonzero(inverse_pivot[row_places] == 0.0))
    rows = len(row_places)
    rank = rows - len(dependent)
    none_known = np.zeros((0, rows))
    return Rank(rows, columns, rank, PIVOT_TOLERANCE, "pivots", dependent, none_known)
