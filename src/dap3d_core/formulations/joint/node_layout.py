"""Layout of the tree's arrays: nodes, their constants, what the recursion keeps of each.

A node is a body, or a massless one between two parts of a joint's motion: a cylindrical joint is a
translation to a massless node and a rotation from there. Node 0 is ground; parents come before
their children. Every node has a reference point P, fixed in it, on the joint to its parent.
"""

#: Motions of a node relative to its parent. Of SPHERICAL and FREE the state has what is absolute:
#: Euler parameters and omega' of the node; r and r_dot. They are the last.
FIXED, REVOLUTE, PRISMATIC, SPHERICAL, FREE = range(5)

#: Columns of ``TreeArrays.nodes``: row of ``TreeArrays.places``, parent, that one's row, motion,
#: indices in the state of its first coordinate and velocity, flags.
ROW, PARENT, PARENT_ROW, MOTION, COORDINATE, RATE, FLAGS, TREE_WIDTH = range(8)
#: Flags: the node has mass; it has children; it is the first to add to its parent; it hangs on
#: ground, and nothing on it.
HAS_MASS, HAS_CHILDREN, IS_FIRST, IS_ALONE = 1, 2, 4, 8

# Columns of ``TreeArrays.constants``, vectors in axes of the node (n) or of its parent (p):
# Euler parameters relative to the parent at q = 0, and what sin(q/2) multiplies; axis of a revolute
# or prismatic motion (p); from P to the mass centre (n); from the parent's P to P at q = 0 (p);
# mass; inertia about P: xx, xy, xz, yy, yz, zz (n).
TURN, TURN_SIN, AXIS, CENTRE, LINK, MASS, INERTIA, CONSTANT_WIDTH = 0, 4, 8, 11, 14, 17, 18, 24

# Columns of ``TreeArrays.work``, vectors in global axes: P, its velocity; angular acceleration and
# acceleration of P without q_ddot, and the matrix alpha~ + omega~ omega~ of these; from the
# parent's P to P; axis; from P to the mass centre;
POINT, VELOCITY, ALPHA, ACCELERATION, SPIN = 0, 3, 6, 9, 12
LINK_NOW, AXIS_NOW, CENTRE_NOW = 21, 24, 27
# articulated inertia [J H; H^T M] about P, and the moment and force that are missing there, of the
# node and all that hangs on it; omega' of a ball or free body, in its own axes.
MATRIX_M, MATRIX_H, MATRIX_J, MOMENT, FORCE, OWN_W, WORK_WIDTH = 30, 36, 45, 51, 54, 57, 60
# What an elimination leaves takes their places: U/D and u/D of one freedom; J^-1 H and J^-1 n of a
# rotation, as H and n; of a ball or free body alone omega'_dot and acceleration, as n and f; then,
# of all, the accelerations by q_ddot.
GAIN, FREE_RATE, ALPHA_Q, ACCELERATION_Q = MATRIX_M, FORCE, MATRIX_J, MATRIX_J + 3
# Where rows are kept on the tree: D^-1 of one freedom; factors of J of a ball, and of a free body,
# which has no link and no axis.
INVERSE, FACTORS_BALL, FACTORS_FREE = MATRIX_H, MATRIX_M, LINK_NOW

#: Columns of ``TreeArrays.joints``, one joint of the tree in each row, children before parents:
#: places in D of the blocks of child and parent, 6 times these bodies, rows of the joint, place of
#: the first one in the row vectors.
CHILD_BLOCK, PARENT_BLOCK, CHILD, JOINT_PARENT, ROW_COUNT, FIRST_ROW, JOINT_WIDTH = range(7)
