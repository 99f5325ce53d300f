"""Articulated inertias and the forces that are missing, from the leaves to ground.

All that hangs on a node resists an acceleration (alpha, a) of its point P by [J H; H^T M] (alpha;
a), if the joints beyond give way. A joint's own freedom S is eliminated by its share of an LDL^T:
with U = [J H; H^T M] S and D = S^T U there remain [J H; H^T M] - U D^-1 U^T for the parent.

Featherstone, Rigid Body Dynamics Algorithms (2008), 7.2; Jain, Robot and Multibody Dynamics (2011),
6.1. Here about the joint's point and along the global axes, where nothing has to be turned.
"""

from typing import Any

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.metric import gyroscopic_moment
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint.place import put, times
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A, V, W, vector_in
from dap3d_core.kernels.vectors import add, cross, dot, scale, sub

Vector = Any
#: Symmetric matrix, by rows of its upper triangle; any 3x3 matrix, by rows.
Symmetric = Any
Matrix = Any
NOTHING, NO_MATRIX = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compiled
def reduce_tree(system: System, forces: Floats) -> float:
    """Articulated inertias of all nodes into ``tree.work``; returns the power of the forces.

    forces: (6 (n+1),) force and moment about the mass centre on each body, global axes.
    """
    return reduce_nodes(system, forces, False)


@compiled_into
def reduce_nodes(system: System, forces: Floats, keeps: bool) -> float:
    """``reduce_tree``; keeps: D^-1 of each freedom, or factors of D, stay, for rows on the tree."""
    tree, b = pointer(system.tree.nodes), pointer(system.tree.places)
    K, C, F = pointer(system.tree.work), pointer(system.tree.constants), pointer(forces)
    power = 0.0
    for n in range(system.tree.nodes.shape[0] - 1, 0, -1):
        t, k, c = node.TREE_WIDTH * n, node.WORK_WIDTH * n, node.CONSTANT_WIDTH * n
        motion, flags, row = tree[t + node.MOTION], tree[t + node.FLAGS], tree[t + node.ROW]
        M, H, J, moment, force = NO_INERTIA, NO_MATRIX, NO_INERTIA, NOTHING, NOTHING
        if flags & node.HAS_MASS != 0:
            o, f, couple = BODY_WIDTH * row, vector_in(F, 6 * row), vector_in(F, 6 * row + 3)
            if flags & node.IS_ALONE != 0:
                power += accelerate_alone(motion, b, o, C, c, K, k, f, couple)
                continue
            w = vector_in(b, o + W)
            power += dot(f, vector_in(b, o + V)) + dot(couple, w)
            J = own_inertia(b, o, C, c)
            M, H = own_mass(C[c + node.MASS], vector_in(K, k + node.CENTRE_NOW))
            moment, force = missing(J, C[c + node.MASS], w, K, k, f, couple)
            if motion < node.SPHERICAL:
                moment = sub(moment, symmetric_times(J, vector_in(K, k + node.ALPHA)))
        if flags & node.HAS_CHILDREN != 0:
            M, H = add_own_mass(M, H, six_of(K, k + node.MATRIX_M), nine_of(K, k + node.MATRIX_H))
            J = sum6(J, six_of(K, k + node.MATRIX_J))
            moment = add(moment, vector_in(K, k + node.MOMENT))
            force = add(force, vector_in(K, k + node.FORCE))
        m, is_first = node.WORK_WIDTH * tree[t + node.PARENT], flags & node.IS_FIRST != 0
        arm = vector_in(K, k + node.LINK_NOW)
        if motion == node.REVOLUTE:
            M, H, J, moment, force = release_turn(K, k, M, H, J, moment, force, keeps)
            if m != 0:
                H, J, moment = carry(arm, M, H, J, moment, force)
                add_to_parent(K, m, is_first, M, H, J, moment, force)
        elif motion == node.SPHERICAL:
            if keeps:
                put_six(K, k + node.FACTORS_BALL, factors_of(J))
            M, force = release_rotation(K, k, M, H, J, moment, force)
            if m != 0:
                H, J, moment = carry_ball(arm, M, force)
                add_to_parent(K, m, is_first, M, H, J, moment, force)
        elif motion == node.FREE:
            if keeps:
                put_six(K, k + node.FACTORS_FREE, factors_of(J))
            M, force = release_rotation(K, k, M, H, J, moment, force)
            put_six(K, k + node.MATRIX_M, M)
            put(K, k + node.FORCE, force)
        else:
            if motion == node.PRISMATIC:
                M, H, J, moment, force = release_slide(K, k, M, H, J, moment, force, keeps)
            if m != 0:
                H, J, moment = carry(arm, M, H, J, moment, force)
                add_to_parent(K, m, is_first, M, H, J, moment, force)
    return power


@compiled_into
def own_inertia(b: Floats, o: int, C: Floats, c: int) -> Symmetric:
    """Inertia of a body about P, global axes: A J' A^T."""
    J = six_of(C, c + node.INERTIA)
    one, two, three = vector_in(b, o + A), vector_in(b, o + A + 3), vector_in(b, o + A + 6)
    x, y, z = symmetric_times(J, one), symmetric_times(J, two), symmetric_times(J, three)
    return dot(x, one), dot(x, two), dot(x, three), dot(y, two), dot(y, three), dot(z, three)


@compiled_into
def own_mass(mass: float, s: Vector) -> Any:
    """M and H of a body, m and m s~; s: from P to the mass centre."""
    x, y, z = mass * s[0], mass * s[1], mass * s[2]
    return (mass, 0.0, 0.0, mass, 0.0, mass), (0.0, -z, y, z, 0.0, -x, -y, x, 0.0)


@compiled_into
def add_own_mass(m: Symmetric, h: Matrix, M: Symmetric, H: Matrix) -> Any:
    """Sums of ``own_mass``, m and h, whose zeros are left out, with M and H."""
    return (
        (m[0] + M[0], M[1], M[2], m[3] + M[3], M[4], m[5] + M[5]),
        (H[0], h[1] + H[1], h[2] + H[2], h[3] + H[3], H[4], h[5] + H[5], h[6] + H[6], h[7] + H[7],
         H[8]),
    )  # fmt: skip


@compiled_into
def missing(J: Symmetric, mass: float, w: Vector, K: Floats, k: int, f: Vector, n: Vector) -> Any:
    """Moment about P and force less those that the motion without q_ddot takes; f, n: applied.

    The moment is without J alpha, which is zero where the state has angular velocities as such.
    """
    s, a = vector_in(K, k + node.CENTRE_NOW), vector_in(K, k + node.ACCELERATION)
    centre = add(a, times(K, k + node.SPIN, s))
    moment = add(n, cross(s, sub(f, scale(mass, a))))
    return sub(moment, cross(w, symmetric_times(J, w))), sub(f, scale(mass, centre))


@compiled_into
def accelerate_alone(
    motion: int, b: Floats, o: int, C: Floats, c: int, K: Floats, k: int, f: Vector, n: Vector
) -> float:
    """Store the rates of a body that is alone: ground does not move, and J' is constant.

    Returns the power of its forces, by moments about P: ground has none of it. What only turns is
    taken in the body's axes, where its velocities and moments of inertia are.
    """
    J, turn = six_of(C, c + node.INERTIA), nine_of(b, o + A)
    if motion >= node.SPHERICAL:
        w = vector_in(K, k + node.OWN_W)
        moment = cross(vector_in(C, c + node.CENTRE), transposed_times(turn, f))
        moment = add(transposed_times(turn, n), moment)
        lacking = sub(moment, gyroscopic_moment(J, w))
        put(K, k + node.MOMENT, solve_factored(factors_of(J), lacking))
        put(K, k + node.FORCE, scale(1.0 / C[c + node.MASS], f))
        return dot(moment, w) + dot(f, vector_in(K, k + node.VELOCITY))
    if motion == node.REVOLUTE:
        axis = vector_in(K, k + node.AXIS_NOW)
        own = transposed_times(turn, axis)
        lack = dot(axis, add(n, cross(vector_in(K, k + node.CENTRE_NOW), f)))
        K[k + node.FREE_RATE] = lack * (1.0 / dot(own, symmetric_times(J, own)))
    elif motion == node.PRISMATIC:
        K[k + node.FREE_RATE] = dot(vector_in(K, k + node.AXIS_NOW), f) * (1.0 / C[c + node.MASS])
    return dot(f, vector_in(b, o + V)) + dot(n, vector_in(b, o + W))


@compiled_into
def release_turn(
    K: Floats, k: int, M: Symmetric, H: Matrix, J: Symmetric, moment: Vector, force: Vector,
    keeps: bool,
) -> Any:  # fmt: skip
    """Eliminate a rotation about an axis through P."""
    axis = vector_in(K, k + node.AXIS_NOW)
    u, v = symmetric_times(J, axis), transposed_times(H, axis)
    d, lack = dot(axis, u), dot(axis, moment)
    return release(K, k, u, v, d, lack, M, H, J, moment, force, keeps)


@compiled_into
def release_slide(
    K: Floats, k: int, M: Symmetric, H: Matrix, J: Symmetric, moment: Vector, force: Vector,
    keeps: bool,
) -> Any:  # fmt: skip
    """Eliminate a translation along an axis."""
    axis = vector_in(K, k + node.AXIS_NOW)
    u, v = matrix_times(H, axis), symmetric_times(M, axis)
    d, lack = dot(axis, v), dot(axis, force)
    return release(K, k, u, v, d, lack, M, H, J, moment, force, keeps)


@compiled_into
def release(
    K: Floats, k: int, u: Vector, v: Vector, d: float, lack: float,
    M: Symmetric, H: Matrix, J: Symmetric, moment: Vector, force: Vector, keeps: bool,
) -> Any:  # fmt: skip
    """Eliminate one freedom, with U = (u, v), D = d and what its equation lacks."""
    part = 1.0 / d
    rate = lack * part
    g, h = scale(part, u), scale(part, v)
    put(K, k + node.GAIN, g)
    put(K, k + node.GAIN + 3, h)
    K[k + node.FREE_RATE] = rate
    if keeps:
        K[k + node.INVERSE] = part
    J = (J[0] - u[0] * g[0], J[1] - u[0] * g[1], J[2] - u[0] * g[2],
         J[3] - u[1] * g[1], J[4] - u[1] * g[2], J[5] - u[2] * g[2])  # fmt: skip
    H = (H[0] - u[0] * h[0], H[1] - u[0] * h[1], H[2] - u[0] * h[2],
         H[3] - u[1] * h[0], H[4] - u[1] * h[1], H[5] - u[1] * h[2],
         H[6] - u[2] * h[0], H[7] - u[2] * h[1], H[8] - u[2] * h[2])  # fmt: skip
    M = (M[0] - v[0] * h[0], M[1] - v[0] * h[1], M[2] - v[0] * h[2],
         M[3] - v[1] * h[1], M[4] - v[1] * h[2], M[5] - v[2] * h[2])  # fmt: skip
    return M, H, J, sub(moment, scale(rate, u)), sub(force, scale(rate, v))


@compiled_into
def release_rotation(
    K: Floats, k: int, M: Symmetric, H: Matrix, J: Symmetric, moment: Vector, force: Vector
) -> Any:
    """Eliminate all rotations about P: M and force are left. Stores J^-1 H and J^-1 n."""
    L = factors_of(J)
    x = solve_factored(L, (H[0], H[3], H[6]))
    y = solve_factored(L, (H[1], H[4], H[7]))
    z = solve_factored(L, (H[2], H[5], H[8]))
    rate = solve_factored(L, moment)
    put(K, k + node.MATRIX_H, (x[0], y[0], z[0]))
    put(K, k + node.MATRIX_H + 3, (x[1], y[1], z[1]))
    put(K, k + node.MATRIX_H + 6, (x[2], y[2], z[2]))
    put(K, k + node.MOMENT, rate)
    M = (
        M[0] - (H[0] * x[0] + H[3] * x[1] + H[6] * x[2]),
        M[1] - (H[0] * y[0] + H[3] * y[1] + H[6] * y[2]),
        M[2] - (H[0] * z[0] + H[3] * z[1] + H[6] * z[2]),
        M[3] - (H[1] * y[0] + H[4] * y[1] + H[7] * y[2]),
        M[4] - (H[1] * z[0] + H[4] * z[1] + H[7] * z[2]),
        M[5] - (H[2] * z[0] + H[5] * z[1] + H[8] * z[2]),
    )
    return M, sub(force, transposed_times(H, rate))


@compiled_into
def factors_of(S: Symmetric) -> Symmetric:
    """L and D^-1 of S = L D L^T, positive definite: 1/d0, l10, l20, 1/d1, l21, 1/d2.

    Not by cofactors, which would lose the accelerations of a thin body in all directions: here the
    digits that its moment of inertia has not are lost about its axis alone.

    The three divisions wait for no other: d1 = m1/d0, d2 = m2/(d0 m1) with minors of S.
    """
    i0 = 1.0 / S[0]
    m1, x = S[0] * S[3] - S[1] * S[1], S[0] * S[4] - S[1] * S[2]
    part, m2 = 1.0 / m1, m1 * (S[0] * S[5] - S[2] * S[2]) - x * x
    return i0, S[1] * i0, S[2] * i0, S[0] * part, x * part, S[0] * m1 / m2


@compiled_into
def solve_factored(L: Symmetric, b: Vector) -> Vector:
    """Solution of S x = b; L: ``factors_of`` S."""
    i0, l1, l2, i1, l3, i2 = L
    y = b[1] - l1 * b[0]
    x2 = (b[2] - l2 * b[0] - l3 * y) * i2
    x1 = y * i1 - l3 * x2
    return b[0] * i0 - l1 * x1 - l2 * x2, x1, x2


@compiled_into
def carry(r: Vector, M: Symmetric, H: Matrix, J: Symmetric, n: Vector, f: Vector) -> Any:
    """H, J and moment about the parent's point; r: from there to P.

    H' = H + r~ M, J' = J + r~ H^T - H' r~, n' = n + r x f.
    """
    r0, r1, r2 = r
    m0, m1, m2, m3, m4, m5 = M
    G = (
        H[0] + (r1 * m2 - r2 * m1), H[1] + (r1 * m4 - r2 * m3), H[2] + (r1 * m5 - r2 * m4),
        H[3] + (r2 * m0 - r0 * m2), H[4] + (r2 * m1 - r0 * m4), H[5] + (r2 * m2 - r0 * m5),
        H[6] + (r0 * m1 - r1 * m0), H[7] + (r0 * m3 - r1 * m1), H[8] + (r0 * m4 - r1 * m2),
    )  # fmt: skip
    L = (
        J[0] + (r1 * H[2] - r2 * H[1]) + (r1 * G[2] - r2 * G[1]),
        J[1] + (r1 * H[5] - r2 * H[4]) + (r2 * G[0] - r0 * G[2]),
        J[2] + (r1 * H[8] - r2 * H[7]) + (r0 * G[1] - r1 * G[0]),
        J[3] + (r2 * H[3] - r0 * H[5]) + (r2 * G[3] - r0 * G[5]),
        J[4] + (r2 * H[6] - r0 * H[8]) + (r0 * G[4] - r1 * G[3]),
        J[5] + (r0 * H[7] - r1 * H[6]) + (r0 * G[7] - r1 * G[6]),
    )
    return G, L, add(n, cross(r, f))


@compiled_into
def carry_ball(r: Vector, M: Symmetric, f: Vector) -> Any:
    """As ``carry`` where H, J and the moment about P are zero."""
    r0, r1, r2 = r
    m0, m1, m2, m3, m4, m5 = M
    G = (
        r1 * m2 - r2 * m1, r1 * m4 - r2 * m3, r1 * m5 - r2 * m4,
        r2 * m0 - r0 * m2, r2 * m1 - r0 * m4, r2 * m2 - r0 * m5,
        r0 * m1 - r1 * m0, r0 * m3 - r1 * m1, r0 * m4 - r1 * m2,
    )  # fmt: skip
    L = (
        r1 * G[2] - r2 * G[1], r2 * G[0] - r0 * G[2], r0 * G[1] - r1 * G[0],
        r2 * G[3] - r0 * G[5], r0 * G[4] - r1 * G[3], r0 * G[7] - r1 * G[6],
    )  # fmt: skip
    return G, L, cross(r, f)


@compiled_into
def add_to_parent(
    K: Floats, m: int, is_first: bool, M: Symmetric, H: Matrix, J: Symmetric, n: Vector, f: Vector
) -> None:
    """Add what a node leaves to its parent's share of ``tree.work``; the first one stores it."""
    if not is_first:
        M = sum6(M, six_of(K, m + node.MATRIX_M))
        H = sum9(H, nine_of(K, m + node.MATRIX_H))
        J = sum6(J, six_of(K, m + node.MATRIX_J))
        n, f = add(n, vector_in(K, m + node.MOMENT)), add(f, vector_in(K, m + node.FORCE))
    put_six(K, m + node.MATRIX_M, M)
    put(K, m + node.MATRIX_H, (H[0], H[1], H[2]))
    put(K, m + node.MATRIX_H + 3, (H[3], H[4], H[5]))
    put(K, m + node.MATRIX_H + 6, (H[6], H[7], H[8]))
    put_six(K, m + node.MATRIX_J, J)
    put(K, m + node.MOMENT, n)
    put(K, m + node.FORCE, f)


@compiled_into
def six_of(x: Floats, k: int) -> Symmetric:
    """Six numbers at k."""
    return x[k], x[k + 1], x[k + 2], x[k + 3], x[k + 4], x[k + 5]


@compiled_into
def nine_of(x: Floats, k: int) -> Matrix:
    """Nine numbers at k."""
    return x[k], x[k + 1], x[k + 2], x[k + 3], x[k + 4], x[k + 5], x[k + 6], x[k + 7], x[k + 8]


@compiled_into
def put_six(x: Floats, k: int, a: Symmetric) -> None:
    """Store six numbers at k."""
    x[k], x[k + 1], x[k + 2], x[k + 3], x[k + 4], x[k + 5] = a


@compiled_into
def sum6(a: Symmetric, b: Symmetric) -> Symmetric:
    """Sum of six numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@compiled_into
def sum9(a: Matrix, b: Matrix) -> Matrix:
    """Sum of nine numbers each."""
    return (
        a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5],
        a[6] + b[6], a[7] + b[7], a[8] + b[8],
    )  # fmt: skip


@compiled_into
def symmetric_times(S: Symmetric, a: Vector) -> Vector:
    """A symmetric matrix times a vector."""
    return (
        S[0] * a[0] + S[1] * a[1] + S[2] * a[2],
        S[1] * a[0] + S[3] * a[1] + S[4] * a[2],
        S[2] * a[0] + S[4] * a[1] + S[5] * a[2],
    )


@compiled_into
def matrix_times(H: Matrix, a: Vector) -> Vector:
    """A matrix times a vector."""
    return (
        H[0] * a[0] + H[1] * a[1] + H[2] * a[2],
        H[3] * a[0] + H[4] * a[1] + H[5] * a[2],
        H[6] * a[0] + H[7] * a[1] + H[8] * a[2],
    )


@compiled_into
def transposed_times(H: Matrix, a: Vector) -> Vector:
    """The transpose of a matrix times a vector."""
    return (
        H[0] * a[0] + H[3] * a[1] + H[6] * a[2],
        H[1] * a[0] + H[4] * a[1] + H[7] * a[2],
        H[2] * a[0] + H[5] * a[1] + H[8] * a[2],
    )
