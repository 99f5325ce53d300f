"""The joint formulation where rows are kept: joints that close loops, drivers, rods.

    place, forces    as on a tree
    reduce           articulated inertias of the tree; what its bodies do if no row is kept
    carry, multiply  kept rows as loads on the tree; the matrix S = G M^-1 G^T of these
    solve            S lambda = gamma - (accelerations of the rows so far)
    push, spread     what lambda does along the freedoms; q_ddot, from ground to the leaves

The same S moves a state onto the kept rows: those of the tree cannot be violated.
"""

# What a compiled function returns is Any to mypy.
# mypy: disable-error-code="no-any-return"

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    LENGTH,
    SINGULAR,
    TOLERANCE_C,
    TOLERANCE_V,
    VALUE,
    Floats,
    System,
)
from dap3d_core.assembly.evaluate import call_kinds, largest_weighted, state_rates, zero
from dap3d_core.formulations.common.constraints import (
    PASSES,
    PROJECTION_FAILURE_FACTOR,
    REDUNDANT_FAILURE_FACTOR,
    REFACTOR_RATIO,
    power_of_drivers,
    report_levels,
    report_multipliers,
)
from dap3d_core.formulations.common.friction import has_friction, solve_with_friction
from dap3d_core.formulations.joint.equations import (
    apply_forces,
    linearise_tree,
    normalise_rotations,
    store_reactions,
    sum_forces,
)
from dap3d_core.formulations.joint.multipliers import joint_multipliers
from dap3d_core.formulations.joint.node_layout import (
    COORDINATE,
    FIXED,
    FREE,
    MOTION,
    RATE,
    SPHERICAL,
)
from dap3d_core.formulations.joint.place import place_tree, put, vector_of
from dap3d_core.formulations.joint.reduce import reduce_nodes
from dap3d_core.formulations.joint.spread import body_accelerations, spread_tree
from dap3d_core.formulations.joint_loops.layout import (
    CUT_WIDTH,
    END_BLOCK,
    END_BODY,
    END_WIDTH,
    FIRST,
    FIRST_END,
    FIRST_ROW,
    LAST_END,
    PART_OF_ROW,
    PLACE,
    ROW_COUNT,
)
from dap3d_core.formulations.joint_loops.loads import (
    carry_rows,
    kept_residuals,
    lacking_accelerations,
    lacking_velocities,
    linearise_kept,
    multiply_loads,
    push_freedoms,
    rest,
)
from dap3d_core.formulations.joint_loops.profile import (
    PART,
    factor_profile,
    pivot_lengths,
    solve_profile,
    weigh_kept_rows,
)
from dap3d_core.formulations.lsq import minimum_norm_multipliers
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import R, V, W
from dap3d_core.kernels.scalar_math import where

#: Pivots of dependent rows fall by LESS where compliances do; where they fall by less than HELD,
#: the rows hold something themselves.
LESS, HELD = 16.0, 10.0


@compiled
def rhs(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """dy/dt of a state, the power of forces and drivers last."""
    place_tree(y, system)
    apply_forces(t, system, loops)
    if has_friction(system):
        power = accelerate(t, system, loops, False)
    else:
        linearise_kept(t, system, loops)
        power = reduce_nodes(system, system.force, True)
        factorise(system)
        lacking_accelerations(system)
        solve_profile(system)
        push_freedoms(system)
        power += power_of_kept_drivers(system)
    spread_tree(y, out, system)
    state_rates(t, out, system, loops)
    out[out.shape[0] - 1] = power


@compiled
def factorise(system: System) -> None:
    """Factors of the kept rows' matrix, of the inertias in ``tree.work``."""
    carry_rows(system)
    multiply_loads(system)
    weigh_kept_rows(system, system.tree.kept.settings[PART_OF_ROW])
    factor_profile(system)


@compiled
def accelerate(t: float, system: System, loops: Any, is_report: bool) -> float:
    """Scaled ``acceleration`` and all ``multipliers``, with friction; returns the power.

    The bodies are placed, and ``force`` is known. Reports at singular poses are counted.
    """
    power = linearise_tree(t, system, loops)
    linearise_kept(t, system, loops)
    if not factorise_anyway(system) and is_report:
        system.settings[SINGULAR] += 1.0
    power += solve_with_friction(t, system, loops, solve)
    return power + power_of_drivers(system)


@compiled
def solve(system: System) -> None:
    """``acceleration`` and ``multipliers`` from the scaled forces in ``acceleration``."""
    sum_forces(system)
    reduce_nodes(system, system.tree.force, True)
    lacking_accelerations(system)
    solve_profile(system)
    push_freedoms(system)
    spread_tree(system.tree.slope, system.tree.slope, system)
    store_reactions(system)
    zero(system.multipliers)
    add_kept_reactions(system, system.change)
    joint_multipliers(system, system.change)


@compiled
def project(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """Move a state onto the kept rows; out as in ``project_onto`` (common/constraints.py)."""
    project_onto_kept(t, y, out, system, loops)


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
    if system.tree.kept.settings[PART_OF_ROW] > 0.0:
        for _ in range(2):
            for k in range(system.total.shape[0]):
                system.total[k] = system.multipliers[k]
            minimum_norm_multipliers(system)
        report_multipliers(system, out)


@compiled
def add_kept_reactions(system: System, left: Floats) -> None:
    """-lambda of the kept rows into ``multipliers``, and what is left for the joints of the tree.

    left: as of ``joint_multipliers``.
    """
    kept = system.tree.kept
    cuts, ends, D = pointer(kept.cuts), pointer(kept.ends), pointer(system.D)
    for q in range(kept.cuts.shape[0]):
        c = CUT_WIDTH * q
        rows, first, place = cuts[c + ROW_COUNT], cuts[c + FIRST], cuts[c + FIRST_ROW]
        for r in range(rows):
            system.multipliers[place + r] = -kept.multipliers[first + r]
        for e in range(cuts[c + FIRST_END], cuts[c + LAST_END]):
            b = 6 * ends[END_WIDTH * e + END_BODY]
            for r in range(rows):
                d, x = ends[END_WIDTH * e + END_BLOCK] + 6 * r, kept.multipliers[first + r]
                for i in range(6):
                    left[b + i] -= D[d + i] * x


@compiled
def power_of_kept_drivers(system: System) -> float:
    """Power of the reactions of kept rows: only those that move do work."""
    kept, power = system.tree.kept, 0.0
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, FIRST], kept.cuts[q, FIRST_ROW]
        for r in range(kept.cuts[q, ROW_COUNT]):
            power += kept.multipliers[first + r] * system.nu[place + r]
    return power


@compiled
def factorise_anyway(system: System) -> bool:
    """Inertias and factors at the bodies as placed; regularised where the pose is singular.

    Returns False if it is.
    """
    reduce_nodes(system, system.force, True)
    carry_rows(system)
    multiply_loads(system)
    part = system.tree.kept.settings[PART_OF_ROW]
    weigh_kept_rows(system, part)
    if factor_profile(system):
        return True
    multiply_loads(system)
    weigh_kept_rows(system, PART)
    factor_profile(system)
    return False


@compiled
def project_onto_kept(t: float, y: Floats, out: Floats, system: System, loops: Any) -> None:
    """``project``; out as in ``project_onto``, with one length for each kept joint."""
    is_redundant = system.tree.kept.settings[PART_OF_ROW] > 0.0
    lost = REDUNDANT_FAILURE_FACTOR if is_redundant else PROJECTION_FAILURE_FACTOR
    linear = out[0] == 1.0
    factored, stale = linear, False
    out[0] = out[1] = 0.0
    normalise_rotations(y, system)
    if not linear:
        place_tree(y, system)
        call_kinds(VALUE, VALUE, t, system, loops, system.force, system.force, system.force)
    kept_residuals(t, system, loops)
    worst = largest_weighted(system.residual, system.weight)
    limit = system.settings[TOLERANCE_C] * size_of_places(system)
    if not worst <= limit:
        if not linear:
            linearise_kept(t, system, loops)
        if not factored:
            factorise_anyway(system)
        for _ in range(PASSES):
            before = worst
            aim_at_positions(system)
            spread_change(system)
            displace(y, system.tree.slope, system)
            place_tree(y, system)
            kept_residuals(t, system, loops)
            worst = largest_weighted(system.residual, system.weight)
            if not worst > limit or not worst < 0.5 * before:
                break
        linear, factored = False, not is_redundant  # the null space of old factors would be wrong
        stale = factored
        out[0] = 1.0
        if not worst <= lost * limit:
            out[1] = 1.0
    out[2] = worst
    if not linear:
        linearise_kept(t, system, loops)
    if not factored:
        factorise_anyway(system)
    project_velocities(y, out, system, lost, stale)
    if pivot_lengths(system, out[4:]) > 0 and out[1] == 0.0:
        out[1] = 2.0
    if is_redundant and have_come_to_hold(system):
        out[1] = 1.0


@compiled
def have_come_to_hold(system: System) -> bool:
    """True if rows that depended on others at the start do so no more: they hold a motion now.

    Pivots of rows that still do follow the compliances; the factors are those of smaller ones then.
    """
    kept = system.tree.kept
    for j in range(kept.profile.shape[0]):
        kept.solution[j] = kept.matrix[kept.profile[j, PLACE] + j]
    multiply_loads(system)
    weigh_kept_rows(system, kept.settings[PART_OF_ROW] / LESS)
    factor_profile(system)
    for j in range(kept.profile.shape[0]):
        inverse = kept.matrix[kept.profile[j, PLACE] + j]
        if kept.smallest[j] == 0.0 and inverse < HELD * kept.solution[j]:
            return True
    return False


@compiled
def project_velocities(y: Floats, out: Floats, system: System, lost: float, stale: bool) -> None:
    """The velocities' part of ``project_onto_kept``, with D of this pose.

    stale: the factors are those of the pose before positions moved.
    """
    lacking_velocities(system)
    worst = largest_lacking(system)
    limit = system.settings[TOLERANCE_V] * size_of_motions(system)
    if not worst <= limit:
        for _ in range(PASSES):
            before = worst
            spread_change(system)
            change_rates(y, system.tree.slope, system)
            place_tree(y, system)
            lacking_velocities(system)
            worst = largest_lacking(system)
            if not worst > limit or not (stale or worst < 0.5 * before):
                break
            if stale and not worst < REFACTOR_RATIO * before:
                factorise_anyway(system)
                stale = False
        out[0] = 1.0
        if not worst <= lost * limit:
            out[1] = 1.0
    out[3] = worst


@compiled_into
def aim_at_positions(system: System) -> None:
    """``right``: -C of the kept rows."""
    kept = system.tree.kept
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, FIRST], kept.cuts[q, FIRST_ROW]
        for r in range(kept.cuts[q, ROW_COUNT]):
            kept.right[first + r] = -system.residual[place + r]


@compiled
def spread_change(system: System) -> None:
    """The least change of motion that gives the rows ``right``: its rates into ``slope``."""
    solve_profile(system)
    rest(system)
    push_freedoms(system)
    spread_tree(system.tree.slope, system.tree.slope, system)


@compiled
def displace(y: Floats, change: Floats, system: System) -> None:
    """Change coordinates by a displacement, which stands among the rates of ``change``."""
    nodes = system.tree.nodes
    for n in range(1, nodes.shape[0]):
        motion, i, j = nodes[n, MOTION], nodes[n, COORDINATE], nodes[n, RATE]
        if motion == FREE:
            for c in range(3):
                y[i + c] += change[j + c]
            i, j = i + 3, j + 3
        if motion >= SPHERICAL:
            turn_by(y, i, vector_of(change, j))
        elif motion != FIXED:
            y[i] += change[j]


@compiled_into
def turn_by(y: Floats, i: int, a: Any) -> None:
    """Turn the Euler parameters at i by a small rotation vector in the axes of the node."""
    e0, e1, e2, e3 = y[i], y[i + 1], y[i + 2], y[i + 3]
    a0, a1, a2 = 0.5 * a[0], 0.5 * a[1], 0.5 * a[2]
    f0, f1 = e0 - e1 * a0 - e2 * a1 - e3 * a2, e1 + e0 * a0 - e3 * a1 + e2 * a2
    f2, f3 = e2 + e3 * a0 + e0 * a1 - e1 * a2, e3 - e2 * a0 + e1 * a1 + e0 * a2
    h = 1.0 / np.sqrt(f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3)
    put(y, i, (f0 * h, f1 * h, f2 * h))
    y[i + 3] = f3 * h


@compiled
def change_rates(y: Floats, change: Floats, system: System) -> None:
    """Add the rates of ``change`` to those of the state."""
    nodes = system.tree.nodes
    for n in range(1, nodes.shape[0]):
        motion, j = nodes[n, MOTION], nodes[n, RATE]
        count = 6 if motion == FREE else 3 if motion == SPHERICAL else 1
        if motion != FIXED:
            for c in range(count):
                y[j + c] += change[j + c]


@compiled
def largest_lacking(system: System) -> float:
    """Largest of ``right``, m/s; NaN where one is NaN."""
    kept, worst = system.tree.kept, 0.0
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, FIRST], kept.cuts[q, FIRST_ROW]
        for r in range(kept.cuts[q, ROW_COUNT]):
            size = abs(kept.right[first + r]) * system.weight[place + r]
            worst = where((size > worst) | (size != size), size, worst)
    return worst


@compiled
def size_of_places(system: System) -> float:
    """The length of the scene and the largest coordinate of the bodies, m."""
    body, largest = system.body, 0.0
    for b in range(1, body.shape[0]):
        for c in range(R, R + 3):
            largest = where(abs(body[b, c]) > largest, abs(body[b, c]), largest)
    return system.settings[LENGTH] + largest


@compiled
def size_of_motions(system: System) -> float:
    """The same of velocities, m/s: of a radian that length."""
    body, largest, length = system.body, 0.0, system.settings[LENGTH]
    for b in range(1, body.shape[0]):
        for c in range(3):
            v, w = abs(body[b, V + c]), length * abs(body[b, W + c])
            largest = where(v > largest, v, largest)
            largest = where(w > largest, w, largest)
    return length + largest
