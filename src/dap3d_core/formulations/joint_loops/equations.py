"""The joint formulation where rows are kept: joints that close loops, drivers, rods.

    place, forces    as on a tree
    reduce           articulated inertias of the tree; what its bodies do if no row is kept
    carry, multiply  kept rows as loads on the tree; the matrix S = G M^-1 G^T of these
    solve            S lambda = gamma - (accelerations of the rows so far)
    push, spread     what lambda does along the freedoms; q_ddot, from ground to the leaves

The same S moves a state onto the kept rows: those of the tree cannot be violated.
"""

from typing import Any

from dap3d_core.assembly.arrays import SINGULAR, Floats, System
from dap3d_core.assembly.evaluate import copy, state_rates, zero
from dap3d_core.formulations.common.constraints import (
    power_of_drivers,
    report_levels,
    report_multipliers,
)
from dap3d_core.formulations.common.friction import has_friction, solve_with_friction
from dap3d_core.formulations.common.projection import project_onto
from dap3d_core.formulations.joint.equations import (
    apply_forces,
    linearise_tree,
    store_reactions,
    sum_forces,
)
from dap3d_core.formulations.joint.multipliers import joint_multipliers
from dap3d_core.formulations.joint.place import place_tree
from dap3d_core.formulations.joint.reduce import reduce_nodes
from dap3d_core.formulations.joint.spread import body_accelerations, spread_tree
from dap3d_core.formulations.joint_loops import kept_rows, layout, loads, profile
from dap3d_core.formulations.lsq import minimum_norm_multipliers
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: Passes have converged where the square of the last change is this part at most; how much smaller
#: parts are where they have not, which is to leave that much less; the least.
CONVERGED, SMALLER, LEAST = 1e-18, 1e-3, 1e-11


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    place_tree(y, system)
    apply_forces(t, system, loops)
    if has_friction(system):
        power = accelerate(t, system, loops, False)
    else:
        loads.linearise_kept(t, system, loops)
        power = reduce_with_kept_rows(system)
    spread_tree(y, out, system)
    state_rates(t, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled_into
def reduce_with_kept_rows(system: System) -> float:
    """What ``spread`` takes, and multipliers of linearised rows; returns the power."""
    power = reduce_nodes(system, system.force, True)
    kept_rows.factorise(system, system.tree.kept.settings[layout.PART_OF_ROW])
    loads.lacking_accelerations(system)
    solve_kept(system)
    loads.push_freedoms(system)
    return power + power_of_kept_drivers(system)


@compiled
def solve_kept(system: System) -> None:
    """``multipliers`` for the accelerations in ``right``.

    Rows that move a light body alone are independent by little, of which passes leave nearly all:
    factors of a smaller part take the place of these. They stay where rows contradict each other.
    """
    given = part = system.tree.kept.settings[layout.PART_OF_ROW]
    left = first = profile.solve_profile(system)
    # less than PART asks for its pivots alone
    while left > CONVERGED and part > LEAST and given == profile.PART:
        part *= SMALLER
        kept_rows.factorise_anew(system, part)
        left = profile.solve_profile(system)
    if part < given and not left < SMALLER * first:
        kept_rows.factorise_anew(system, given)
        profile.solve_profile(system)


@compiled
def accelerate(t: float, system: System, loops: Any, is_report: bool) -> float:
    """Scaled ``acceleration`` and all ``multipliers``, with friction; returns the power.

    The bodies are placed, and ``force`` is known. Reports at singular poses are counted.
    """
    power = linearise_tree(t, system, loops)
    loads.linearise_kept(t, system, loops)
    if not kept_rows.factorise_anyway(system, None) and is_report:
        system.settings[SINGULAR] += 1.0
    power += solve_with_friction(t, system, loops, solve)
    return power + power_of_drivers(system)


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``."""
    sum_forces(system)
    reduce_nodes(system, system.tree.force, True)
    loads.lacking_accelerations(system)
    solve_kept(system)
    loads.push_freedoms(system)
    spread_tree(system.tree.slope, system.tree.slope, system)
    store_reactions(system)
    zero(system.multipliers)
    store_kept(system)
    subtract_kept_reactions(system, system.change)
    joint_multipliers(system, system.change)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto the kept rows; out as in ``project_onto``, a length for each kept joint."""
    is_redundant = system.tree.kept.settings[layout.PART_OF_ROW] > 0.0
    project_onto(t, y, out, system, loops, kept_rows, None, is_redundant, True)
    if is_redundant and kept_rows.have_come_to_hold(system):
        out[1] = 1.0


@compiled
def report(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """v_dot (6 n, global axes), lambda (rows, in the order of the model), energy, residuals.

    Where rows depend on each other lambda is the least that gives these accelerations.
    """
    place_tree(y, system)
    apply_forces(t, system, loops)
    accelerate(t, system, loops, True)
    body_accelerations(system, out)
    report_multipliers(system, out)
    report_levels(t, y, out, system, loops)
    if system.tree.kept.settings[layout.PART_OF_ROW] > 0.0:
        for _ in range(2):
            copy(system.total, system.multipliers)
            minimum_norm_multipliers(system)
        report_multipliers(system, out)


@compiled_into
def store_kept(system: System) -> None:
    """-lambda of the kept rows into ``multipliers``."""
    kept = system.tree.kept
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, layout.FIRST], kept.cuts[q, layout.FIRST_ROW]
        for r in range(kept.cuts[q, layout.ROW_COUNT]):
            system.multipliers[place + r] = -kept.multipliers[first + r]


@compiled
def subtract_kept_reactions(system: System, left: Floats) -> None:
    """What is left for the joints of the tree; left: as of ``joint_multipliers``."""
    kept = system.tree.kept
    cuts, ends, D = pointer(kept.cuts), pointer(kept.ends), pointer(system.D)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        rows, first = cuts[c + layout.ROW_COUNT], cuts[c + layout.FIRST]
        for e in range(cuts[c + layout.FIRST_END], cuts[c + layout.LAST_END]):
            b = 6 * ends[layout.END_WIDTH * e + layout.END_BODY]
            for r in range(rows):
                d = ends[layout.END_WIDTH * e + layout.END_BLOCK] + 6 * r
                x = kept.multipliers[first + r]
                for i in range(6):
                    left[b + i] -= D[d + i] * x


@compiled
def power_of_kept_drivers(system: System) -> float:
    """Power of the reactions of kept rows: only those that move do work."""
    kept, power = system.tree.kept, 0.0
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, layout.FIRST], kept.cuts[q, layout.FIRST_ROW]
        for r in range(kept.cuts[q, layout.ROW_COUNT]):
            power += kept.multipliers[first + r] * system.nu[place + r]
    return power
