"""Metadata of a run: scene, settings, status, cost."""

import json
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import attrs

from dap3d_core.result.event_record import Occurrence
from dap3d_core.scene import SceneError, tables_of
from dap3d_core.scene.validate.settings import FIXED_STEP

#: Final statuses of a run.
STATUSES = ("done", "interrupted", "stopped")
#: Prefix of a note that is no warning to ``--strict``.
INFORMATION = "for information: "
#: Status in a file that is being written, or was left by a killed writer.
RUNNING = "running"


@attrs.frozen(kw_only=True)
class Statistics:
    """Cost of a run.

    Attributes:
        steps, rejected: integration steps taken, and rejected.
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
    """Installed versions of dap3d, numpy, llvmlite, python."""
    return dict(_installed())


def _plain(value: Any) -> Any:
    """Settings as read from a file: lists for tuples, Python's numbers for numpy's."""
    return json.loads(to_json(value))


def to_json(value: Any) -> str:
    """JSON of settings, notes or statistics; numpy's numbers and arrays become Python's."""
    return json.dumps(value, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v))


@attrs.frozen(kw_only=True)
class Record:
    """Metadata of a run: all but its arrays.

    Attributes:
        scene_text: the scene that was run, as the text of a scene file.
        status: "done"; "interrupted" by the user; "stopped" early, by an event or a failure.
        method, integrator: formulation and method of integration that were used.
        notes: choices, changes and warnings, in order.
        settings: rtol, atol, step, project, correct and others, as used.
        stats: its cost.
        events: located switches and events, in order.
        run: identity that a checkpoint and its rows share, "" if there is none.
        types: sources of the types (simulation/output/type_sources.py): "joint rev" -> ``digest``,
            ``distribution``, ``version``; None if not recorded.
        known_versions: of dap3d, numpy, llvmlite, python; None for those installed.
    """

    scene_text: str
    status: str = attrs.field(default="done", validator=attrs.validators.in_((*STATUSES, RUNNING)))
    method: str = ""
    integrator: str = ""
    notes: tuple[str, ...] = attrs.field(default=(), converter=tuple[str, ...])
    settings: dict[str, Any] = attrs.field(factory=dict, converter=_plain)
    stats: Statistics = attrs.Factory(Statistics)
    events: tuple[Occurrence, ...] = attrs.field(default=(), converter=tuple[Occurrence, ...])
    run: str = attrs.field(default="", eq=False)
    types: Mapping[str, Mapping[str, str]] | None = None
    known_versions: Mapping[str, str] | None = attrs.field(
        default=None, eq=lambda known: _installed() if known is None else dict(known)
    )

    @property
    def versions(self) -> dict[str, str]:
        """Versions of dap3d, numpy, llvmlite and python in the run."""
        known = self.known_versions
        return current_versions() if known is None else dict(known)

    @property
    def title(self) -> str:
        """Name of the scene, "" if it has none."""
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
    def tolerances(self) -> tuple[float, dict[str, float]] | None:
        """rtol, and atol of r, p, v and w, that controlled the steps; None for fixed steps."""
        rtol, atol = self.settings.get("rtol"), self.settings.get("atol")
        if self.integrator in FIXED_STEP or self.settings.get("step") is not None or not rtol:
            return None
        return float(rtol), atol if isinstance(atol, dict) else dict.fromkeys("rpvw", atol or 0.0)

    @property
    def length(self) -> float:
        """The length, m, that tolerances refer to (Model.length)."""
        return float(self.settings.get("length", 1.0))

    @property
    def projected(self) -> bool:
        """True if states were projected on the constraints."""
        return bool(self.settings.get("project", False))
