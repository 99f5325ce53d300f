"""Pivots of a formulation's factors, which tell how near a pose is to a singular one."""

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import EVEN, Floats, Integers
from dap3d_core.formulations.evaluator import AS_COMPILED, Machine
from dap3d_core.linear.ldlt.factor import LESS, POOR

#: A row whose pivot is below this many times its compliance depends on other rows.
REDUNDANT = 100.0


def watch_pivots(machine: Machine, t: float, u: ArrayLike) -> None:
    """Store the pivots at a state u (13 n,): below POOR of it a pose is near a singular one.

    Relative to the start, because masses of very different size make small pivots, too. Rows that
    depend on others from the start are not watched.
    """
    formulation, system = machine.formulation, machine.system
    if not formulation.needs_joints or not machine.model.row_count:
        return
    machine.place(t, u)
    system.smallest[:] = 0.0
    found = pivots(machine, t)
    if formulation.accepts_redundant:
        found[found < REDUNDANT * system.compliance[system.row]] = 0.0
    system.smallest[system.row] = POOR * found


def poor_rows(machine: Machine, t: float) -> Integers:
    """Rows (model's order) that are nearly singular at the bodies as placed (pivot_lengths)."""
    system, plan = machine.system, machine.plan
    smallest, found = system.smallest[system.row], pivots(machine, t)
    watched = smallest > 0.0
    ratio = np.ones(plan.row_size)
    ratio[system.row[watched]] = POOR * found[watched] / smallest[watched]
    poor = ~(ratio > POOR)
    for size, first, *_ in plan.nodes[:-1]:
        poor[first : first + size] &= not np.prod(ratio[first : first + size]) > LESS
    return np.flatnonzero(poor[system.row])


@AS_COMPILED
def pivots(machine: Machine, t: float) -> Floats:
    """(rows,) pivots of the formulation's factors at the bodies as placed; model's order."""
    from dap3d_core.formulations.common.constraints import (
        PART,
        factorise,
        linearise,
        linearise_evenly,
    )

    system, plan = machine.system, machine.plan
    place = linearise_evenly if system.settings[EVEN] else linearise
    place(float(t), system, machine.loops)
    factorise(system, PART if machine.formulation.accepts_redundant else None)
    inverse = np.ones(plan.row_size)
    for size, first, diagonal, *_ in plan.nodes[:-1]:
        inverse[first : first + size] = system.K[diagonal : diagonal + size * size : size + 1]
    result: Floats = np.abs(1.0 / inverse[system.row])
    return result
