"""Arrays of a tree in joint coordinates, a member of the system (formulations/joint)."""

from typing import Any, ClassVar

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.runtime.array_struct import INTEGER_MATRIX, MATRIX, Arrays

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@attrs.frozen(eq=False, kw_only=True, slots=False)
class TreeArrays(Arrays):
    """Arrays of a tree; their columns are those of formulations/joint/node_layout.py."""

    types: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("nodes", "joints"), INTEGER_MATRIX),
        **dict.fromkeys(("places", "half_angles"), MATRIX),
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
