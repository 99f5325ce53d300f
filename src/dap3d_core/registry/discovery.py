"""Which types are installed: read from entry points, without importing any of them."""

import os
import re
from collections.abc import Collection
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from typing import Any

import attrs

from dap3d_core.interface.hooks import GROUPS

#: Environment variable that leaves the plugins of the named distributions out, separated by commas.
BLOCK_VARIABLE = "DAP3D_BLOCK"


@attrs.frozen
class Source:
    """Where a type comes from.

    Attributes:
        kind: joint, force or function; "" for a distribution whose entry points cannot be read.
        keyword: the type's word in a scene.
        module: the module that is the plugin, or the path of a model's own file.
        distribution, version: the installed package; both "" for a model's own file.
        blocked: left out by DAP3D_BLOCK.
        fault: why the entry point itself is of no use, "" for a good one.
        type: the class, where it is loaded already (a model's own file).
    """

    kind: str
    keyword: str
    module: str
    distribution: str = ""
    version: str = ""
    blocked: bool = False
    fault: str = ""
    type: Any = None

    def __str__(self) -> str:
        if not self.distribution:
            return self.module
        version = f" {self.version}" if self.version else ""
        return f"distribution {self.distribution}{version} (module {self.module})"


def discover(groups: Collection[str] | None = None) -> list[Source]:
    """Every type that the installed distributions declare, in the order of kinds and keywords.

    Args:
        groups: entry-point groups to read; all three by default, none with an empty collection.
    """
    wanted = {g: kind for kind, (g, _) in GROUPS.items() if groups is None or g in groups}
    blocked = blocked_distributions()
    entries, found = _entries(wanted)
    found += [_source(e, wanted[e.group], blocked) for e in entries]
    order = {kind: k for k, kind in enumerate(GROUPS)}
    return sorted(found, key=lambda s: (order.get(s.kind, -1), s.keyword, s.distribution))


def blocked_distributions() -> frozenset[str]:
    """The distributions that DAP3D_BLOCK names, in the normal form of names."""
    words = os.environ.get(BLOCK_VARIABLE, "").split(",")
    return frozenset(normal_name(w) for w in words if w.strip())


def normal_name(name: str) -> str:
    """A distribution's name as packaging compares it: lower case, hyphens."""
    return re.sub(r"[-_.]+", "-", name.strip()).lower()


def _entries(groups: Collection[str]) -> tuple[list[EntryPoint], list[Source]]:
    """The entry points of these groups, and distributions whose entry points cannot be read."""
    try:
        return [entry for group in groups for entry in entry_points(group=group)], []
    except Exception:  # one damaged file stops that call for everyone: read them one by one
        return _entries_one_by_one(groups)


def _entries_one_by_one(groups: Collection[str]) -> tuple[list[EntryPoint], list[Source]]:
    seen: set[str] = set()
    entries: list[EntryPoint] = []
    broken: list[Source] = []
    for distribution in distributions():
        name, version = _name_and_version(distribution)
        if normal_name(name) in seen:  # the first on the path is the one that is imported
            continue
        seen.add(normal_name(name))
        try:
            entries += [e for e in distribution.entry_points if e.group in groups]
        except Exception as error:
            fault = f"its entry_points.txt cannot be read: {type(error).__name__}: {error}"
            broken.append(Source("", "", "", name, version, fault=fault))
    return entries, broken


def _name_and_version(distribution: Distribution | None) -> tuple[str, str]:
    try:
        metadata: Any = distribution.metadata if distribution is not None else {}
        return metadata["Name"] or "unknown", metadata["Version"] or ""
    except Exception:  # metadata missing or damaged
        return "unknown", ""


def _source(entry: EntryPoint, kind: str, blocked: frozenset[str]) -> Source:
    name, version = _name_and_version(entry.dist)
    value = str(entry.value).strip()
    fault = ""
    if not re.fullmatch(r"[^\W\d]\w*(\.[^\W\d]\w*)*", value):
        fault = f"its entry point should name a module, such as my_package.my_type, not {value!r}"
    return Source(kind, entry.name, value, name, version, normal_name(name) in blocked, fault)
