"""The kept rows of a tree, as ``project_onto`` takes them (common/projection.py).

The rows of the tree itself cannot be violated.
"""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import LENGTH, Floats, System
from dap3d_core.assembly.evaluate import largest_weighted
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.equations import normalise_rotations
from dap3d_core.formulations.joint.equations import place as place  # read by projection.py
from dap3d_core.formulations.joint.place import place_tree, put
from dap3d_core.formulations.joint.reduce import reduce_nodes
from dap3d_core.formulations.joint.spread import spread_tree
from dap3d_core.formulations.joint_loops import layout, loads, profile
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import R, V, W, vector_in
from dap3d_core.kernels.scalar_math import where

#: Pivots of dependent rows fall by LESS where compliances do; where they fall by less than HELD,
#: the rows hold something themselves.
LESS, HELD = 16.0, 10.0

normalise, linearise = normalise_rotations, loads.linearise_kept


@compiled_into
def residuals(t: float, system: System, loops: Any) -> float:
    """C of the kept rows into ``residual``; the largest, m."""
    loads.kept_residuals(t, system, loops)
    return largest_weighted(system.residual, system.weight)


@compiled
def size_of_positions(y: Floats, system: System) -> float:
    """The length of the scene and the largest coordinate of the bodies, m."""
    body, largest = system.body, 0.0
    for b in range(1, body.shape[0]):
        for c in range(R, R + 3):
            largest = where(abs(body[b, c]) > largest, abs(body[b, c]), largest)
    return system.settings[LENGTH] + largest


@compiled
def factorise_anyway(system: System, part: float | None) -> bool:
    """Inertias and factors at the bodies as placed; regularised where the pose is singular.

    Returns False if it is. By how much rows that depend on each other are regularised was found at
    the start; ``part`` is not used.
    """
    reduce_nodes(system, system.force, True)
    if factorise(system, system.tree.kept.settings[layout.PART_OF_ROW]):
        return True
    factorise_anew(system, profile.PART)
    return False


@compiled
def factorise(system: System, part: float) -> bool:
    """Factors of the kept rows' matrix, of the inertias in ``tree.work``; True if they exist.

    part: of the rows' squares, that regularises them.
    """
    loads.carry_rows(system)
    return factorise_anew(system, part)


@compiled
def factorise_anew(system: System, part: float) -> bool:
    """The same of loads that rows have put already."""
    loads.multiply_loads(system)
    profile.weigh_kept_rows(system, part)
    return profile.factor_profile(system)


@compiled_into
def displace(y: Floats, system: System) -> None:
    """Move coordinates by the least change that removes C."""
    aim_at_positions(system)
    spread_change(system)
    add_displacement(y, system.tree.slope, system)
    place_tree(y, system)


@compiled_into
def velocity_residuals(system: System) -> float:
    """D v - nu of the kept rows into ``right``; the largest, m/s."""
    loads.lacking_velocities(system)
    return largest_lacking(system)


@compiled
def size_of_velocities(y: Floats, system: System) -> float:
    """The same of velocities, m/s: of a radian that length."""
    body, largest, length = system.body, 0.0, system.settings[LENGTH]
    for b in range(1, body.shape[0]):
        for c in range(3):
            v, w = abs(body[b, V + c]), length * abs(body[b, W + c])
            largest = where(v > largest, v, largest)
            largest = where(w > largest, w, largest)
    return length + largest


@compiled_into
def change_velocities(y: Floats, system: System) -> float:
    """Change rates by the least that removes D v - nu; the largest that is left."""
    spread_change(system)
    add_rates(y, system.tree.slope, system)
    place_tree(y, system)
    return velocity_residuals(system)


@compiled_into
def is_poor(t: float, system: System, loops: Any, part: float | None, lengths: Floats) -> bool:
    """True if the pose is close to a singular one."""
    return profile.pivot_lengths(system, lengths) > 0


@compiled
def have_come_to_hold(system: System) -> bool:
    """True if rows that depended on others at the start do so no more: they hold a motion now.

    Pivots of rows that still do follow the compliances; the factors are those of smaller ones then.
    """
    kept = system.tree.kept
    for j in range(kept.profile.shape[0]):
        kept.solution[j] = kept.matrix[kept.profile[j, layout.PLACE] + j]
    factorise_anew(system, kept.settings[layout.PART_OF_FACTORS] / LESS)
    for j in range(kept.profile.shape[0]):
        inverse = kept.matrix[kept.profile[j, layout.PLACE] + j]
        if kept.smallest[j] == 0.0 and inverse < HELD * kept.solution[j]:
            return True
    return False


@compiled_into
def aim_at_positions(system: System) -> None:
    """``right``: -C of the kept rows."""
    kept = system.tree.kept
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, layout.FIRST], kept.cuts[q, layout.FIRST_ROW]
        for r in range(kept.cuts[q, layout.ROW_COUNT]):
            kept.right[first + r] = -system.residual[place + r]


@compiled
def spread_change(system: System) -> None:
    """The least change of motion that gives the rows ``right``: its rates into ``slope``."""
    profile.solve_profile(system)
    loads.rest(system)
    loads.push_freedoms(system)
    spread_tree(system.tree.slope, system.tree.slope, system)


@compiled
def add_displacement(y: Floats, change: Floats, system: System) -> None:
    """Change coordinates by a displacement, which stands among the rates of ``change``."""
    nodes = system.tree.nodes
    for n in range(1, nodes.shape[0]):
        motion, i, j = nodes[n, node.MOTION], nodes[n, node.COORDINATE], nodes[n, node.RATE]
        if motion == node.FREE:
            for c in range(3):
                y[i + c] += change[j + c]
            i, j = i + 3, j + 3
        if motion >= node.SPHERICAL:
            turn_by(y, i, vector_in(change, j))
        elif motion != node.FIXED:
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
def add_rates(y: Floats, change: Floats, system: System) -> None:
    """Add the rates of ``change`` to those of the state."""
    nodes = system.tree.nodes
    for n in range(1, nodes.shape[0]):
        motion, j = nodes[n, node.MOTION], nodes[n, node.RATE]
        count = 6 if motion == node.FREE else 3 if motion == node.SPHERICAL else 1
        if motion != node.FIXED:
            for c in range(count):
                y[j + c] += change[j + c]


@compiled
def largest_lacking(system: System) -> float:
    """Largest of ``right``, m/s; NaN where one is NaN."""
    kept, worst = system.tree.kept, 0.0
    for q in range(kept.cuts.shape[0]):
        first, place = kept.cuts[q, layout.FIRST], kept.cuts[q, layout.FIRST_ROW]
        for r in range(kept.cuts[q, layout.ROW_COUNT]):
            size = abs(kept.right[first + r]) * system.weight[place + r]
            worst = where((size > worst) | (size != size), size, worst)
    return worst
