"""Accelerations from ground to the leaves, once all inertias are known: rates of the state.

Featherstone, Rigid Body Dynamics Algorithms (2008), 7.3.
"""

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.place import Vector, put, times
from dap3d_core.formulations.joint.reduce import (
    factors_of,
    nine_of,
    six_of,
    solve_factored,
    transposed_times,
)
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A, vector_in
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub


@compiled
def spread_tree(y: Floats, out: Floats, system: System) -> None:
    """dy/dt but for the work; the part of all accelerations by q_ddot into ``tree.work``."""
    tree, b, K = pointer(system.tree.nodes), pointer(system.tree.places), pointer(system.tree.work)
    for n in range(1, system.tree.nodes.shape[0]):
        t, k = node.TREE_WIDTH * n, node.WORK_WIDTH * n
        m, o = node.WORK_WIDTH * tree[t + node.PARENT], BODY_WIDTH * tree[t + node.ROW]
        i, j, motion = tree[t + node.COORDINATE], tree[t + node.RATE], tree[t + node.MOTION]
        alpha = vector_in(K, m + node.ALPHA_Q)
        carried = cross(alpha, vector_in(K, k + node.LINK_NOW))
        a = add(vector_in(K, m + node.ACCELERATION_Q), carried)
        is_alone = tree[t + node.FLAGS] & node.IS_ALONE != 0
        if motion == node.FREE:
            a = vector_in(K, k + node.FORCE)
            if not is_alone:
                a = solve_factored(factors_of(six_of(K, k + node.MATRIX_M)), a)
            put(out, i, vector_in(y, j))
            put(out, j, a)
            i, j = i + 3, j + 3
        if motion >= node.SPHERICAL:
            if is_alone:
                own = vector_in(K, k + node.MOMENT)
                alpha = times(b, o + A, own)
            else:
                alpha = sub(vector_in(K, k + node.MOMENT), times(K, k + node.MATRIX_H, a))
                own = transposed_times(nine_of(b, o + A), alpha)
            turn_parameters(y, i, vector_in(y, j), out)
            put(out, j, own)
        elif motion != node.FIXED:
            rate = K[k + node.FREE_RATE] - dot(vector_in(K, k + node.GAIN), alpha)
            rate -= dot(vector_in(K, k + node.GAIN + 3), a)
            change = scale(rate, vector_in(K, k + node.AXIS_NOW))
            if motion == node.REVOLUTE:
                alpha = add(alpha, change)
            else:
                a = add(a, change)
            out[i], out[j] = y[j], rate
        put(K, k + node.ALPHA_Q, alpha)
        put(K, k + node.ACCELERATION_Q, a)


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
        t, k = node.TREE_WIDTH * n, node.WORK_WIDTH * n
        if tree[t + node.FLAGS] & node.HAS_MASS != 0:
            o, s = 6 * (tree[t + node.ROW] - 1), vector_in(K, k + node.CENTRE_NOW)
            alpha, a = vector_in(K, k + node.ALPHA_Q), vector_in(K, k + node.ACCELERATION_Q)
            own = add(vector_in(K, k + node.ACCELERATION), times(K, k + node.SPIN, s))
            put(out, o, add(own, add(a, cross(alpha, s))))
            put(out, o + 3, add(vector_in(K, k + node.ALPHA), alpha))
