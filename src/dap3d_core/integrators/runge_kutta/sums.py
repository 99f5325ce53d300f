"""Weighted sums of stages: states of stages, results, errors, terms of dense output.

Sums of the methods of this package are written out: weights are constants of the code, zeros are
left out, and loops over components are all that is left. Methods of other packages read theirs from
a table. Both add up in the same order, four terms at a time.
"""

from functools import cache
from typing import Any

import numpy as np

from dap3d_core.integrators.runge_kutta.dop853 import DOP853
from dap3d_core.integrators.runge_kutta.dopri5 import DOPRI5
from dap3d_core.integrators.runge_kutta.rk4 import RK4
from dap3d_core.integrators.runge_kutta.tableau import Tableau
from dap3d_core.integrators.stepping.integration_state import OTHER, SCRATCH, TRIAL, Y
from dap3d_core.integrators.stepping.step_control import EPSILON, combined_error, work_error
from dap3d_core.integrators.stepping.vector_ops import scaled_beyond, scaled_largest
from dap3d_core.kernels.array_types import Floats, SeparateFloats
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.scalar_math import where

#: Terms that are added to each other before they are added to the rest.
GROUP = 4
#: Columns of a row of ``combinations``: abscissa of the stage; number of the row in ``ROWS``, 0 if
#: it is not there; number of groups; then for each group its weights and their stages.
ABSCISSA, NUMBER, GROUPS, TERMS = range(4)
#: Of each group of a row its terms: weight and stage.
Groups = tuple[tuple[tuple[float, int], ...], ...]


def coefficients(method: Tableau) -> Floats:
    """The rows of a, then of e, then of d."""
    return np.vstack([method.a, *method.e, *method.d])


def _groups(row: Floats) -> Groups:
    terms = [(float(row[j]), int(j)) for j in np.flatnonzero(row)]
    return tuple(tuple(terms[k : k + GROUP]) for k in range(0, len(terms), GROUP))


#: Rows that are written out, with their numbers.
ROWS = tuple(
    enumerate(
        dict.fromkeys(
            _groups(row) for method in (DOP853, DOPRI5, RK4) for row in coefficients(method)
        )
    )
)[1:]
_NUMBERS = {groups: number for number, groups in ROWS}


@cache
def combinations(method: Tableau) -> Floats:
    """The method's coefficients as the compiled core reads them, without zeros: ``coefficients``.

    A row's terms are filled up to whole groups with terms of weight zero.
    """
    rows = [_groups(row) for row in coefficients(method)]
    table = np.zeros((len(rows), TERMS + 2 * GROUP * max(map(len, rows))))
    table[: len(method.c), ABSCISSA] = method.c
    for i, groups in enumerate(rows):
        table[i, NUMBER], table[i, GROUPS] = _NUMBERS.get(groups, 0), len(groups)
        for g, terms in enumerate(groups):
            # filled up with a stage that is used anyway: nothing new meets the weight zero
            filled = [*terms, *[(0.0, terms[-1][1])] * (GROUP - len(terms))]
            table[i, TERMS + 2 * GROUP * g :][: 2 * GROUP] = np.transpose(filled).ravel()
    return table


@compiled
def combine(
    out: SeparateFloats, share: float, y: Floats, h: float, table: Floats, row: int, k: Floats
) -> None:
    """``out = share y + h sum_j weight_j k[j]``; y is added last, which rounds least."""
    number = int(table[row, NUMBER])
    for known, groups in ROWS:
        if number == known:
            for i in range(out.size):
                total = -0.0  # to which a number is added unchanged, whatever its sign
                for terms in groups:
                    part = -0.0
                    for weight, j in terms:
                        part += weight * k[j, i]
                    total += part
                out[i] = share * y[i] + h * total
            return
    combine_by_table(out, share, y, h, table[row], k)


@compiled
def combine_by_table(
    out: SeparateFloats, share: float, y: Floats, h: float, terms: Floats, k: Floats
) -> None:
    """As ``combine``, of a row that is not written out."""
    for i in range(out.size):
        out[i] = -0.0
    for group in range(int(terms[GROUPS])):
        j = TERMS + 2 * GROUP * group
        w0, w1, w2, w3 = terms[j], terms[j + 1], terms[j + 2], terms[j + 3]
        j0, j1, j2, j3 = int(terms[j + 4]), int(terms[j + 5]), int(terms[j + 6]), int(terms[j + 7])
        for i in range(out.size):
            out[i] += w0 * k[j0, i] + w1 * k[j1, i] + w2 * k[j2, i] + w3 * k[j3, i]
    for i in range(out.size):
        out[i] = share * y[i] + h * out[i]


@compiled
def error_norm(work: Any, h: float) -> float:
    """Largest scaled error of the first components; 1 is just good enough.

    The largest, as in the manual's ode45, and not HNW's root mean square: in a scene of many bodies
    the mean would hide the error of the one that moves. Two estimates are combined as in HNW II.5:
    |e5|^2 / sqrt(|e5|^2 + 0.01 |e3|^2).
    """
    size, rtol, tolerance = work.error_size, work.rtol, work.tolerance
    y, trial, error = work.state[Y], work.state[TRIAL], work.state[SCRATCH]
    ratios = work.state[OTHER]
    k, table, first = work.k, work.table, work.k.shape[0]
    combine(error, 0.0, y, h, table, first, k)
    main = scaled_largest(ratios, error, y, trial, size, rtol, tolerance, h)
    of_work = work_error(work, h, error[error.size - 1])
    if work.estimate_count == 1:
        return where(of_work > main, of_work, main)
    combine(error, 0.0, y, h, table, first + 1, k)
    other = scaled_largest(ratios, error, y, trial, size, rtol, tolerance, h)
    main = combined_error(main, other)
    of_work = combined_error(of_work, work_error(work, h, error[error.size - 1]))
    return where(of_work > main, of_work, main)


@compiled
def error_beyond_rounding(work: Any, h: float) -> float:
    """As ``error_norm``, of what exceeds the rounding of time in the rates."""
    size, rtol, tolerance = work.error_size, work.rtol, work.tolerance
    y, trial, error = work.state[Y], work.state[TRIAL], work.state[SCRATCH]
    k, first, last = work.k, work.k.shape[0], work.k[work.stage_count - 1]
    main, rounding = 0.0, EPSILON * max(abs(work.t), abs(work.t + h))
    for e in range(work.estimate_count):
        combine(error, 0.0, y, h, work.table, first + e, k)
        found = scaled_beyond(error, y, trial, k[0], last, rounding, size, rtol, tolerance)
        main = found if e == 0 else combined_error(main, found)
    return main
