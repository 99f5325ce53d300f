"""The joints of a group, each closed by itself: start poses, free twists, residuals elsewhere."""

from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import Floats, Integers
from dap3d_core.assembly.motion.joint_rows import JointRows
from dap3d_core.model.rigid_motion import Pose, compose, exponential

#: Residuals of a closed joint, and of one that cannot be told from it; see ``residual``.
CLOSED, OPEN = 1e-13, 1e-10
NEWTON_STEPS = 20
#: Added to J J^T of gradients of length one, which may depend on each other.
REGULAR = 1e-13
#: Singular values of gradients of length one below which rows depend on each other.
SINGULAR = 1e-6


class ClosedJoints:
    """Joints in poses with C = 0, near the ones given, and their free twists there.

    Attributes:
        rows: evaluates C and J.
        count: number of joints.
        unit: (6,) units of the numbers of a twist: the scene's length and 1.
        start: T0, poses of bodies i relative to bodies j.
        is_closed, is_regular: (m,) whether C = 0 was reached, and the rows are independent there.
        free: (m, 6, d) orthonormal columns, the null space of J, in ``unit``.
    """

    def __init__(self, rows: JointRows, pose: Pose) -> None:
        """Args:
        rows: of the joints.
        pose: of bodies i relative to bodies j, as given.
        """
        self.rows, self.count = rows, rows.count
        self.unit = np.repeat([rows.length, 1.0], 3)
        rows.place(pose)
        rows.count_turns()
        self._weight = _weights(rows.gradients())
        self.start, self.is_closed = self.closed(pose)
        rows.place(self.start)
        rows.count_turns()
        self._weight = _weights(rows.gradients())
        self.free, self.is_regular = self.free_twists(self.start)

    def residual(self, pose: Pose, base: Pose | None = None) -> Floats:
        """(m,) the largest of C at other poses: a displacement, relative to the scene and the pose.

        Rounding alone leaves some 1e-16; infinite where C is not a number. ``base``: of bodies j.
        """
        self.rows.place(pose, base)
        C = np.abs(self.rows.residuals() * self._weight)
        reach = 1.0 + np.max(np.abs(pose.r), axis=-1) / self.rows.length
        worst: Floats = np.max(C, axis=-1, initial=0.0) / reach
        return np.where(np.isfinite(worst), worst, np.inf)

    def closed(self, pose: Pose) -> tuple[Pose, Any]:
        """Poses with C = 0 near those given, by Newton's method, and whether they were found."""
        worst = self.residual(pose)
        for _ in range(NEWTON_STEPS):
            if not np.any(worst >= CLOSED):
                break
            C, J = self.rows.residuals() * self._weight, self._gradients()
            moves: Any = np.isfinite(J).all(axis=(1, 2)) & np.isfinite(C).all(axis=1)
            step = _shortest_steps(J, C, np.flatnonzero(moves & (worst >= CLOSED)))
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            pose = self.moved(pose, step / np.maximum(1.0, size))
            worst = self.residual(pose)
        return pose, worst < OPEN

    def free_twists(self, pose: Pose) -> tuple[Floats, Any]:
        """The null spaces (m, 6, d) of J at poses, and whether the rows are independent there."""
        self.rows.place(pose)
        J = self._gradients()
        finite: Any = np.isfinite(J).all(axis=(1, 2))
        _, size, directions = np.linalg.svd(np.where(finite[:, None, None], J, 0.0))
        rows = self.rows.row_count
        regular = finite & (size[:, -1] > SINGULAR) if rows <= 6 else np.zeros_like(finite)
        return np.swapaxes(directions[:, rows:], -1, -2), regular

    def moved(self, pose: Pose, twist: Floats) -> Pose:
        """Poses moved by twists (m, 6) in ``unit``."""
        return compose(pose, exponential(twist * self.unit))

    def _gradients(self) -> Floats:
        return self.rows.gradients() * self._weight[..., None]


def _shortest_steps(J: Floats, C: Floats, members: Integers) -> Floats:
    """(m, 6) the steps of Newton's method for some of the joints; zero for the others."""
    step, J, C = np.zeros((len(J), 6)), J[members], C[members, :, None]
    J_T = np.swapaxes(J, -1, -2)
    multipliers = np.linalg.solve(J @ J_T + REGULAR * np.eye(J.shape[1]), C)
    step[members] = -(J_T @ multipliers)[..., 0]
    return step


def _weights(gradients: Floats) -> Floats:
    """(m, rows) inverse lengths of gradients; 1 where there is none."""
    size = np.linalg.norm(gradients, axis=-1)
    return 1.0 / np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
