"""Multipliers of a tree's joints from its accelerations, joint by joint, from the leaves to ground.

What a body's acceleration asks for beyond the applied forces comes from its joints: a leaf has one,
whose rows D^ give D^^T lambda = a^ - g^, six equations in scaled coordinates for at most six
unknowns. What it does to the parent is taken from that one's, and so on.
"""

import numpy as np

from dap3d_core.assembly.arrays import Floats, System
from dap3d_core.assembly.metric import in_body_axes, scaled
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.kernels.runtime.array_struct import pointer
from dap3d_core.kernels.runtime.cache import compiled, compiled_into

#: Normal equations lose twice the digits that rows of a joint lack; each further pass returns some.
PASSES = 3


@compiled
def scale_accelerations(system: System, v_dot: Floats, out: Floats) -> None:
    """Scaled accelerations (6 (n+1),) from r_ddot and omega_dot (6 n,), global axes."""
    for b in range(1, system.metric.shape[0]):
        s, k, o = system.body[b], system.metric[b], 6 * b
        w0, w1, w2 = in_body_axes(s, v_dot[o - 3], v_dot[o - 2], v_dot[o - 1])
        for c in range(3):
            out[o + c] = v_dot[o - 6 + c] / k[0]
        out[o + 3], out[o + 4], out[o + 5] = scaled(k, w0, w1, w2)


@compiled
def joint_multipliers(system: System, left: Floats) -> None:
    """-lambda of the rows of the tree's joints into ``multipliers``, which are zero before.

    left: (6 (n+1),) scaled accelerations less scaled forces; what ground's joints give is left.
    """
    joints, D, x = pointer(system.tree.joints), pointer(system.D), pointer(system.multipliers)
    work, rest = system.tree.scratch, system.tree.scratch[42:]
    for q in range(system.tree.joints.shape[0]):
        j = node.JOINT_WIDTH * q
        rows, first = joints[j + node.ROW_COUNT], joints[j + node.FIRST_ROW]
        child, block = joints[j + node.CHILD], joints[j + node.CHILD_BLOCK]
        factor_products(D, block, rows, work)
        for c in range(6):
            rest[c] = left[child + c]
        for _ in range(PASSES):
            for r in range(rows):
                work[36 + r] = 0.0
                for c in range(6):
                    work[36 + r] += D[block + 6 * r + c] * rest[c]
            solve_products(rows, work)
            for r in range(rows):
                x[first + r] -= work[36 + r]
                for c in range(6):
                    rest[c] -= D[block + 6 * r + c] * work[36 + r]
        if joints[j + node.JOINT_PARENT] > 0:
            parent, block = joints[j + node.JOINT_PARENT], joints[j + node.PARENT_BLOCK]
            for r in range(rows):
                for c in range(6):
                    left[parent + c] += D[block + 6 * r + c] * x[first + r]


@compiled_into
def factor_products(D: Floats, block: int, rows: int, work: Floats) -> None:
    """D^ D^^T = L L^T of one joint into ``work``, six numbers a row, 1/l_ii on the diagonal."""
    for r in range(rows):
        for e in range(r + 1):
            s = 0.0
            for c in range(6):
                s += D[block + 6 * r + c] * D[block + 6 * e + c]
            for c in range(e):
                s -= work[6 * r + c] * work[6 * e + c]
            work[6 * r + e] = s * work[6 * e + e] if e < r else 1.0 / np.sqrt(s)


@compiled_into
def solve_products(rows: int, work: Floats) -> None:
    """Solve L L^T x = b; b and x from place 36 of ``work`` on."""
    for r in range(rows):
        s = work[36 + r]
        for c in range(r):
            s -= work[6 * r + c] * work[36 + c]
        work[36 + r] = s * work[6 * r + r]
    for r in range(rows - 1, -1, -1):
        s = work[36 + r]
        for c in range(r + 1, rows):
            s -= work[6 * c + r] * work[36 + c]
        work[36 + r] = s * work[6 * r + r]
