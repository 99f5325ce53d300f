"""Metadata of a run: origin, course, cost."""

import json
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import attrs

from dap3d_core.result.contact_table import ContactTable, no_contacts
from dap3d_core.result.event_record import EventRecord
from dap3d_core.result.note import Note
from dap3d_core.scene import SceneError, tables_of
from dap3d_core.settings import FIXED_STEP

#: How a run can have ended.
STATUSES = ("done", "interrupted", "stopped")
#: Stands in a file that is still being written, or whose writer was killed.
RUNNING = "running"


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
    return {**found, "python": sys.version.partition(" ")[0]}


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
