"""From joint coordinates to poses and velocities: ground first, every node from its parent.

What the accelerations are without q_ddot comes with it. Featherstone, Rigid Body Dynamics
Algorithms (2008), 7.3, here about the joint's point and along the global axes.
"""

from typing import Any

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.evaluate import place_states
from dap3d_core.assembly.metric import orient_by_state, put_rotation, square_of
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.half_angles import half_angles
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A, P, R, V, W, vector_in
from dap3d_core.kernels.vectors import add, cross, dot, scale

Vector = Any


@compiled_into
def put(x: Floats, k: int, a: Vector) -> None:
    """Store a 3-vector at k."""
    x[k], x[k + 1], x[k + 2] = a


@compiled_into
def times(x: Floats, k: int, a: Vector) -> Vector:
    """The 3x3 matrix at k, by rows, times a 3-vector."""
    return dot(vector_in(x, k), a), dot(vector_in(x, k + 3), a), dot(vector_in(x, k + 6), a)


@compiled
def place_tree(y: Floats, system: System) -> None:
    """Place all nodes for a state: rows r, A, v, w, p of ``tree.places``, and ``tree.work``.

    States of elements are placed, too.
    """
    place_states(y, system)
    half_angles(y, system.tree.half_angles[0], system.tree.half_angles[1])
    place_nodes(y, system)


@compiled_into
def place_nodes(y: Floats, system: System) -> None:
    """``place_tree`` once sines and cosines of half angles are known."""
    tree, b = pointer(system.tree.nodes), pointer(system.tree.places)
    K, C = pointer(system.tree.work), pointer(system.tree.constants)
    sines, cosines = system.tree.half_angles[0], system.tree.half_angles[1]
    for n in range(1, system.tree.nodes.shape[0]):
        t = node.TREE_WIDTH * n
        o, up = BODY_WIDTH * tree[t + node.ROW], BODY_WIDTH * tree[t + node.PARENT_ROW]
        k, m = node.WORK_WIDTH * n, node.WORK_WIDTH * tree[t + node.PARENT]
        c, motion = node.CONSTANT_WIDTH * n, tree[t + node.MOTION]
        i, j = tree[t + node.COORDINATE], tree[t + node.RATE]
        if motion == node.REVOLUTE:
            orient(b, o, relative(b, up, turn(C, c, sines[i], cosines[i])))
            w, alpha = revolve(y[j], b, up, K, k, m, C, c)
            link(b, up, K, k, m, C, c)
        elif motion == node.SPHERICAL:
            orient_by_state(b, o, (y[i], y[i + 1], y[i + 2], y[i + 3]))
            w, alpha = turn_freely(vector_in(y, j), b, o, K, k), (0.0, 0.0, 0.0)
            link(b, up, K, k, m, C, c)
        elif motion == node.FREE:
            orient_by_state(b, o, (y[i + 3], y[i + 4], y[i + 5], y[i + 6]))
            w, alpha = turn_freely(vector_in(y, j + 3), b, o, K, k), (0.0, 0.0, 0.0)
            put(K, k + node.POINT, vector_in(y, i))
            put(K, k + node.VELOCITY, vector_in(y, j))
            put(K, k + node.ACCELERATION, alpha)
        else:
            orient(b, o, relative(b, up, (C[c], C[c + 1], C[c + 2], C[c + 3])))
            w, alpha = vector_in(b, up + W), vector_in(K, m + node.ALPHA)
            link(b, up, K, k, m, C, c)
            if motion == node.PRISMATIC:
                slide(y[i], y[j], b, up, K, k, m, C, c)
        put(K, k + node.ALPHA, alpha)
        spin(K, k + node.SPIN, w, alpha)
        put(b, o + W, w)
        if tree[t + node.FLAGS] & node.HAS_MASS != 0:
            s = times(b, o + A, vector_in(C, c + node.CENTRE))
            put(K, k + node.CENTRE_NOW, s)
            put(b, o + R, add(vector_in(K, k + node.POINT), s))
            put(b, o + V, add(vector_in(K, k + node.VELOCITY), cross(w, s)))


@compiled_into
def turn(C: Floats, c: int, s: float, h: float) -> Any:
    """Euler parameters of a revolute motion relative to the parent; s, h: sine, cosine of q/2."""
    c, d = c + node.TURN, c + node.TURN_SIN
    return (
        C[c] * h + C[d] * s,
        C[c + 1] * h + C[d + 1] * s,
        C[c + 2] * h + C[d + 2] * s,
        C[c + 3] * h + C[d + 3] * s,
    )


@compiled_into
def relative(b: Floats, up: int, a: Any) -> Any:
    """Euler parameters of the parent times those of a relative to it."""
    p0, p1, p2, p3 = b[up + P], b[up + P + 1], b[up + P + 2], b[up + P + 3]
    return (
        (p0 * a[0] - p1 * a[1]) - (p2 * a[2] + p3 * a[3]),
        (p0 * a[1] + p1 * a[0]) + (p2 * a[3] - p3 * a[2]),
        (p0 * a[2] - p1 * a[3]) + (p2 * a[0] + p3 * a[1]),
        (p0 * a[3] + p1 * a[2]) - (p2 * a[1] - p3 * a[0]),
    )


@compiled_into
def orient(b: Floats, o: int, e: Any) -> None:
    """Set p and A of a node from Euler parameters whose length is 1 up to rounding."""
    square = square_of(e)
    put_rotation(b, o + A, e, 2.0)
    h = 1.5 - 0.5 * square
    b[o + P], b[o + P + 1], b[o + P + 2], b[o + P + 3] = e[0] * h, e[1] * h, e[2] * h, e[3] * h


@compiled_into
def revolve(rate: float, b: Floats, up: int, K: Floats, k: int, m: int, C: Floats, c: int) -> Any:
    """Angular velocity and, without q_ddot, acceleration of a revolute node; sets its axis."""
    axis = times(b, up + A, vector_in(C, c + node.AXIS))
    put(K, k + node.AXIS_NOW, axis)
    w, relative_w = vector_in(b, up + W), scale(rate, axis)
    return add(w, relative_w), add(vector_in(K, m + node.ALPHA), cross(w, relative_w))


@compiled_into
def turn_freely(own: Vector, b: Floats, o: int, K: Floats, k: int) -> Vector:
    """Angular velocity of a ball or free body, global axes; stores omega', which is given."""
    put(K, k + node.OWN_W, own)
    return times(b, o + A, own)


@compiled_into
def link(b: Floats, up: int, K: Floats, k: int, m: int, C: Floats, c: int) -> None:
    """P of a node, its velocity and acceleration as a point of the parent."""
    arm = times(b, up + A, vector_in(C, c + node.LINK))
    put(K, k + node.LINK_NOW, arm)
    put(K, k + node.POINT, add(vector_in(K, m + node.POINT), arm))
    carried, bent = cross(vector_in(b, up + W), arm), times(K, m + node.SPIN, arm)
    put(K, k + node.VELOCITY, add(vector_in(K, m + node.VELOCITY), carried))
    put(K, k + node.ACCELERATION, add(vector_in(K, m + node.ACCELERATION), bent))


@compiled_into
def slide(
    q: float, rate: float, b: Floats, up: int, K: Floats, k: int, m: int, C: Floats, c: int
) -> None:
    """Move P of a prismatic node along the parent's axis."""
    axis, w = times(b, up + A, vector_in(C, c + node.AXIS)), vector_in(b, up + W)
    way, turned = scale(q, axis), cross(w, axis)
    put(K, k + node.AXIS_NOW, axis)
    put(K, k + node.LINK_NOW, add(vector_in(K, k + node.LINK_NOW), way))
    put(K, k + node.POINT, add(vector_in(K, k + node.POINT), way))
    change = add(scale(q, turned), scale(rate, axis))
    put(K, k + node.VELOCITY, add(vector_in(K, k + node.VELOCITY), change))
    change = add(times(K, m + node.SPIN, way), scale(2.0 * rate, turned))
    put(K, k + node.ACCELERATION, add(vector_in(K, k + node.ACCELERATION), change))


@compiled_into
def spin(K: Floats, k: int, w: Vector, alpha: Vector) -> None:
    """Set the matrix alpha~ + omega~ omega~ at k."""
    w0, w1, w2 = w
    x0, x1, x2 = alpha
    K[k], K[k + 1], K[k + 2] = -w1 * w1 - w2 * w2, w0 * w1 - x2, w0 * w2 + x1
    K[k + 3], K[k + 4], K[k + 5] = w0 * w1 + x2, -w0 * w0 - w2 * w2, w1 * w2 - x0
    K[k + 6], K[k + 7], K[k + 8] = w0 * w2 - x1, w1 * w2 + x0, -w0 * w0 - w1 * w1
