"""The system: every array that the compiled driver works on.

Made from a model and its elimination plan (formulations/arrays.py). The arrays are handed on by one
address; the loops are an argument of their own (docs/decisions/0001).
"""

from typing import Annotated, Any

import attrs

from dap3d_core.kernels.array_types import Floats as Floats
from dap3d_core.kernels.array_types import Integers as Integers
from dap3d_core.kernels.compiler.types import Table
from dap3d_core.kernels.runtime.array_struct import Arrays, IntegerMatrix, Matrix
from dap3d_core.kernels.runtime.cache import compiled_into, table_of
from dap3d_core.kernels.runtime.function_lists import LoopArrays, step_signature
from dap3d_core.model.state_layout import COORDINATES, STATE, VELOCITIES

#: The order of the group loops in the list: all loops of one kind stand together.
KINDS = (
    "value", "wrench", "energy", "acceleration", "position", "friction", "angle", "turned",
    "switch", "bound", "knot", "rate", "impulse", "reset"
)  # fmt: skip
(
    VALUE, WRENCH, ENERGY, ACCELERATION, POSITION, FRICTION, ANGLE, TURNED, SWITCH, BOUND, KNOT,
    RATE, IMPULSE, RESET
) = range(len(KINDS))  # fmt: skip

# What a switch does where it becomes negative, or changes its sign: the run ends; the integration
# begins anew; the same without a note, between laws that join smoothly, and between others;
# velocities or states jump; so they do, and a mode of a contact ends.
ENDS, BEGINS, UNSEEN, SEAM, JUMPS, MODE_ENDS = 1, 0, -1, -2, 2, 3

# Places in ``settings``: projection tolerances of position and velocity, a scratch number, how
# often the multipliers did not settle with friction, the numbers of the penalty formulation, how
# often a pose was singular where something was reported, the length that tolerances speak of
# (Model.length), 1.0 where pivots are those of equal masses, a scratch number of angles whose turns
# are in doubt, 1.0 where forces read reactions: multipliers that do not settle end a run; and 1.0
# where masses or moments of inertia make some rows weak.
(
    TOLERANCE_C, TOLERANCE_V, SCRATCH, UNSETTLED, ALPHA, OMEGA, MU, SINGULAR, LENGTH, EVEN,
    DOUBTFUL, JAMS, WEAK, SETTINGS
) = range(14)  # fmt: skip

#: Of a contact, the column of its first state, its mode, in ``contacts``; behind which stands,
#: after its direction of sliding, what it is given of what contacts share.
FIRST_STATE, SHARE = 6, 4


@attrs.frozen(eq=False, kw_only=True, slots=False)
class KeptRowArrays(Arrays):
    """Arrays of rows that are kept on a tree; columns as in formulations/joint_loops/layout.py.

    A kept row is a load on the bodies of its joint, which is carried to ground node by node; m rows
    are kept.
    """

    calls: IntegerMatrix  # (calls, 4) loop, i0, p0, count: of accelerations, then of positions
    call_counts: Integers  # (2,) calls of each of the two
    cuts: IntegerMatrix  # (joints, CUT_WIDTH)
    ends: IntegerMatrix  # (ends, END_WIDTH) bodies of the joints
    ways: IntegerMatrix  # (steps, STEP_WIDTH) nodes that a joint's loads pass, children first
    pairs: IntegerMatrix  # (pairs, PAIR_WIDTH) joints whose loads meet at a node
    profile: IntegerMatrix  # (m, 2) first row that a row couples with; its place in ``matrix``
    D: Floats  # as ``System.D``, along global axes; of the kept rows alone
    loads: Floats  # what loads do along the freedoms of the nodes that they pass
    carried: Floats  # (6 rows steps,) scratch: loads of one joint on their way
    matrix: Floats  # G M^-1 G^T of the kept rows, lower triangle within its profile; its factors
    compliance: Floats  # (m,) E, which regularises rows that may depend on each other
    right: Floats  # (m,) right-hand side
    solution: Floats  # (m,) scratch
    multipliers: Floats  # (m,) lambda
    smallest: Floats  # (m,) a pivot not above this is near a singular pose
    settings: Floats  # (2,) as of formulations/joint_loops/layout.py


@attrs.frozen(eq=False, kw_only=True, slots=False)
class TreeArrays(Arrays):
    """Arrays of a tree; their columns are those of formulations/joint/node_layout.py."""

    nodes: IntegerMatrix  # (nodes, TREE_WIDTH), ground first
    joints: IntegerMatrix  # (joints, JOINT_WIDTH), children before parents
    places: Matrix  # (n+1+massless, BODY_WIDTH): ``System.body``, then massless nodes
    constants: Floats  # (nodes * CONSTANT_WIDTH,)
    work: Floats  # (nodes * WORK_WIDTH,)
    half_angles: Matrix  # (2, revolutes) sine and cosine of q/2
    scratch: Floats  # (48,) of one joint
    force: Floats  # (6 (n+1),) applied forces with friction
    slope: Floats  # (state,) rates that nobody reads
    kept: Annotated[Any, KeptRowArrays] = None  # where rows are kept on the tree


@attrs.frozen(eq=False, kw_only=True, slots=False)
class System(LoopArrays):
    """Arrays of the driver. n bodies, ground is 0; rows in the order of the plan."""

    metric: Matrix  # (n+1, METRIC_WIDTH): 1/sqrt(m); U = L^-T, upper triangle; B = A U; w'; by rows
    force: Floats  # (6 (n+1),) applied force and moment on each body, global axes
    acceleration: Floats  # (6 (n+1),) scaled; until it is solved for, the scaled forces
    velocity: Floats  # (6 (n+1),) scaled
    change: Floats  # (6 (n+1),) scaled displacement, or change of velocity or acceleration
    gamma: Floats  # (rows,) right-hand side of the acceleration level
    nu: Floats  # (rows,) right-hand side of the velocity level
    residual: Floats  # (rows,) of the level evaluated last: C, D v - nu or D a - gamma
    multipliers: Floats  # (rows,) -lambda; until it is solved for, the right-hand side of the rows
    right_side: Floats  # (rows,) right-hand side where it is not gamma (penalty.py, lsq.py)
    total: Floats  # (rows,) sum of the multipliers of all passes (regularised.py)
    compliance: Floats  # (rows,) E, which regularises the rows
    D: Floats  # blocks of the Jacobian
    K: Floats  # blocks of what remains to be factored
    weight: Floats  # (rows,) from a row's residual to one in m: 1 in scenes of ordinary size
    smallest: Floats  # (rows,) a pivot not above this is singular
    settings: Floats  # (SETTINGS,) see above
    friction: Floats  # where forces depend on multipliers (common/friction.py: memory_size)
    watched: Floats  # of contacts: t, y, dy/dt where switches were read (contacts/equations.py)
    groups: IntegerMatrix  # (loops, 3) i0, p0, count
    kinds: Integers  # (KINDS + 1,) first loop of each kind
    row: Integers  # (model rows,) place of each constraint row in the row vectors
    blocks: IntegerMatrix  # from here on as in linear.Plan
    targets: IntegerMatrix
    contributions: IntegerMatrix
    nodes: IntegerMatrix
    columns: IntegerMatrix
    updates: IntegerMatrix
    hubs: IntegerMatrix
    turns: IntegerMatrix  # (angles of joints, COLUMNS) as in assembly/turns.py
    contacts: IntegerMatrix  # (contacts, COLUMNS) as in formulations/contacts/equations.py
    tree: Annotated[Any, TreeArrays] = None  # where the state is that of a tree


#: Part of the state of a run: ``par`` holds the turns of angles and the numbers that an
#: event has set, ``settings`` counts. All else is constant, found at the start of a run
#: (``smallest``), or scratch: a right-hand side, projection, report or stage writes what it reads,
#: factors too. A projection may use those of the right-hand side before it: both are of one step.
#: No iteration begins with what another left, so that equal states have equal rates.
CHECKPOINTED = ("par", "settings")

STEP = step_signature(System.type_of())
STEPS = Table(STEP)


def step_functions(*functions: Any) -> Any:
    """A formulation's functions (t, y, out, system, loops) as an integrator takes them."""
    return table_of(STEP, functions)


@compiled_into
def coordinate_offset(b: int) -> int:
    """Index of the first coordinate of body b."""
    return COORDINATES * (b - 1)


@compiled_into
def velocity_offset(b: int, n: int) -> int:
    """Index of the first velocity of body b of n."""
    return COORDINATES * n + VELOCITIES * (b - 1)


@compiled_into
def states_offset(n: int) -> int:
    """Index of the first state of an element, in coordinates of n bodies; the work is last."""
    return STATE * n
