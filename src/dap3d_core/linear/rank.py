"""Rank of the constraint rows, and the redundant ones.

Up to FEW_ROWS rows: singular values of the whole Jacobian. Beyond, what is not part of a loop is
left out first: where one joint alone holds a body by independent rows, no combination of rows that
vanishes can contain that joint, so it is taken away with the body, and so on. Trees vanish so.
What remains falls into parts that share no body; small ones get their singular values, large ones
are looked at by elimination first: rows whose pivots vanish in the static order of ldlt/factor.py
are left out; each is then a combination of the rows kept, found by solving with their factors and
refined. That is a proof if these combinations vanish on D itself, and if the smallest singular
value of the rows kept, by inverse iteration, is not zero.

Where it is none (without pivoting a row may seem to depend on others that it does not), by block
inverse iteration: D D^T + eps W, with W the squared lengths of the rows, has factors, too; where a
combination of rows vanishes its inverse is 1 / eps, elsewhere no more than 1 / sigma^2. A block of
vectors that is solved for again and again turns into the space of the smallest singular values.
Which of them are zero is decided on D, not on D D^T: by the singular values of D^T X, which
rounding reaches at 1e-15 and not at its root.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.linear.ldlt.factor import assemble, factor, solve
from dap3d_core.linear.ldlt.plan import Plan

#: Up to this many rows the rank comes from singular values of the whole Jacobian: to look for
#: leaves would take as long.
FEW_ROWS = 30
#: Up to this many rows that of a part does.
PART_ROWS = 300
#: Up to this many rows a dense Jacobian is made for what is not done by blocks.
DENSE_ROWS = 1000
#: A pivot of the block factorisation counts as zero below this part of its row's squared length.
PIVOT_TOLERANCE = 1e-10
#: A joint is taken away with a body that it alone holds if the smallest singular value of its rows
#: on that body is above this part of the largest.
HOLDS = 1e-6
#: A row has a part in a combination of unit length if its weight is above this.
WEIGHT = 1e-8
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


@attrs.frozen(eq=False)
class Dependency:
    """Rows that depend on each other and on no others.

    Attributes:
        rows: (k,) ascending.
        combinations: (redundant, k) an orthonormal basis of their combinations that vanish.
    """

    rows: Integers
    combinations: Floats


@attrs.frozen(eq=False)
class Rank:
    """Independence of the rows of a Jacobian.

    Attributes:
        rows, columns: size of the Jacobian.
        rank: number of independent rows.
        tolerance: below this part of the largest a singular value counts as zero.
        method: "svd"; beyond FEW_ROWS rows "leaves" where nothing but trees was found, "svd of
            parts", or "elimination" or "inverse iteration" where a part was too large for that.
        dependencies: sets of rows that depend on each other, by their first rows.
    """

    rows: int
    columns: int
    rank: int
    tolerance: float
    method: str
    dependencies: tuple[Dependency, ...] = ()

    @property
    def redundant(self) -> int:
        """Number of redundant rows."""
        return self.rows - self.rank

    @property
    def dof(self) -> int:
        """Degrees of freedom: columns less rank."""
        return self.columns - self.rank

    @property
    def shared(self) -> Integers:
        """Rows that take part in a dependency, ascending."""
        none = np.zeros(0, dtype=np.int64)
        return np.sort(np.concatenate([none, *(d.rows for d in self.dependencies)]))


def tolerance_of(rows: int, columns: int) -> float:
    """Part of the largest singular value below which one is zero: max(rows, columns) eps 100."""
    return float(max(rows, columns) * np.finfo(float).eps * 100)


def dense_rank(D: Floats, blur: float = 0.0) -> Rank:
    """Rank of D (rows, columns) by singular values.

    Zero is what is below max(rows, columns) eps 100 of the largest, or below ``blur``.
    """
    rows, columns = D.shape
    if not rows:
        return Rank(0, columns, 0, tolerance_of(0, columns), "svd")
    null, tolerance = _null_of_dense(D, blur)
    found = tuple(_separate(np.arange(rows), null))
    return Rank(rows, columns, rows - len(null), tolerance, "svd", found)


def _null_of_dense(D: Floats, blur: float) -> tuple[Floats, float]:
    """Orthonormal basis (redundant, rows) of the combinations of rows that vanish; tolerance."""
    rows, columns = D.shape
    left, values, _ = np.linalg.svd(D, full_matrices=rows > columns)
    tolerance = max(tolerance_of(rows, columns), blur / values[0] if values[0] else 0.0)
    rank = int(np.sum(values > tolerance * values[0]))
    return np.ascontiguousarray(left[:, rank:].T), tolerance


def _separate(rows: Integers, null: Floats) -> Iterator[Dependency]:
    """Split combinations (redundant, rows) into sets of rows that depend only on each other.

    The projector on their span has a zero for two rows of different sets, whatever the basis.
    """
    if not len(null):
        return
    taking_part = np.max(np.abs(null), axis=0) > WEIGHT
    rows, null = rows[taking_part], null[:, taking_part]
    left = np.ones(len(rows), dtype=bool)
    while np.any(left):
        members, waiting = [], [int(np.argmax(left))]
        left[waiting] = False
        while waiting:
            now, waiting = waiting[:64], waiting[64:]
            members += now
            if np.any(left):
                linked = np.max(np.abs(null[:, now].T @ null), axis=0) > WEIGHT
                fresh = np.flatnonzero(linked & left)
                left[fresh] = False
                waiting += fresh.tolist()
        chosen = np.sort(np.array(members, dtype=np.int64))
        mine = null
        if len(chosen) < len(rows):  # singular values 1 and 0: the projector on this set's span
            _, values, right = np.linalg.svd(null[:, chosen], full_matrices=False)
            mine = right[values > 0.5]
        yield Dependency(rows[chosen], mine)


def _separate_sparse(rows: Integers, basis: Floats) -> Iterator[Dependency]:
    """The same for a basis each of whose vectors has a row of its own: by where it is not zero."""
    from scipy.linalg import solve_triangular
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    there = csr_array(np.abs(basis) > WEIGHT)
    _, label = connected_components((there @ there.T) > 0, directed=False)
    for k in range(int(np.max(label, initial=-1)) + 1):
        mine = basis[label == k]
        mine = mine[:, taking_part := np.max(np.abs(mine), axis=0) > WEIGHT]
        products = mine @ mine.T
        for _ in range(2):  # the first pass is good to the square of the condition
            mine = solve_triangular(np.linalg.cholesky(products), mine, lower=True)
            products = mine @ mine.T
            if np.max(np.abs(products - np.eye(len(mine)))) < 1e-13:
                break
        yield Dependency(rows[taking_part], mine)


def factor_independent(plan: Plan, D: Floats, K: Floats) -> None:
    """Fill and factor K, leaving out rows that depend on those before; their unknowns become zero.

    Args:
        plan: the elimination program.
        D: (block_size,) scaled blocks.
        K: (matrix_size,) gets the factors.
    """
    assemble(plan.targets, plan.contributions, D, K)
    place, row, _ = plan.entries
    squares = np.bincount(row, np.sum(D[place[:, None] + np.arange(6)] ** 2, axis=1), plan.row_size)
    factor(plan.nodes, plan.columns, plan.updates, K, PIVOT_TOLERANCE * squares, True)


def has_loops(plan: Plan, D: Floats) -> bool:
    """False if no rows can depend on each other, as there are nothing but trees.

    Args:
        plan: the elimination program.
        D: (block_size,) blocks as the joints gave them.
    """
    return bool(_core(plan, D))


def sparse_rank(
    plan: Plan, D: Floats, row_places: Integers, columns: int, blur: float = 0.0
) -> Rank:
    """Rank of a Jacobian of many rows, given by blocks; see the head of this file.

    Args:
        plan: the elimination program.
        D: (block_size,) blocks as the joints gave them; not changed.
        row_places: (rows,) place of each row in the row vectors.
        columns: 6 n.
        blur: singular values below count as zero, too.
    """
    rows = len(row_places)
    model_row = np.full(plan.row_size, -1)
    model_row[row_places] = np.arange(rows)
    parts = _parts(plan, _core(plan, D))
    large = [part for part in parts if len(part) > PART_ROWS]
    method = "svd of parts" if parts else "leaves"
    tolerance = tolerance_of(0, 0)
    found: list[Dependency] = []
    for part in parts:
        if len(part) <= PART_ROWS:
            null, used = _null_of_dense(_dense(plan, D, part), blur)
            found += _separate(part, null)
            tolerance = max(tolerance, used)
    if large:
        chosen = np.sort(np.concatenate(large))
        limit = tolerance_of(len(chosen), columns)
        problem = problem_of(plan, D, chosen, limit, blur)
        tolerance = max(tolerance, problem.zero / problem.largest)
        K = np.zeros(plan.matrix_size)
        factor_independent(plan, problem.D, K)
        basis, method = by_elimination(problem, K), "elimination"
        if basis is None:
            found += _separate(chosen, by_iteration(problem))
            method = "inverse iteration"
        else:
            found += _separate_sparse(chosen, basis)
    renamed = []
    for dependency in found:
        names = model_row[dependency.rows]
        order = np.argsort(names)
        renamed.append(Dependency(names[order], dependency.combinations[:, order]))
    renamed.sort(key=lambda dependency: int(dependency.rows[0]))
    rank = rows - sum(len(d.combinations) for d in renamed)
    return Rank(rows, columns, rank, tolerance, method, tuple(renamed))


def _core(plan: Plan, D: Floats) -> list[int]:
    """Blocks of the joint nodes that are left when leaves are taken away, again and again."""
    holds = _holds(plan, D).tolist()
    bodies, nodes = plan.blocks[:, 1].tolist(), plan.blocks[:, 3].tolist()
    of_node: dict[int, list[int]] = {}
    of_body: dict[int, set[int]] = {}
    for block, (body, node) in enumerate(zip(bodies, nodes, strict=True)):
        of_node.setdefault(node, []).append(block)
        of_body.setdefault(body, set()).add(block)
    todo = list(of_body)
    while todo:
        mine = of_body[todo.pop()]
        if len(mine) != 1 or not holds[next(iter(mine))]:
            continue
        for block in of_node.pop(nodes[next(iter(mine))]):
            of_body[bodies[block]].discard(block)
            todo.append(bodies[block])
    return [block for blocks in of_node.values() for block in blocks]


def _holds(plan: Plan, D: Floats) -> np.ndarray:
    """True if the rows of each block are independent of each other."""
    result = np.zeros(len(plan.blocks), dtype=bool)
    heights = plan.blocks[:, 2]
    for height in range(1, 7):
        chosen = np.flatnonzero(heights == height)
        if len(chosen):
            block = D[plan.blocks[chosen, 0][:, None] + np.arange(6 * height)]
            values = np.linalg.svd(block.reshape(-1, height, 6), compute_uv=False)
            result[chosen] = values[:, -1] > HOLDS * values[:, 0]
    return result


def _parts(plan: Plan, core: Sequence[int]) -> list[Integers]:
    """Rows (their places in the row vectors) of the parts that share no body, ascending."""
    bodies, nodes = plan.blocks[:, 1].tolist(), plan.blocks[:, 3].tolist()
    height = plan.blocks[:, 2].tolist()
    neighbours: dict[tuple[str, int], list[tuple[str, int]]] = {}
    rows_of: dict[int, int] = {}
    for block in core:
        body, node = ("body", bodies[block]), ("node", nodes[block])
        neighbours.setdefault(body, []).append(node)
        neighbours.setdefault(node, []).append(body)
        rows_of[nodes[block]] = height[block]
    parts: list[Integers] = []
    seen: set[tuple[str, int]] = set()
    for start in neighbours:
        if start in seen:
            continue
        seen.add(start)
        part: list[int] = []
        waiting = [start]
        while waiting:
            kind, number = thing = waiting.pop()
            if kind == "node":
                part += range(number, number + rows_of[number])
            fresh = [other for other in neighbours[thing] if other not in seen]
            seen.update(fresh)
            waiting += fresh
        parts.append(np.sort(np.array(part, dtype=np.int64)))
    return parts


def _dense(plan: Plan, D: Floats, part: Integers) -> Floats:
    """The Jacobian of some rows, on their own bodies alone."""
    place, row, body = plan.entries
    mine = np.isin(row, part)
    place, row, body = place[mine], np.searchsorted(part, row[mine]), body[mine]
    columns, body = np.unique(body, return_inverse=True)
    result = np.zeros((len(part), len(columns), 6))
    result[row, body] = D[place[:, None] + np.arange(6)]
    return result.reshape(len(part), -1)
