"""Pivots of a formulation's factors, which tell how near a pose is to a singular one."""

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import EVEN, Floats, Integers
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.linear.ldlt.factor import SINGULAR_NODE_RATIO, SINGULAR_PIVOT_RATIO

#: A row whose pivot is below this many times its compliance depends on other rows.
REDUNDANT = 100.0


def store_reference_pivots(evaluator: Evaluator, t: float, u: ArrayLike) -> None:
    """Store the pivots at a state u (13 n,): below POOR of it a pose is near a singular one.

    Relative to the start, because masses of very different size make small pivots, too. Rows that
    depend on others from the start are not watched, and none where there are contacts: those that
    close make other pivots, and corners on a plane depend on each other.
    """
    formulation, system = evaluator.formulation, evaluator.system
    if not formulation.needs_joints or not evaluator.model.row_count:
        return
    if not evaluator.coordinates.are_of_bodies:
        return
    evaluator.place(t, u)
    system.smallest[:] = 0.0
    if evaluator.model.contact_count:
        return
    found = pivots(evaluator, t)
    if formulation.accepts_redundant:
        found[found < REDUNDANT * system.compliance[system.row]] = 0.0
    system.smallest[system.row] = SINGULAR_PIVOT_RATIO * found


def near_singular_rows(evaluator: Evaluator, t: float) -> Integers:
    """Rows (model's order) that are nearly singular at the bodies as placed (pivot_lengths)."""
    system, plan = evaluator.system, evaluator.plan
    smallest, found = system.smallest[system.row], pivots(evaluator, t)
    watched = smallest > 0.0
    ratio = np.ones(plan.row_size)
    ratio[system.row[watched]] = SINGULAR_PIVOT_RATIO * found[watched] / smallest[watched]
    poor = ~(ratio > SINGULAR_PIVOT_RATIO)
    for size, first, *_ in plan.nodes[:-1]:
        poor[first : first + size] &= not np.prod(ratio[first : first + size]) > SINGULAR_NODE_RATIO
    return np.flatnonzero(poor[system.row])


@IGNORE_FLOAT_ERRORS
def pivots(evaluator: Evaluator, t: float) -> Floats:
    """(rows,) pivots of the formulation's factors at the bodies as placed; model's order."""
    from dap3d_core.formulations.common.constraints import (
        PART,
        factorise,
        linearise,
        linearise_evenly,
    )
    from dap3d_core.linear.rank import inverse_pivots

    system = evaluator.system
    place = linearise_evenly if system.settings[EVEN] else linearise
    place(float(t), system, evaluator.loops)
    factorise(system, PART if evaluator.formulation.accepts_redundant else None)
    return np.abs(1.0 / inverse_pivots(evaluator.plan, system.K)[system.row])
