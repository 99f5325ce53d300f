"""Kept rows as loads on a tree: what they do along its freedoms, and what they lack.

A row is a load on the bodies of its joint. Carried to ground against articulated inertias it does g
along the freedom of each node that it passes, and

    G M^-1 G^T = sum of g D^-1 g^T,      M^-1 the inverse of the tree's mass matrix,

where D is the articulated inertia of the freedom (joint/reduce.py). Featherstone, Efficient
factorization of the joint-space inertia matrix for branched kinematic trees (2005); Jain, Robot and
Multibody Dynamics (2011), 10.4.
"""

from typing import Any

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import zero
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.place import put, times
from dap3d_core.formulations.joint.reduce import (
    factors_of,
    nine_of,
    six_of,
    solve_factored,
    transposed_times,
)
from dap3d_core.formulations.joint_loops import layout
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, V, W, vector_in
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub


@compiled
def linearise_kept(t: float, system: System, loops: Any) -> None:
    """D, gamma and nu of the kept rows at the bodies as placed; D along global axes."""
    calls, kept = system.tree.kept.calls, system.tree.kept
    D, gamma, nu = pointer(kept.D), pointer(system.gamma), pointer(system.nu)
    for q in range(kept.call_counts[0]):
        loop = loops[calls[q, 0]]
        loop(t, system, calls[q, 1], calls[q, 2], calls[q, 3], D, gamma, nu)


@compiled
def kept_residuals(t: float, system: System, loops: Any) -> None:
    """C of the kept rows into ``residual``, zero of all others."""
    calls, kept, C = system.tree.kept.calls, system.tree.kept, pointer(system.residual)
    zero(system.residual)
    first = kept.call_counts[0]
    for q in range(first, first + kept.call_counts[1]):
        loop = loops[calls[q, 0]]
        loop(t, system, calls[q, 1], calls[q, 2], calls[q, 3], C, C, C)


@compiled
def carry_rows(system: System) -> None:
    """``loads``: g of all kept rows at all nodes that they pass; ``tree.work`` is reduced."""
    kept = system.tree.kept
    cuts, ends, ways = pointer(kept.cuts), pointer(kept.ends), pointer(kept.ways)
    D, g, x = pointer(kept.D), pointer(kept.loads), pointer(kept.carried)
    K, tree = pointer(system.tree.work), pointer(system.tree.nodes)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        rows, first = cuts[c + layout.ROW_COUNT], cuts[c + layout.FIRST_STEP]
        for i in range(6 * rows * (cuts[c + layout.LAST_STEP] - first)):
            x[i] = 0.0
        for e in range(cuts[c + layout.FIRST_END], cuts[c + layout.LAST_END]):
            end = layout.END_WIDTH * e
            step, block = ends[end + layout.END_STEP], ends[end + layout.END_BLOCK]
            k, at = node.WORK_WIDTH * ways[layout.STEP_WIDTH * step + layout.NODE], step - first
            apply_rows(D, block, rows, vector_in(K, k + node.CENTRE_NOW), x, 6 * rows * at)
        for step in range(first, cuts[c + layout.LAST_STEP]):
            s = layout.STEP_WIDTH * step
            n, at = ways[s + layout.NODE], 6 * rows * (step - first)
            k, motion = node.WORK_WIDTH * n, tree[node.TREE_WIDTH * n + node.MOTION]
            place = ways[s + layout.LOADS]
            if motion == node.REVOLUTE:
                pass_axis(K, k, rows, x, at, g, place, 0)
            elif motion == node.PRISMATIC:
                pass_axis(K, k, rows, x, at, g, place, 3)
            elif motion == node.SPHERICAL:
                pass_ball(K, k, rows, x, at, g, place, 3)
            elif motion == node.FREE:
                pass_ball(K, k, rows, x, at, g, place, 6)
            if ways[s + layout.NEXT_STEP] >= 0:
                up = 6 * rows * (ways[s + layout.NEXT_STEP] - first)
                carry_on(vector_in(K, k + node.LINK_NOW), rows, x, at, up)


@compiled_into
def apply_rows(D: Floats, block: int, rows: int, arm: Any, x: Floats, at: int) -> None:
    """Add the loads of rows on a body, about the point P of its node; arm: to the mass centre."""
    for r in range(rows):
        d, o = block + 6 * r, at + 6 * r
        f = vector_in(D, d)
        put(x, o, add(vector_in(x, o), add(vector_in(D, d + 3), cross(arm, f))))
        put(x, o + 3, add(vector_in(x, o + 3), f))


@compiled_into
def pass_axis(
    K: Floats, k: int, rows: int, x: Floats, at: int, g: Floats, place: int, part: int
) -> None:
    """Take from loads what the freedom about an axis takes, or along it: of their part 0, or 3."""
    axis = vector_in(K, k + node.AXIS_NOW)
    u, v = vector_in(K, k + node.GAIN), vector_in(K, k + node.GAIN + 3)
    for r in range(rows):
        o = at + 6 * r
        along = dot(axis, vector_in(x, o + part))
        g[place + r] = along
        put(x, o, sub(vector_in(x, o), scale(along, u)))
        put(x, o + 3, sub(vector_in(x, o + 3), scale(along, v)))


@compiled_into
def pass_ball(
    K: Floats, k: int, rows: int, x: Floats, at: int, g: Floats, place: int, size: int
) -> None:
    """Take from loads what the freedoms of a ball take, or of a free body: all that is left."""
    H = nine_of(K, k + node.MATRIX_H)
    for r in range(rows):
        o = at + 6 * r
        moment = vector_in(x, o)
        force = sub(vector_in(x, o + 3), transposed_times(H, moment))
        put(g, place + size * r, moment)
        if size == 6:
            put(g, place + size * r + 3, force)
        put(x, o, (0.0, 0.0, 0.0))
        put(x, o + 3, force)


@compiled_into
def carry_on(link: Any, rows: int, x: Floats, at: int, up: int) -> None:
    """Add loads to those of the parent, about its point; link: from there to P."""
    for r in range(rows):
        o, p = at + 6 * r, up + 6 * r
        f = vector_in(x, o + 3)
        put(x, p, add(vector_in(x, p), add(vector_in(x, o), cross(link, f))))
        put(x, p + 3, add(vector_in(x, p + 3), f))


@compiled
def multiply_loads(system: System) -> None:
    """``matrix``: G M^-1 G^T of the kept rows, from ``loads``."""
    kept = system.tree.kept
    pairs, profile, S = pointer(kept.pairs), pointer(kept.profile), pointer(kept.matrix)
    g, K, tree = pointer(kept.loads), pointer(system.tree.work), pointer(system.tree.nodes)
    zero(kept.matrix)
    for q in range(kept.pairs.shape[0]):
        p = layout.PAIR_WIDTH * q
        k = node.WORK_WIDTH * pairs[p + layout.PAIR_NODE]
        motion = tree[node.TREE_WIDTH * pairs[p + layout.PAIR_NODE] + node.MOTION]
        left, right = pairs[p + layout.LEFT_LOADS], pairs[p + layout.RIGHT_LOADS]
        row, column = pairs[p + layout.LEFT], pairs[p + layout.RIGHT]
        for r in range(pairs[p + layout.LEFT_COUNT]):
            at = profile[layout.PROFILE_WIDTH * (row + r) + layout.PLACE] + column
            count = r + 1 if row == column else pairs[p + layout.RIGHT_COUNT]
            if motion == node.SPHERICAL:
                n = solve_factored(six_of(K, k + node.FACTORS_BALL), vector_in(g, left + 3 * r))
                for e in range(count):
                    S[at + e] += dot(n, vector_in(g, right + 3 * e))
            elif motion == node.FREE:
                n = solve_factored(six_of(K, k + node.FACTORS_FREE), vector_in(g, left + 6 * r))
                M = factors_of(six_of(K, k + node.MATRIX_M))
                f = solve_factored(M, vector_in(g, left + 6 * r + 3))
                for e in range(count):
                    o = right + 6 * e
                    S[at + e] += dot(n, vector_in(g, o)) + dot(f, vector_in(g, o + 3))
            else:
                x = g[left + r] * K[k + node.INVERSE]
                for e in range(count):
                    S[at + e] += x * g[right + e]


@compiled
def lacking_accelerations(system: System) -> None:
    """``right``: gamma less the rows' accelerations where no kept row acts, as ``reduce`` left."""
    kept = system.tree.kept
    cuts, ends, ways = pointer(kept.cuts), pointer(kept.ends), pointer(kept.ways)
    D, K, right = pointer(kept.D), pointer(system.tree.work), pointer(kept.right)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        rows, first = cuts[c + layout.ROW_COUNT], cuts[c + layout.FIRST]
        for r in range(rows):
            right[first + r] = system.gamma[cuts[c + layout.FIRST_ROW] + r]
        for e in range(cuts[c + layout.FIRST_END], cuts[c + layout.LAST_END]):
            end = layout.END_WIDTH * e
            step, block = ends[end + layout.END_STEP], ends[end + layout.END_BLOCK]
            k = node.WORK_WIDTH * ways[layout.STEP_WIDTH * step + layout.NODE]
            a = vector_in(K, k + node.ACCELERATION)
            a = add(a, times(K, k + node.SPIN, vector_in(K, k + node.CENTRE_NOW)))
            subtract_product(D, block, rows, a, vector_in(K, k + node.ALPHA), right, first)
        for step in range(cuts[c + layout.FIRST_STEP], cuts[c + layout.LAST_STEP]):
            subtract_free_rates(system, layout.STEP_WIDTH * step, rows, first)


@compiled_into
def subtract_product(
    D: Floats, block: int, rows: int, a: Any, alpha: Any, right: Floats, first: int
) -> None:
    """Subtract D (a; alpha) of one body."""
    for r in range(rows):
        d = block + 6 * r
        right[first + r] -= dot(vector_in(D, d), a) + dot(vector_in(D, d + 3), alpha)


@compiled_into
def subtract_free_rates(system: System, s: int, rows: int, first: int) -> None:
    """Subtract what the rates of a node do to rows that pass it; s: place of the step."""
    K, ways, g = pointer(system.tree.work), pointer(system.tree.kept.ways), system.tree.kept.loads
    n, right = ways[s + layout.NODE], system.tree.kept.right
    k, motion = node.WORK_WIDTH * n, system.tree.nodes[n, node.MOTION]
    place = ways[s + layout.LOADS]
    if motion == node.SPHERICAL:
        for r in range(rows):
            right[first + r] -= dot(vector_in(g, place + 3 * r), vector_in(K, k + node.MOMENT))
    elif motion == node.FREE:
        a = solve_factored(factors_of(six_of(K, k + node.MATRIX_M)), vector_in(K, k + node.FORCE))
        for r in range(rows):
            o = place + 6 * r
            along = dot(vector_in(g, o), vector_in(K, k + node.MOMENT))
            right[first + r] -= along + dot(vector_in(g, o + 3), a)
    elif motion in (node.REVOLUTE, node.PRISMATIC):
        for r in range(rows):
            right[first + r] -= g[place + r] * K[k + node.FREE_RATE]


@compiled
def lacking_velocities(system: System) -> None:
    """``right``: nu less the rows' velocities at the bodies as placed."""
    kept = system.tree.kept
    cuts, ends = pointer(kept.cuts), pointer(kept.ends)
    D, b, right = pointer(kept.D), pointer(system.tree.places), pointer(kept.right)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        rows, first = cuts[c + layout.ROW_COUNT], cuts[c + layout.FIRST]
        for r in range(rows):
            right[first + r] = system.nu[cuts[c + layout.FIRST_ROW] + r]
        for e in range(cuts[c + layout.FIRST_END], cuts[c + layout.LAST_END]):
            end = layout.END_WIDTH * e
            o, block = BODY_WIDTH * ends[end + layout.END_BODY], ends[end + layout.END_BLOCK]
            subtract_product(D, block, rows, vector_in(b, o + V), vector_in(b, o + W), right, first)


@compiled
def rest(system: System) -> None:
    """Forget the forces that ``reduce`` left: what follows is the effect of kept rows alone."""
    K, nodes = pointer(system.tree.work), system.tree.nodes
    for n in range(1, nodes.shape[0]):
        k, motion = node.WORK_WIDTH * n, nodes[n, node.MOTION]
        if motion in (node.REVOLUTE, node.PRISMATIC):
            K[k + node.FREE_RATE] = 0.0
        else:
            put(K, k + node.MOMENT, (0.0, 0.0, 0.0))
            put(K, k + node.FORCE, (0.0, 0.0, 0.0))


@compiled
def push_freedoms(system: System) -> None:
    """Add the effect of ``multipliers`` of kept rows to what ``reduce`` left for ``spread``."""
    kept = system.tree.kept
    cuts, ways = pointer(kept.cuts), pointer(kept.ways)
    g, K, tree = pointer(kept.loads), pointer(system.tree.work), pointer(system.tree.nodes)
    for q in range(kept.cuts.shape[0]):
        c = layout.CUT_WIDTH * q
        rows, x = cuts[c + layout.ROW_COUNT], kept.multipliers[cuts[c + layout.FIRST] :]
        for step in range(cuts[c + layout.FIRST_STEP], cuts[c + layout.LAST_STEP]):
            s = layout.STEP_WIDTH * step
            i, place = ways[s + layout.NODE], ways[s + layout.LOADS]
            k, motion = node.WORK_WIDTH * i, tree[node.TREE_WIDTH * i + node.MOTION]
            if motion == node.SPHERICAL:
                n = sum_of_loads(g, place, 3, rows, x)
                change = solve_factored(six_of(K, k + node.FACTORS_BALL), n)
                put(K, k + node.MOMENT, add(vector_in(K, k + node.MOMENT), change))
            elif motion == node.FREE:
                n = sum_of_loads(g, place, 6, rows, x)
                change = solve_factored(six_of(K, k + node.FACTORS_FREE), n)
                put(K, k + node.MOMENT, add(vector_in(K, k + node.MOMENT), change))
                f = sum_of_loads(g, place + 3, 6, rows, x)
                put(K, k + node.FORCE, add(vector_in(K, k + node.FORCE), f))
            elif motion in (node.REVOLUTE, node.PRISMATIC):
                total = 0.0
                for r in range(rows):
                    total += g[place + r] * x[r]
                K[k + node.FREE_RATE] += total * K[k + node.INVERSE]


@compiled_into
def sum_of_loads(g: Floats, place: int, size: int, rows: int, x: Floats) -> Any:
    """Sum of three numbers of the loads of rows, times multipliers."""
    a0, a1, a2 = 0.0, 0.0, 0.0
    for r in range(rows):
        o, factor = place + size * r, x[r]
        a0, a1, a2 = a0 + g[o] * factor, a1 + g[o + 1] * factor, a2 + g[o + 2] * factor
    return a0, a1, a2
