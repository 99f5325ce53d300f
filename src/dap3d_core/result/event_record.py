"""Records of switches and user events at located instants of a run."""

from collections.abc import Mapping
from typing import Any

import attrs

#: A switch that restarted the integration, or ended the run; an event that stopped it, was
#: recorded, or changed parameters of a force.
KINDS = ("switch", "end", "stop", "record", "change")


def _state(u: Any) -> tuple[float, ...] | None:
    return None if u is None else tuple(map(float, u))


@attrs.frozen(kw_only=True)
class EventRecord:
    """A switch or an event at a located instant.

    Attributes:
        name: of the event; of a switch ``force NAME`` or ``joint NAME``.
        t: s.
        direction: +1 if its function rose through its level, -1 if it fell.
        kind: one of ``KINDS``.
        u: (13 n) the state, of events; None for switches.
        changes: force -> field -> new value of changed parameters.
    """

    name: str
    t: float
    direction: int
    kind: str = attrs.field(validator=attrs.validators.in_(KINDS))
    u: tuple[float, ...] | None = attrs.field(default=None, converter=_state)
    changes: Mapping[str, Mapping[str, Any]] = attrs.Factory(dict)

    @property
    def words(self) -> str:
        """The occurrence in a line."""
        what = ", which ended the run" if self.kind in ("end", "stop") else ""
        if self.kind == "change":
            of = [f"{force}.{n} = {_short(x)}" for force, new in self.changes.items()
                  for n, x in new.items()]  # fmt: skip
            what = f": {', '.join(of)}" if of else ""
        if self.kind in ("switch", "end"):
            way = f": its switch became {'positive' if self.direction > 0 else 'negative'}"
        else:
            way = f", {'rising' if self.direction > 0 else 'falling'}"
        return f"t = {self.t:.9g} s: {self.name}{way}{what}"


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
