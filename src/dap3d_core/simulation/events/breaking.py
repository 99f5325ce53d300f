"""Events of joints that break or hold at times: what is watched of them, and what follows."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.model import Model
from dap3d_core.result.file.validate import are_texts, check_forms, is_number, is_text, list_of
from dap3d_core.scene.expressions.expression import Expression
from dap3d_core.scene.expressions.outputs import margin
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.event import Event, Instant
from dap3d_core.simulation.redundancy.redundancy import Redundancy

#: Changes of joints within this part of the run: what changes more often comes to no end.
MOST_CHANGES, WITHIN = 50, 1e-6


@attrs.frozen
class Overload:
    """What an event watches of a joint that breaks: the size of its force on body i, N."""

    joint: str

    def __call__(self, t: float, instant: Instant) -> float:
        """The size at an instant; 0 once the joint has ended."""
        return float(np.linalg.norm(instant[f"{self.joint}.force"]))


@attrs.frozen
class Activity:
    """What an event watches of a joint that holds at times: a number, positive while it does.

    Attributes:
        is_of_inputs: True where it is a function of inputs alone, which change between steps.
    """

    joint: str
    margin: Expression
    is_of_inputs: bool

    def __call__(self, t: float, instant: Instant) -> float:
        """The number at an instant."""
        names = self.margin.names
        return float(self.margin.evaluate({n: t if n == "t" else instant[n] for n in names}))


class JointEvents:
    """When joints of a model end and hold again.

    Attributes:
        events: of each joint that breaks by itself, and of each that holds at times.
    """

    def __init__(self, model: Model) -> None:
        overloads = [
            Event(Overload(joint), above=limit, name=joint)
            for joint, limit in model.breaks.items()
            if np.isfinite(limit)
        ]
        activities = [
            Activity(
                joint,
                attrs.evolve(condition, root=margin(condition.root)),
                set(condition.names) <= set(model.input_names),
            )
            for joint, condition in model.active.items()
        ]
        self.events: tuple[Event, ...] = (
            *overloads,
            *(Event(of, name=of.joint) for of in activities),
        )
        self._broken: set[str] = set()
        self._latest: deque[tuple[float, str]] = deque(maxlen=MOST_CHANGES)

    def forget(self) -> None:
        """No joint has broken."""
        self._broken.clear()
        self._latest.clear()

    def state(self) -> dict[str, Any]:
        """Joints that have broken, and the latest changes, as plain data."""
        return {"broken": sorted(self._broken), "latest": [list(one) for one in self._latest]}

    def restore(self, found: Mapping[str, Any], known: set[str]) -> None:
        """Go on from what ``state`` gave; joints are among those known.

        Raises:
            ValueError: it is not of that form.
        """
        check_forms(found, {
            "broken": (lambda value: are_texts(value) and set(value) <= known, "joints that end"),
            "latest": (list_of(_is_change), "a list of instants with names of joints"),
        })  # fmt: skip
        self._broken = set(found["broken"])
        self._latest.clear()
        self._latest.extend((float(t), names) for t, names in found["latest"])

    def due(self, sides: Sequence[float], released: set[str]) -> tuple[list[str], list[str]]:
        """Joints that end and that hold again, where events are on these sides of their levels.

        Args:
            sides: of each event +1 or -1, or 0, which changes nothing.
            released: joints that hold no more.
        """
        ending, engaging = [], []
        for event, side in zip(self.events, sides, strict=True):
            joint = event.name
            if isinstance(event.of, Overload):
                if side > 0.0 and joint not in released:
                    ending.append(joint)
                    self._broken.add(joint)
            elif side > 0.0 and joint in released - self._broken:
                engaging.append(joint)
            elif side < 0.0 and joint not in released:
                ending.append(joint)
        return ending, [joint for joint in engaging if joint not in ending]

    def refuse_endless(self, t: float, joints: Sequence[str], span: float) -> None:
        """SimulationError where joints end and hold again ever faster."""
        latest = self._latest
        latest.append((t, ", ".join(joints)))
        if len(latest) == MOST_CHANGES and t - latest[0][0] <= WITHIN * span:
            every = sorted({name for _, names in latest for name in names.split(", ")})
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: joints {', '.join(every)} ended and held again "
                f"{MOST_CHANGES} times within {t - latest[0][0]:.2g} s: what they are active by "
                "changes back as they do; compare with a margin, or with what they do not change"
            )


def _is_change(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and is_number(value[0]) and is_text(value[1])


def share_notes(model: Model, redundancy: Redundancy) -> list[str]:
    """That joints break by forces which are not unique, where rows are redundant."""
    shared = [
        one.joint
        for one in redundancy.reactions()
        if one.force != "xyz" and np.isfinite(model.breaks.get(one.joint, np.inf))
    ]
    words = "their forces are not unique, and when they break is judged by those of least |lambda|"
    return [f"joints that may break, {', '.join(shared)}: {words}"] if shared else []
