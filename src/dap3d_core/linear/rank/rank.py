"""Rank of the constraint rows, and the redundant ones.

Up to FEW_ROWS rows: singular values of the whole Jacobian. Beyond, what is not part of a loop is
left out first: where one joint alone holds a body by independent rows, no combination of rows that
vanishes can contain that joint, so it is taken away with the body, and so on. Trees vanish so.
What remains falls into parts that share no body; small ones get their singular values, large ones
what linear/rank/null_space.py has.
"""

from collections.abc import Iterator, Sequence

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.linear.ldlt.factor import assemble, factor
from dap3d_core.linear.ldlt.plan import Plan
from dap3d_core.linear.rank.null_space import by_elimination, by_iteration, problem_of

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
