"""Switches: numbers of a model's elements whose change of sign an integration locates."""

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import BEGINS, ENDS, JUMPS, MODE_ENDS, SEAM, UNSEEN, Floats
from dap3d_core.interface.codegen.specialise import KNOTS
from dap3d_core.model import Group, Model
from dap3d_core.model.knots import narrowest

#: Kernels by which velocities and states jump.
JUMPING = frozenset(("impulse", "reset"))
#: Bodies that touch are apart, or not, by the rounding of their positions: this part of the length
#: of the scene, or of how far bodies are from the origin (``Model.reach``), is some of them.
POSITION_ROUNDING = 32.0 * float(np.finfo(float).eps)
#: Slip, m/s of an ordinary scene, and the rest of a cone, N, that are rounding of contacts that
#: begin to slip, or to stick.
STILL = 1e-11
#: The part of the narrowest range between two knots that counts as at the knot.
NEAR_KNOT = 1e-6


@attrs.frozen(eq=False)
class Switch:
    """One number of an element whose sign is watched.

    Attributes:
        group, place: the element, as an instance of a group.
        kind: "switch": the element's own; "knot": the distance of an argument from where the
            function that the element is given takes another form; "bound": that of an unknown of
            the element from its bound.
        is_one_of_several, part: where the kernel gives a tuple, which of its numbers.
        speed: length over time of the scene, m/s (Model.length, Evaluator.time); that of 1 rad of a
            contact whose gap or slip is an angle.
        reach: the length, m, of which positions have the rounding; 1 rad of these.
    """

    group: Group
    place: int
    kind: str
    is_one_of_several: bool
    part: int
    speed: float = 1.0
    reach: float = 1.0

    @property
    def words(self) -> str:
        """Reason to end the run where it becomes negative; "" if integration restarts there."""
        type_: Any = self.group.type_info.type
        if self.kind == "bound":
            from dap3d_core.interface.codegen.unknowns import bound_words

            unknown, which, field = bound_words(self.group.type_info)[self.part]
            at, _ = self.group.type_info.layout.numbers[field]
            value = self.group.numbers[self.place, at]
            return f"its unknown {unknown} passed its {which} value, {field} = {value:g}"
        return str(type_.switch_words) if self.kind == "switch" else ""

    @property
    def jumps(self) -> bool:
        """True if velocities or states may jump where it changes its sign."""
        has_jump = self.is_contact or not JUMPING.isdisjoint(self.group.type_info.kernels)
        return self.kind == "switch" and has_jump

    @property
    def is_contact(self) -> bool:
        """True of contacts, where a mode ends."""
        return self.kind == "switch" and bool(self.group.type_info.type.is_contact)

    @property
    def effect(self) -> int:
        """Effect on a run: ENDS, BEGINS, UNSEEN, SEAM, JUMPS or MODE_ENDS."""
        if self.words:
            return ENDS
        if self.kind == "knot":
            return SEAM if self.group.type_info.type.is_contact else UNSEEN
        if self.jumps:
            return MODE_ENDS if self.is_contact else JUMPS
        return BEGINS

    @property
    def band(self) -> float:
        """Distance beyond zero from which on it has passed: of a knot, and of contact at rest."""
        if self.kind == "bound":
            return 0.0
        if self.kind == "switch":
            type_: Any = self.group.type_info.type
            if self.is_contact and self.part == 1:
                return STILL * self.speed
            touches = self.is_contact or (self.jumps and type_.unilateral and not self.words)
            return POSITION_ROUNDING * self.reach if touches else 0.0
        if self.effect == SEAM:
            return POSITION_ROUNDING * self.reach
        row, numbers = self.group.numbers[self.place], self.group.type_info.layout.numbers
        own = [place for name, place in numbers.items() if name.endswith(KNOTS)]
        knots = [row[at : at + count] for at, (count,) in own]
        return NEAR_KNOT * min(map(narrowest, knots))

    def name(self, model: Model) -> str:
        """The element's name; with the number's place, from 1, where there are several."""
        is_joint = self.group.type_info.type.kind == "joint"
        names = model.joint_names if is_joint else model.force_names
        name = names[int(self.group.members[self.place])]
        is_numbered = self.is_one_of_several and self.kind != "bound"
        return f"{name} [{self.part + 1}]" if is_numbered else name


def turns(group: Group) -> bool:
    """True of contacts whose gap or slip is an angle."""
    type_: Any = group.type_info.type
    return bool(type_.is_contact and type_.at is None)


def switches_of(
    loops: Iterable[tuple[str, Group]], length: float = 1.0, time: float = 1.0, reach: float = 1.0
) -> tuple[Switch, ...]:
    """The switches of a model in the order in which ``watch`` gives them.

    Args:
        loops: (kind, group).
        length, time, reach: of the scene, m and s.
    """

    def scales_of(group: Group) -> tuple[float, float]:
        return (1.0 / time, 1.0) if turns(group) else (length / time, reach)

    return tuple(
        Switch(group, k, kind, len(group.type_info.outputs[kind]) > 1, part, *scales_of(group))
        for kind, group in loops
        if kind in ("switch", "bound", "knot")
        for k in range(group.count)
        for part in range(len(group.type_info.outputs[kind]))
    )


def effects_of(switches: Iterable[Switch]) -> Floats:
    """(2, switches) effect of each on a run, and its band."""
    effects = [(s.effect, s.band) for s in switches]
    return np.array(effects, dtype=float).reshape(-1, 2).T.copy()
