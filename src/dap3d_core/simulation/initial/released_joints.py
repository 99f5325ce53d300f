"""Joints that hold no more: they have broken, were let go, or are not active.

Their rows stay among those of the others, and are zero: nothing writes them, their multipliers are
zero, and method lsq gives what weighs nothing a pivot of its own.
"""

from collections.abc import Iterable, Set

import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.turns import BODY_I, BODY_J, ONLY, ROTATION, begin_turns
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.errors import SimulationError

#: Kinds of loops that write the rows of a joint.
ROWS = ("acceleration", "position")
#: A joint that is engaged is closed within this part of the length of the scene.
CLOSED = 1e-6


class ReleasedJoints:
    """The joints of an evaluator that have ended; they hold again when they are put back."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of a run, in which all joints hold."""
        self._evaluator = evaluator
        system = evaluator.system
        self._held = system.groups.copy(), system.turns.copy()
        self.names: set[str] = set()

    def release(self, joints: Iterable[str]) -> list[str]:
        """End joints; those among them that held until now. Angles are to be counted anew."""
        names = self._evaluator.model.joint_names
        ending = [joint for joint in dict.fromkeys(joints) if joint not in self.names]
        for joint in ending:
            self._end(names.index(joint))
        self.names.update(ending)
        return ending

    def engage(self, joints: Iterable[str], t: float, y: Floats) -> list[str]:
        """Let joints that have ended hold again at a state y; velocities are to follow.

        Returns:
            those that did not hold until now.

        Raises:
            SimulationError: the bodies do not stand as the joint wants them.
        """
        evaluator, system = self._evaluator, self._evaluator.system
        groups, turns = self._held
        engaging = [joint for joint in dict.fromkeys(joints) if joint in self.names]
        for joint in engaging:
            place = evaluator.model.joint_names.index(joint)
            loops, own = self._parts(place)
            system.groups[loops], system.turns[own] = groups[loops], turns[own]
            self.names.remove(joint)
            self._check_closed(place, t, evaluator.hold(evaluator.body_state(y)))
        self.begin_anew(t, y)
        return engaging

    def _check_closed(self, place: int, t: float, u: Floats) -> None:
        model, system = self._evaluator.model, self._evaluator.system
        C = self._evaluator.rows(t, u).C * system.weight[system.row]
        residuals = np.abs(C[self._rows_of(place)])
        if residuals.max() > CLOSED * model.length:
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: joint {model.joint_names[place]} is engaged "
                f"where it is open by {residuals.max():.3g}; engage it where its bodies stand as "
                f"it wants them, within {CLOSED * model.length:g} m or rad"
            )

    def check_velocities(self, joints: Iterable[str], t: float, u: Floats) -> None:
        """SimulationError where velocities of a state u do not fit joints that were engaged."""
        evaluator, model = self._evaluator, self._evaluator.model
        found = evaluator.rows(t, u)
        v = u[-found.shape[1] :]
        missed = np.abs(found.product(v) - found.nu)
        for joint in joints:
            most = missed[self._rows_of(model.joint_names.index(joint))].max()
            if most > CLOSED * max(1.0, np.abs(v).max()):
                raise SimulationError(
                    f"the run stopped at t = {t:.9g} s: joint {joint} is engaged, and drivers and "
                    f"other joints hold its bodies to velocities that it does not allow, by "
                    f"{most:.3g}"
                )

    def _rows_of(self, place: int) -> slice:
        start = self._evaluator.model.joint_start
        return slice(start[place], start[place + 1])

    def begin_anew(self, t: float, y: Floats) -> None:
        """Count angles from a state y, within half a turn of what they were; judge pivots anew."""
        evaluator = self._evaluator
        store_reference_pivots(evaluator, t, evaluator.hold(evaluator.body_state(y)))
        if len(evaluator.system.turns):
            evaluator.place(t, evaluator.hold(evaluator.body_state(y)))
            begin_turns(float(t), y, evaluator.system)

    def _parts(self, place: int) -> tuple[list[int], NDArray[np.bool_]]:
        """The loops that write the rows of a joint, and a mask of the angles that are its own."""
        loops = [
            q
            for q, (kind, group) in enumerate(self._evaluator.loop_groups)
            if kind in ROWS and group.type_info.type.kind == "joint" and place in group.members
        ]
        angles = self._evaluator.model.joint_angles
        counted = np.zeros(0, dtype=np.int64) if angles is None else angles.coordinates[:, 0]
        return loops, counted == place

    def _end(self, place: int) -> None:
        """Leave out the loops of a joint, and make its rows zero; its angles stand still."""
        evaluator, system = self._evaluator, self._evaluator.system
        loops, own = self._parts(place)
        system.groups[loops, 2] = 0  # it is alone in its group
        rows = np.r_[self._rows_of(place)]
        of_row, _, at = evaluator.pattern
        system.D[at[np.isin(of_row, rows)]] = 0.0
        for values in (system.gamma, system.nu, system.residual):
            values[system.row[rows]] = 0.0
        system.turns[own, BODY_I] = system.turns[own, BODY_J] = 0
        system.turns[own, ROTATION] = ONLY

    def let_end(self, joints: Set[str]) -> None:
        """Let these and no others hold no more, for evaluations."""
        if joints != self.names:
            self.put_back()
            self.release(joints)

    def put_back(self) -> None:
        """Let all joints hold again."""
        if self.names:
            system = self._evaluator.system
            system.groups[...], system.turns[...] = self._held
            self.names.clear()
