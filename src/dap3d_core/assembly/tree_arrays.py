"""Arrays of a tree in joint coordinates, a member of the system (formulations/joint)."""

from typing import Any, ClassVar

import attrs

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.array_struct import INTEGER_MATRIX, INTEGERS, MATRIX, Arrays


@attrs.frozen(eq=False, kw_only=True, slots=False)
class KeptRowArrays(Arrays):
    """Arrays of rows that are kept on a tree; columns as in formulations/joint_loops/layout.py.

    A kept row is a load on the bodies of its joint, which is carried to ground node by node; m rows
    are kept.
    """

    types: ClassVar[dict[str, Any]] = {
        "call_counts": INTEGERS,
        **dict.fromkeys(("calls", "cuts", "ends", "ways", "pairs", "profile"), INTEGER_MATRIX),
    }

    calls: Integers  # (calls, 4) loop, i0, p0, count: of accelerations, then of positions
    call_counts: Integers  # (2,) calls of each of the two
    cuts: Integers  # (joints, CUT_WIDTH)
    ends: Integers  # (ends, END_WIDTH) bodies of the joints
    ways: Integers  # (steps, STEP_WIDTH) nodes that a joint's loads pass, children before parents
    pairs: Integers  # (pairs, PAIR_WIDTH) joints whose loads meet at a node
    profile: Integers  # (m, 2) first row that a row couples with; place of the row in ``matrix``
    D: Floats  # as ``System.D``, along global axes; of the kept rows alone
    loads: Floats  # what loads do along the freedoms of the nodes that they pass
    carried: Floats  # (6 rows steps,) scratch: loads of one joint on their way
    matrix: Floats  # G M^-1 G^T of the kept rows, lower triangle within its profile; its factors
    compliance: Floats  # (m,) E, which regularises rows that may depend on each other
    right: Floats  # (m,) right-hand side
    solution: Floats  # (m,) scratch
    multipliers: Floats  # (m,) lambda
    smallest: Floats  # (m,) a pivot not above this is near a singular pose
    settings: (
        Floats  # (1,) part of a row's square that is its compliance; 0.0: rows are independent
    )


@attrs.frozen(eq=False, kw_only=True, slots=False)
class TreeArrays(Arrays):
    """Arrays of a tree; their columns are those of formulations/joint/node_layout.py."""

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("nodes", "joints"), INTEGER_MATRIX),
        **dict.fromkeys(("places", "half_angles"), MATRIX),
        "kept": KeptRowArrays.type_of(),
    }

    nodes: Integers  # (nodes, TREE_WIDTH), ground first
    joints: Integers  # (joints, JOINT_WIDTH), children before parents
    places: Floats  # (n+1+massless, BODY_WIDTH): ``System.body``, then massless nodes
    constants: Floats  # (nodes * CONSTANT_WIDTH,)
    work: Floats  # (nodes * WORK_WIDTH,)
    half_angles: Floats  # (2, revolutes) sine and cosine of q/2
    scratch: Floats  # (48,) of one joint
    force: Floats  # (6 (n+1),) applied forces with friction
    slope: Floats  # (state,) rates that nobody reads
    kept: Any = None  # KeptRowArrays, where rows are kept on the tree
