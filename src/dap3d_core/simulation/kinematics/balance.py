"""The balance of forces at one instant of a motion: joints, actuators and closed contacts."""

from collections.abc import Sequence

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.kinematics.actuators import Actuator, DriverActuator
from dap3d_core.simulation.kinematics.closed_contacts import Closed, ContactForces
from dap3d_core.simulation.kinematics.pose_equations import ChosenRows, Flags

#: Singular values of the actuation below this part of the longest wrench count as zero.
RANK = 1e-9


@attrs.define(eq=False)
class Balance:
    """The equations M v_dot - g = D^T lambda + B tau of one instant, and their solution.

    Attributes:
        tau: (k,) forces of the actuators, of least norm; Lam: (rows,) multipliers.
        rank: of the actuation; left: (f,) what it leaves of the forces, in the free motions.
        forces: (k + c,) tau, then those of closed contacts; side: (f,) what all are to have done.
        shares: whether forces of contacts are not unique.
    """

    t: float
    rows: ChosenRows
    held: Flags
    actuators: Sequence[Actuator]
    wrenches: Floats
    contacts: ContactForces | None = None
    closed: Closed | None = None
    tau: Floats = attrs.field(factory=lambda: np.zeros(0), init=False)
    Lam: Floats = attrs.field(factory=lambda: np.zeros(0), init=False)
    left: Floats = attrs.field(factory=lambda: np.zeros(0), init=False)
    forces: Floats = attrs.field(factory=lambda: np.zeros(0), init=False)
    side: Floats = attrs.field(factory=lambda: np.zeros(0), init=False)
    rank: int = attrs.field(default=0, init=False)
    shares: bool = attrs.field(default=False, init=False)

    def solve(self, needed: Floats) -> None:
        """Find forces and multipliers that give forces (6 n,) on the bodies.

        Raises:
            SimulationError: contacts leave their cones in all that was found.
        """
        rows, count, closed = self.rows, len(self.actuators), self.closed
        if closed is None or self.contacts is None:
            forces, self.rank = self._least(self.wrenches, needed)
            wrenches = self.wrenches
        else:
            wrenches, needed = np.hstack([self.wrenches, closed.wrenches]), needed - closed.known
            forces, rank = self._least(wrenches, needed)
            A, side = rows.free.T @ wrenches, rows.free.T @ needed
            forces = self.contacts.within(closed, self.t, A, side, forces)
            self.rank, self.shares = count, rank < A.shape[1]
            self.forces, self.side = forces, side
        self.tau, self.Lam = forces[:count], np.zeros(len(self.held))
        self.left = rows.free.T @ (needed - wrenches @ forces)
        self.Lam[self.held] = rows.multipliers(needed - wrenches @ forces)
        for force, actuator in zip(self.tau, self.actuators, strict=True):
            if isinstance(actuator, DriverActuator):
                self.Lam[actuator.row] = force / actuator.size(rows.all_rows)
        if closed is not None and self.contacts is not None:
            first = len(self.held) - 3 * self.contacts.table.count
            self.Lam[first + np.array(closed.Lam, dtype=int)] = forces[count:]

    def _least(self, wrenches: Floats, needed: Floats) -> tuple[Floats, int]:
        """Forces of least norm with N^T B tau nearest to what is needed, and the rank."""
        A, side = self.rows.free.T @ wrenches, self.rows.free.T @ needed
        left, values, right = np.linalg.svd(A, full_matrices=False)
        longest = np.max(np.linalg.norm(wrenches, axis=0), initial=0.0)
        rank = int(np.sum(values > RANK * longest))
        return right[:rank].T @ ((left[:, :rank].T @ side) / values[:rank]), rank
