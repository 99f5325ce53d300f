"""Joints that break or are let go in the course of a run.

Their rows stay among those of the others, and are zero from then on: nothing writes them any more,
their multipliers are zero, and method lsq gives what weighs nothing a pivot of its own.
"""

from collections.abc import Iterable

import attrs
import numpy as np

from dap3d_core.assembly.turns import BODY_I, BODY_J, ONLY, ROTATION, begin_turns
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.simulation.events.event import Event, Instant
from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Kinds of loops that write the rows of a joint.
ROWS = ("acceleration", "position")


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
        evaluator, model = self._evaluator, self._evaluator.model
        ending = [joint for joint in dict.fromkeys(joints) if joint not in self.names]
        for joint in ending:
            self._end(model.joint_names.index(joint))
        self.names.update(ending)
        if len(evaluator.system.turns):
            evaluator.place(t, evaluator.hold(evaluator.body_state(y)))
            begin_turns(float(t), y, evaluator.system)
        return ending

    def _end(self, place: int) -> None:
        """Leave out the loops of a joint, and make its rows zero; its angles stand still."""
        evaluator, model, system = self._evaluator, self._evaluator.model, self._evaluator.system
        for q, (kind, group) in enumerate(evaluator.loop_groups):
            if kind in ROWS and group.type_info.type.kind == "joint" and place in group.members:
                system.groups[q, 2] = 0  # it is alone in its group
        rows = np.arange(model.joint_start[place], model.joint_start[place + 1])
        of_row, _, at = evaluator.pattern
        system.D[at[np.isin(of_row, rows)]] = 0.0
        for values in (system.gamma, system.nu, system.residual, system.smallest):
            values[system.row[rows]] = 0.0
        if model.joint_angles is not None:
            own = model.joint_angles.coordinates[:, 0] == place
            system.turns[np.ix_(own, (BODY_I, BODY_J))] = 0
            system.turns[own, ROTATION] = ONLY

    def put_back(self) -> None:
        """Let all joints hold again."""
        if self.names:
            system = self._evaluator.system
            system.groups[...], system.turns[...] = self._held
            self.names.clear()
