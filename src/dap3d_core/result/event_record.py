"""Records of switches and user events at located instants of a run."""

from collections.abc import Mapping
from typing import Any

import attrs

#: A switch that restarted the integration, or ended the run; an event that stopped it, was
#: recorded, or changed parameters of a force or velocities; a jump of velocities by elements; a
#: joint that has broken or was let go, joints that hold again.
KINDS = ("switch", "end", "stop", "record", "change", "jump", "break", "engage")
#: The same of contacts (docs/concepts/contact.md).
CONTACT_KINDS = ("touch", "impact", "lift", "slip", "stick", "rest", "jam")


def _state(u: Any) -> tuple[float, ...] | None:
    return None if u is None else tuple(map(float, u))


@attrs.frozen(kw_only=True)
class EventRecord:
    """A switch or an event at a located instant.

    Attributes:
        name: of the event; of joints that end or hold again their own; of a switch ``force NAME``
            or ``joint NAME``; of a jump those of all elements whose impulses acted.
        t: s.
        direction: +1 if its function rose through its level, -1 if it fell; of a jump that of the
            first switch, 0 without one; of joints that end or hold 0.
        kind: one of ``KINDS``, or of ``CONTACT_KINDS``.
        u: (13 n) the state, of events and before jumps; None for switches.
        changes: force -> field -> new value of changed parameters.
        u_after: (13 n) the state after a jump of velocities; None for all else.
        work: of the impulses of a jump, with those of drivers, J; of an impact also of what
            resists rolling and spinning there.
        states: element -> state -> value of states of elements that a jump has changed.
    """

    name: str
    t: float
    direction: int
    kind: str = attrs.field(validator=attrs.validators.in_(KINDS + CONTACT_KINDS))
    u: tuple[float, ...] | None = attrs.field(default=None, converter=_state)
    changes: Mapping[str, Mapping[str, Any]] = attrs.Factory(dict)
    u_after: tuple[float, ...] | None = attrs.field(default=None, converter=_state)
    work: float = 0.0
    states: Mapping[str, Mapping[str, Any]] = attrs.Factory(dict)

    @property
    def words(self) -> str:
        """The occurrence in a line."""
        if self.kind in CONTACT_KINDS:
            work = f": work {self.work:.6g} J" if self.kind in ("impact", "jam") else ""
            return f"t = {self.t:.9g} s: {self.kind} of {self.name}{work}"
        what = ", which ended the run" if self.kind in ("end", "stop") else ""
        if self.kind == "change":
            of = [f"{force}.{n} = {_short(x)}" for force, new in self.changes.items()
                  for n, x in new.items()]  # fmt: skip
            what = f": {', '.join(of)}" if of else ""
        if self.kind == "jump":
            of = [f", {element}.{n} = {_short(x)}" for element, new in self.states.items()
                  for n, x in new.items()]  # fmt: skip
            return f"t = {self.t:.9g} s: jump by {self.name}: work {self.work:.6g} J{''.join(of)}"
        if self.kind == "break":
            return f"t = {self.t:.9g} s: joint {self.name} ends"
        if self.kind == "engage":
            return f"t = {self.t:.9g} s: {self.name} holds: work {self.work:.6g} J"
        if self.kind in ("switch", "end"):
            way = f": its switch became {'positive' if self.direction > 0 else 'negative'}"
        else:
            way = f", {'rising' if self.direction > 0 else 'falling'}"
        return f"t = {self.t:.9g} s: {self.name}{way}{what}"


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
