"""L D L^T of a symmetric positive matrix by rows, within its profile; of the kept rows.

George, Liu, Computer Solution of Large Sparse Positive Definite Systems (1981), 4. In place of the
diagonal 1/d is stored.
"""

import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import copy, zero
from dap3d_core.assembly.metric import in_body_axes, scaled_moment
from dap3d_core.formulations.common.constraints import slide_sharing
from dap3d_core.formulations.joint_loops import layout
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.scalar_math import where
from dap3d_core.linear.ldlt.factor import (
    LEAST_ALIKE,
    SINGULAR_NODE_RATIO,
    SINGULAR_PIVOT_RATIO,
    alike,
)

#: Solutions at most where rows may depend on each other. One leaves some ``PART`` of what lacked
#: before, less of weak rows; they go on while the square of the change falls by this factor, until
#: it is rounding. What dependent rows contradict each other in changes by the same each time.
SOLVES, FALLING, PROFILE_ROUNDING = 12, 0.25, 1e-30
#: e of such rows by the diagonal of their matrix. A motion that joints permit on C = 0 alone takes
#: rows for dependent there that are not, a little beside it: the smaller the part, the shorter are
#: the steps that this leaves.
PART = 1e-6
#: A row that moves nothing has a compliance as if it moved a body by this part of its square.
LEAST_FREE = 1e-4


@compiled
def weigh_kept_rows(system: System, part: float) -> None:
    """E: ``part`` of the diagonal of ``matrix``; 0.0 where rows are independent.

    At least that of ``LEAST_FREE`` of the row's square in the metric of the heaviest of its bodies:
    the tree may hold all that a row would move. Of the lightest, a link without mass, it is many
    times what the row feels, and no pass would come near the rows.
    """
    kept = system.tree.kept
    kept.settings[layout.PART_OF_FACTORS] = part
    zero(kept.compliance)
    if part == 0.0:
        return
    contacts, shares = system.contacts.shape[0] > 0, slide_sharing(system)
    cuts, ends, D = pointer(kept.cuts), pointer(kept.ends), pointer(kept.D)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        for e in range(cuts[c + layout.FIRST_END], cuts[c + layout.LAST_END]):
            b = ends[layout.END_WIDTH * e + layout.END_BODY]
            s, k = system.body[b], system.metric[b]
            for r in range(cuts[c + layout.ROW_COUNT]):
                d = ends[layout.END_WIDTH * e + layout.END_BLOCK] + 6 * r
                x, y, z = in_body_axes(s, D[d + 3], D[d + 4], D[d + 5])
                x, y, z = scaled_moment(k, x, y, z)
                own = (D[d] * D[d] + D[d + 1] * D[d + 1] + D[d + 2] * D[d + 2]) * k[0] * k[0]
                turned, row = x * x + y * y + z * z, cuts[c + layout.FIRST] + r
                own = where(shares, alike(own, turned, LEAST_ALIKE), own + turned)
                others = kept.compliance[row]
                least = where((own > 0.0) & (own < others), own, others)
                kept.compliance[row] = where(contacts | (others == 0.0), others + own, least)
    for j in range(kept.compliance.shape[0]):
        diagonal = kept.matrix[kept.profile[j, layout.PLACE] + j]
        least = LEAST_FREE * kept.compliance[j]
        if contacts and kept.compliance[j] == 0.0:  # a row that does not hold
            kept.compliance[j] = 1.0
        elif contacts:  # what rows share depends on these: as of contacts/equations.py, weigh_alike
            kept.compliance[j] = part * kept.compliance[j]
        else:
            kept.compliance[j] = part * where(least > diagonal, least, diagonal)


@compiled
def factor_profile(system: System) -> bool:
    """Factors of ``matrix``, and E, in its place; False if a pivot is not positive."""
    kept = system.tree.kept
    S, profile, E = pointer(kept.matrix), kept.profile, kept.compliance
    positive = True
    for j in range(profile.shape[0]):
        first, row = profile[j, layout.COUPLED], profile[j, layout.PLACE]
        d = S[row + j] + E[j]
        for i in range(first, j):
            s, other = S[row + i], profile[i, layout.PLACE]
            for e in range(max(first, profile[i, layout.COUPLED]), i):
                s -= S[row + e] * S[other + e]
            S[row + i] = s  # d times L
        for i in range(first, j):
            s = S[row + i]
            S[row + i] = s * S[profile[i, layout.PLACE] + i]
            d -= s * S[row + i]
        positive = positive and d > 0.0
        S[row + j] = 1.0 / d if d > 0.0 else np.nan
    return positive


@compiled
def solve_profile(system: System) -> float:
    """``multipliers`` for what is lacking in ``right``: (S + E) lambda = right, refined by E.

    Returns the square of the last change, as part of that of the multipliers.
    """
    kept = system.tree.kept
    right, x, z, E = kept.right, kept.multipliers, kept.solution, kept.compliance
    size = x.shape[0]
    copy(z, right)
    substitute(system, z)
    copy(x, z)
    if size == 0 or E[0] == 0.0:
        return 0.0
    change, total, before = 0.0, 0.0, np.inf
    for _ in range(1, SOLVES):
        for k in range(size):
            z[k] = right[k] + E[k] * x[k]
        substitute(system, z)
        change, total = 0.0, 0.0
        for k in range(size):
            of_change, of_all = E[k] * (z[k] - x[k]) * (z[k] - x[k]), E[k] * z[k] * z[k]
            change = where(of_change > change, of_change, change)
            total = where(of_all > total, of_all, total)
            x[k] = z[k]
        if not change > PROFILE_ROUNDING * total or not change < FALLING * before:
            break
        before = change
    return change / total if total > 0.0 else 0.0


@compiled_into
def substitute(system: System, z: Floats) -> None:
    """Solve L D L^T z = z."""
    kept = system.tree.kept
    S, profile = pointer(kept.matrix), kept.profile
    for j in range(profile.shape[0]):
        row, s = profile[j, layout.PLACE], z[j]
        for i in range(profile[j, layout.COUPLED], j):
            s -= S[row + i] * z[i]
        z[j] = s
    for j in range(profile.shape[0]):
        z[j] *= S[profile[j, layout.PLACE] + j]
    for j in range(profile.shape[0] - 1, -1, -1):
        row, s = profile[j, layout.PLACE], z[j]
        for i in range(profile[j, layout.COUPLED], j):
            z[i] -= S[row + i] * s


@compiled
def pivot_lengths(system: System, lengths: Floats) -> int:
    """Of each kept joint the square root of its pivots' product, as in linear/ldlt/factor.py.

    Returns the number of joints with a pivot not above ``smallest`` and a small product.
    """
    kept, counted = system.tree.kept, 0
    for q in range(kept.cuts.shape[0]):
        product, small, first = 1.0, 0, kept.cuts[q, layout.FIRST]
        for j in range(first, first + kept.cuts[q, layout.ROW_COUNT]):
            if kept.smallest[j] > 0.0:
                pivot = kept.matrix[kept.profile[j, layout.PLACE] + j]
                ratio = 1.0 / (abs(pivot) * kept.smallest[j])
                small |= not ratio > 1.0
                product *= SINGULAR_PIVOT_RATIO * ratio
        if not product > SINGULAR_NODE_RATIO:
            counted += small
        lengths[q] = np.sqrt(product) if product > 0.0 else 0.0
    return counted
