"""Accelerations from ground to the leaves, once all inertias are known: rates of the state.

Featherstone, Rigid Body Dynamics Algorithms (2008), 7.3.
"""

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations.joint.node_layout import (
    ACCELERATION,
    ACCELERATION_Q,
    ALPHA,
    ALPHA_Q,
    AXIS_NOW,
    CENTRE_NOW,
    COORDINATE,
    FIXED,
    FLAGS,
    FORCE,
    FREE,
    FREE_RATE,
    GAIN,
    HAS_MASS,
    IS_ALONE,
    LINK_NOW,
    MATRIX_H,
    MATRIX_M,
    MOMENT,
    MOTION,
    PARENT,
    RATE,
    REVOLUTE,
    ROW,
    SPHERICAL,
    SPIN,
    TREE_WIDTH,
    WORK_WIDTH,
)
from dap3d_core.formulations.joint.place import Vector, in_node_axes, put, times, vector_of
from dap3d_core.formulations.joint.reduce import factors_of, six_of, solve_factored
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub


@compiled
def spread_tree(y: Floats, out: Floats, system: System) -> None:
    """dy/dt but for the work; the part of all accelerations by q_ddot into ``tree.work``."""
    tree, b, K = pointer(system.tree.nodes), pointer(system.tree.places), pointer(system.tree.work)
    for n in range(1, system.tree.nodes.shape[0]):
        t, k = TREE_WIDTH * n, WORK_WIDTH * n
        m, motion, o = WORK_WIDTH * tree[t + PARENT], tree[t + MOTION], BODY_WIDTH * tree[t + ROW]
        i, j = tree[t + COORDINATE], tree[t + RATE]
        alpha = vector_of(K, m + ALPHA_Q)
        a = add(vector_of(K, m + ACCELERATION_Q), cross(alpha, vector_of(K, k + LINK_NOW)))
        is_alone = tree[t + FLAGS] & IS_ALONE != 0
        if motion == FREE:
            a = vector_of(K, k + FORCE)
            if not is_alone:
                a = solve_factored(factors_of(six_of(K, k + MATRIX_M)), a)
            put(out, i, vector_of(y, j))
            put(out, j, a)
            i, j = i + 3, j + 3
        if motion >= SPHERICAL:
            if is_alone:
                own = vector_of(K, k + MOMENT)
                alpha = times(b, o + A, own)
            else:
                alpha = sub(vector_of(K, k + MOMENT), times(K, k + MATRIX_H, a))
                own = in_node_axes(b, o, alpha)
            turn_parameters(y, i, vector_of(y, j), out)
            put(out, j, own)
        elif motion != FIXED:
            rate = K[k + FREE_RATE] - dot(vector_of(K, k + GAIN), alpha)
            rate -= dot(vector_of(K, k + GAIN + 3), a)
            change = scale(rate, vector_of(K, k + AXIS_NOW))
            if motion == REVOLUTE:
                alpha = add(alpha, change)
            else:
                a = add(a, change)
            out[i], out[j] = y[j], rate
        put(K, k + ALPHA_Q, alpha)
        put(K, k + ACCELERATION_Q, a)


@compiled_into
def turn_parameters(y: Floats, i: int, w: Vector, out: Floats) -> None:
    """Rates of the Euler parameters at i, for the angular velocity w in the node's axes."""
    e0, e1, e2, e3 = y[i], y[i + 1], y[i + 2], y[i + 3]
    w0, w1, w2 = 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]
    out[i] = -e1 * w0 - e2 * w1 - e3 * w2
    out[i + 1] = e0 * w0 - e3 * w1 + e2 * w2
    out[i + 2] = e3 * w0 + e0 * w1 - e1 * w2
    out[i + 3] = -e2 * w0 + e1 * w1 + e0 * w2


@compiled
def body_accelerations(system: System, out: Floats) -> None:
    """Accelerations (6 n,) of the bodies: r_ddot and omega_dot, global axes."""
    tree, K = pointer(system.tree.nodes), pointer(system.tree.work)
    for n in range(1, system.tree.nodes.shape[0]):
        t, k = TREE_WIDTH * n, WORK_WIDTH * n
        if tree[t + FLAGS] & HAS_MASS != 0:
            o, s = 6 * (tree[t + ROW] - 1), vector_of(K, k + CENTRE_NOW)
            alpha, a = vector_of(K, k + ALPHA_Q), vector_of(K, k + ACCELERATION_Q)
            own = add(vector_of(K, k + ACCELERATION), times(K, k + SPIN, s))
            put(out, o, add(own, add(a, cross(alpha, s))))
            put(out, o + 3, add(vector_of(K, k + ALPHA), alpha))
