"""Joints that break or are let go in the course of a run.

Their rows stay among those of the others, and are zero from then on: nothing writes them any more,
their multipliers are zero, and method lsq gives what weighs nothing a pivot of its own.
"""

from collections.abc import Iterable

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.turns import BODY_I, BODY_J, ONLY, ROTATION, begin_turns
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.event import Event, Instant
from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Kinds of loops that write the rows of a joint.
ROWS = ("acceleration", "position")
#: A joint that is engaged is closed within this part of the length of the scene.
CLOSED = 1e-6


@attrs.frozen
class Overload:
    """What an event watches of a joint that breaks: the size of its force on body i, N."""

    joint: str

    def __call__(self, t: float, instant: Instant) -> float:
        """The size at an instant; 0 once the joint has ended."""
        return float(np.linalg.norm(instant[f"{self.joint}.force"]))

    def release(self, instant: Instant) -> None:
        """End the joint."""
        instant.release(self.joint)


def breaks_of(model: Model) -> tuple[Event, ...]:
    """An event for each joint that breaks by itself."""
    return tuple(
        Event(Overload(joint), above=limit, action=Overload(joint).release, name=joint)
        for joint, limit in model.breaks.items()
        if np.isfinite(limit)
    )


def share_notes(model: Model, redundancy: Redundancy) -> list[str]:
    """That joints break by forces which are not unique, where rows are redundant."""
    shared = [
        one.joint
        for one in redundancy.reactions()
        if one.force != "xyz" and np.isfinite(model.breaks.get(one.joint, np.inf))
    ]
    words = "their forces are not unique, and when they break is judged by those of least |lambda|"
    return [f"joints that may break, {', '.join(shared)}: {words}"] if shared else []


class ReleasedJoints:
    """The joints of an evaluator that have ended; they hold again when they are put back."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of a run, in which all joints hold."""
        self._evaluator = evaluator
        system = evaluator.system
        self._held = system.groups.copy(), system.turns.copy()
        self.names: set[str] = set()

    def release(self, joints: Iterable[str], t: float, y: Floats) -> list[str]:
        """End joints at a state y; those among them that held until now."""
        names = self._evaluator.model.joint_names
        ending = [joint for joint in dict.fromkeys(joints) if joint not in self.names]
        for joint in ending:
            self._end(names.index(joint))
        self.names.update(ending)
        self._begin_turns(t, y)
        return ending

    def engage(self, joints: Iterable[str], t: float, y: Floats) -> None:
        """Let joints that have ended hold again at a state y; velocities are to follow.

        Raises:
            SimulationError: the bodies do not stand as the joint wants them.
        """
        evaluator, system = self._evaluator, self._evaluator.system
        groups, turns = self._held
        for joint in [joint for joint in joints if joint in self.names]:
            place = evaluator.model.joint_names.index(joint)
            loops, own = self._parts(place)
            system.groups[loops], system.turns[own] = groups[loops], turns[own]
            self.names.remove(joint)
            self._check_closed(place, t, evaluator.hold(evaluator.body_state(y)))
        self._begin_turns(t, y)

    def _check_closed(self, place: int, t: float, u: Floats) -> None:
        model, system = self._evaluator.model, self._evaluator.system
        rows = slice(model.joint_start[place], model.joint_start[place + 1])
        residuals = np.abs(self._evaluator.rows(t, u).C * system.weight[system.row])[rows]
        if residuals.max() > CLOSED * model.length:
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: joint {model.joint_names[place]} is engaged "
                f"where it is open by {residuals.max():.3g}; engage it where its bodies stand as "
                f"it wants them, within {CLOSED * model.length:g} m or rad"
            )

    def _begin_turns(self, t: float, y: Floats) -> None:
        """Count angles from a state y, within half a turn of what they were."""
        evaluator = self._evaluator
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
        evaluator, model, system = self._evaluator, self._evaluator.model, self._evaluator.system
        loops, own = self._parts(place)
        system.groups[loops, 2] = 0  # it is alone in its group
        rows = np.arange(model.joint_start[place], model.joint_start[place + 1])
        of_row, _, at = evaluator.pattern
        system.D[at[np.isin(of_row, rows)]] = 0.0
        for values in (system.gamma, system.nu, system.residual, system.smallest):
            values[system.row[rows]] = 0.0
        system.turns[own, BODY_I] = system.turns[own, BODY_J] = 0
        system.turns[own, ROTATION] = ONLY

    def put_back(self) -> None:
        """Let all joints hold again."""
        if self.names:
            system = self._evaluator.system
            system.groups[...], system.turns[...] = self._held
            self.names.clear()
