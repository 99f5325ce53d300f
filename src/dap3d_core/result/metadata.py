"""Metadata of a run: origin, course, cost."""

import json
import platform
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import attrs

from dap3d_core.result.contact_table import ContactTable, no_contacts
from dap3d_core.scene import SceneError, tables_of
from dap3d_core.settings import FIXED_STEP

#: A switch that restarted the integration, or ended the run; an event that stopped it, was
#: recorded, or changed parameters of a force or velocities; a jump of velocities by elements; a
#: joint that has broken or was let go, joints that hold again.
KINDS = ("switch", "end", "stop", "record", "change", "jump", "break", "engage")
#: The same of contacts (docs/concepts/contact.md).
CONTACT_KINDS = ("touch", "impact", "lift", "slip", "stick", "rest", "jam")

#: Severities: of what changes nothing of a request, and of what does (``--strict`` refuses it).
INFORMATION, WARNING = "information", "warning"
#: How a note of severity INFORMATION begins where it is printed or stored.
_PREFIX = "for information: "
#: Tables of a scene whose entries a note may begin with, as ``joints.J1: ...``.
_WHERE = re.compile(
    r"((?:bodies|points|vectors2?|joints|forces|functions|inputs|shapes|outputs)\.[^\s:]+): "
)

#: How a run can have ended.
STATUSES = ("done", "interrupted", "stopped")
#: Stands in a file that is still being written, or whose writer was killed.
RUNNING = "running"


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
        work: of the impulses of a jump, with those of drivers, J.
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


class Note(str):
    """A note: the line that is printed and stored, with its parts."""

    __slots__ = ()

    @property
    def severity(self) -> str:
        """``"information"`` or ``"warning"``."""
        return INFORMATION if self.startswith(_PREFIX) else WARNING

    @property
    def is_warning(self) -> bool:
        """True for what changes a request."""
        return self.severity == WARNING

    @property
    def where(self) -> str:
        """The entry of the scene that it is of, such as ``joints.J1``; ``""`` for the whole run."""
        found = _WHERE.match(self.removeprefix(_PREFIX))
        return found[1] if found else ""

    @property
    def text(self) -> str:
        """The sentence, without severity and entry."""
        line = self.removeprefix(_PREFIX)
        return line[len(self.where) + 2 :] if self.where else line


def information(text: str) -> Note:
    """A note that changes nothing of a request."""
    return Note(f"{_PREFIX}{text}")


def warnings_of(notes: Iterable[str]) -> Iterator[Note]:
    """The notes that are warnings."""
    return (note for note in map(Note, notes) if note.is_warning)


@attrs.frozen(kw_only=True)
class RunStatistics:
    """Cost of a run.

    Attributes:
        steps, rejected: integration steps taken, and tried but thrown away.
        rhs: evaluations of the right-hand side.
        projections: projections on the constraints.
        wall_time_s, compile_time_s: time of the run without compilation, and of compilation, s.
    """

    steps: int = 0
    rejected: int = 0
    rhs: int = 0
    projections: int = 0
    wall_time_s: float = 0.0
    compile_time_s: float = 0.0


@cache
def _installed() -> dict[str, str]:
    found = {}
    for package in ("dap3d", "numpy", "llvmlite"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return {**found, "python": platform.python_version()}


def current_versions() -> dict[str, str]:
    """Versions of what the numbers depend on: dap3d, numpy, llvmlite, python."""
    return dict(_installed())


def _notes(lines: Iterable[str]) -> tuple[Note, ...]:
    return tuple(map(Note, lines))


def _occurrences(found: Iterable[EventRecord]) -> tuple[EventRecord, ...]:
    return tuple(found)


def _by_actuator(forces: Mapping[str, Iterable[float]]) -> dict[str, tuple[float, ...]]:
    return {name: tuple(map(float, values)) for name, values in forces.items()}


def _plain(value: Any) -> Any:
    """Settings as a file gives them back: lists for tuples, Python's numbers for numpy's."""
    return json.loads(to_json(value))


def to_json(value: Any) -> str:
    """Text of settings, notes or statistics; numpy's numbers and arrays become Python's."""
    return json.dumps(value, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v))


@attrs.frozen(kw_only=True)
class RunMetadata:
    """Everything about a run that is not an array over its instants.

    Attributes:
        scene_text: the scene that was run, as the text of a scene file.
        status: "done"; "interrupted" by the user; "stopped" early, by an event or a failure.
        method, integrator: formulation and method of integration that were used.
        notes: what the run chose, changed or noticed, in order.
        settings: rtol, atol, step, project, correct and the like, as they were used.
        stats: what it cost.
        events: what happened at instants that were located, in their order.
        contacts: of shapes that meet anywhere.
        run: by which a checkpoint knows the rows that belong to it; "" where there is none.
        actuation: name of an actuator -> (nt,) its force as inverse dynamics finds it, N or N m,
            which takes the place of that in the scene.
        types: where the types of the scene come from (simulation/output/type_sources.py): "joint
            rev" -> ``digest``, ``distribution``, ``version``; None where it was not recorded.
        known_versions: of dap3d, numpy, llvmlite, python; None for those that are installed.
    """

    scene_text: str
    status: str = attrs.field(default="done", validator=attrs.validators.in_((*STATUSES, RUNNING)))
    method: str = ""
    integrator: str = ""
    notes: tuple[Note, ...] = attrs.field(default=(), converter=_notes)
    settings: dict[str, Any] = attrs.field(factory=dict, converter=_plain)
    stats: RunStatistics = attrs.Factory(RunStatistics)
    events: tuple[EventRecord, ...] = attrs.field(default=(), converter=_occurrences)
    contacts: ContactTable = attrs.Factory(no_contacts)
    run: str = attrs.field(default="", eq=False)
    actuation: Mapping[str, tuple[float, ...]] = attrs.field(factory=dict, converter=_by_actuator)
    types: Mapping[str, Mapping[str, str]] | None = None
    known_versions: Mapping[str, str] | None = attrs.field(
        default=None, eq=lambda known: _installed() if known is None else dict(known)
    )

    @property
    def versions(self) -> dict[str, str]:
        """Versions of dap3d, numpy, llvmlite and python that made the numbers."""
        known = self.known_versions
        return current_versions() if known is None else dict(known)

    @property
    def title(self) -> str:
        """Name of the scene, "" where it has none."""
        head = self.scene_text.partition("\n[")[0]  # the header is the first table
        try:
            name = tables_of(head)["scene"]["name"]
        except (SceneError, KeyError, TypeError):
            return ""
        return name if isinstance(name, str) else ""

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names of the forces of the scene, in file order."""
        try:
            return tuple(tables_of(self.scene_text).get("forces", {}))
        except (SceneError, TypeError):
            return ()

    @property
    def outputs(self) -> dict[str, Any]:
        """Expressions of the outputs of the scene by name, or tables of them, as written."""
        return self._table("outputs")

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the scene by name, numbers or expressions, as written."""
        return self._table("parameters")

    def _table(self, name: str) -> dict[str, Any]:
        if f"[{name}" not in self.scene_text:  # reading the text of a large scene takes time
            return {}
        try:
            table = tables_of(self.scene_text).get(name, {})
        except SceneError:
            return {}
        return table if isinstance(table, dict) else {}

    @property
    def tolerances(self) -> tuple[float, dict[str, float]] | None:
        """rtol, and atol of r, p, v and w, that controlled the steps; None for fixed steps."""
        rtol, atol = self.settings.get("rtol"), self.settings.get("atol")
        if self.integrator in FIXED_STEP or self.settings.get("step") is not None or not rtol:
            return None
        return float(rtol), atol if isinstance(atol, dict) else dict.fromkeys("rpvw", atol or 0.0)

    @property
    def stepping(self) -> dict[str, float]:
        """What contacts that are stepped did (simulation/run_state.py); empty for others."""
        return dict(self.settings.get("stepping", {}))

    @property
    def length(self) -> float:
        """The length, m, that tolerances speak of (Model.length)."""
        return float(self.settings.get("length", 1.0))

    @property
    def extent(self) -> float:
        """The length of the scene, m (Model.extent); that of its tolerances in older results."""
        return float(self.settings.get("extent", self.length))

    @property
    def projected(self) -> bool:
        """True if states were projected on the constraints."""
        return bool(self.settings.get("project", False))
