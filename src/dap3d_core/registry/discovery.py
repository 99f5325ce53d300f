"""Finds the installed types by their entry points, without importing any of them."""

import ast
import json
import os
import re
import shlex
import sys
import time
import tomllib
import warnings
from collections.abc import Collection, Iterator
from functools import lru_cache
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import attrs

from dap3d_core.interface.hooks import EXTENSIONS, GROUPS, KINDS
from dap3d_core.registry.regular_files import read_regular

#: Environment variable that excludes types, separated by commas: all of a distribution, ``NAME``,
#: or one of them, ``NAME:KEYWORD``.
BLOCK_VARIABLE = "DAP3D_BLOCK"
#: Resolution of a folder's time of change, ns.
SETTLED = 10**9

#: Maximal size of a file, bytes.
LONGEST = 10**6
_BASES = {class_.__name__: kind for kind, class_ in KINDS.items()}


@attrs.frozen
class Source:
    """Origin of a type.

    Attributes:
        kind: joint, force or function, or one of ``EXTENSIONS``; "" for a distribution whose entry
            points cannot be read.
        keyword: the type's name in a scene.
        module: the module of the plugin, or the path of a model's own file.
        distribution, version: the installed package; both "" for a model's own file.
        blocked: the entry of DAP3D_BLOCK that excludes it; "" for none.
        fault: the fault of the entry point itself, "" for a valid one.
        type: the class, where it is already loaded (a model's own file).
    """

    kind: str
    keyword: str
    module: str
    distribution: str = ""
    version: str = ""
    blocked: str = ""
    fault: str = ""
    type: Any = None

    def __str__(self) -> str:
        if not self.distribution:
            return self.module
        version = f" {self.version}" if self.version else ""
        return f"distribution {self.distribution}{version} (module {self.module})"


def discover(groups: Collection[str] | None = None) -> list[Source]:
    """Every type that the installed distributions declare, in the order of kinds and keywords.

    Installed distributions are read again when a folder of sys.path has changed.

    Args:
        groups: entry-point groups to read; by default the three of types, none with an empty
            collection.
    """
    wanted = frozenset(g for g, _ in GROUPS.values()) if groups is None else frozenset(groups)
    return list(_discover(wanted, blocked_words(), tuple(map(_changed, sys.path))))


@lru_cache(maxsize=4)
def _discover(
    groups: frozenset[str], blocked: frozenset[str], path: tuple[tuple[str, int], ...]
) -> tuple[Source, ...]:
    """The types; ``path`` is the search path with times of change, a key of the cache."""
    known = (GROUPS | EXTENSIONS).items()
    kinds = {group: kind for kind, (group, _) in known if group in groups}
    sources = [source for one in _declaring(kinds) for source in _sources(one, kinds, blocked)]
    order = {kind: k for k, kind in enumerate(GROUPS | EXTENSIONS)}
    sources.sort(key=lambda s: (order.get(s.kind, -1), s.keyword, s.distribution))
    return tuple(sources)


def _changed(folder: str) -> tuple[str, int]:
    """A folder's absolute path and time of change, ns; 0 where it is missing.

    A change within ``SETTLED`` counts as now: the clock of a file system ticks slowly, and a second
    change may fall into the same tick.
    """
    try:
        changed, now = os.stat(folder or ".").st_mtime_ns, time.time_ns()
    except (OSError, ValueError):
        return folder, 0
    return os.path.abspath(folder), changed if now - changed > SETTLED else now


def blocked_words() -> frozenset[str]:
    """Entries of DAP3D_BLOCK, with normalised names of distributions."""
    words = (w.partition(":") for w in os.environ.get(BLOCK_VARIABLE, "").split(",") if w.strip())
    return frozenset(f"{normal_name(name)}{colon}{word.strip()}" for name, colon, word in words)


def normal_name(name: str) -> str:
    """A distribution's name as packaging compares it: lower case, hyphens."""
    return re.sub(r"[-_.]+", "-", name.strip()).lower()


def _declaring(groups: Collection[str]) -> Iterator[Distribution]:
    """The distributions with one of these groups; of two of a name the one that is imported.

    The text of the entry points is searched first: parsing the entry points and the metadata of all
    distributions would take ten times as long.
    """
    seen: set[str] = set()
    for distribution in distributions():
        if not _mentions(distribution, groups):
            continue
        name, _ = _name_and_version(distribution)
        if normal_name(name) in seen:
            continue
        seen.add(normal_name(name))
        first = next(iter(distributions(name=name)), distribution)
        if _mentions(first, groups):
            yield first


def _mentions(distribution: Distribution, groups: Collection[str]) -> bool:
    """True if a distribution may declare entry points of these groups."""
    try:
        text = distribution.read_text("entry_points.txt") or ""
    except Exception:  # damaged: reported where it is parsed
        return True
    return any(group in text for group in groups)


def _sources(
    distribution: Distribution, kinds: dict[str, str], blocked: frozenset[str]
) -> list[Source]:
    """The types that a distribution declares, or the fault that it cannot be read."""
    name, version = _name_and_version(distribution)
    try:
        entries = [entry for entry in distribution.entry_points if entry.group in kinds]
    except Exception as error:  # of one damaged file; all others are read
        fault = f"its entry_points.txt cannot be read: {type(error).__name__}: {error}"
        return [Source("", "", "", name, version, fault=fault)]
    words = {e.name: (normal_name(name), f"{normal_name(name)}:{e.name}") for e in entries}
    blocking = {n: next((w for w in both if w in blocked), "") for n, both in words.items()}
    return [
        Source(kinds[e.group], e.name, value, name, version, blocking[e.name], _fault(value))
        for e, value in ((e, str(e.value).strip()) for e in entries)
    ]


def _name_and_version(distribution: Distribution) -> tuple[str, str]:
    try:
        metadata: Any = distribution.metadata
        return metadata["Name"] or "unknown", metadata["Version"] or ""
    except Exception:  # metadata missing or damaged
        return "unknown", ""


def _fault(value: str) -> str:
    """The fault of an entry point, by its value."""
    if re.fullmatch(r"[^\W\d]\w*(\.[^\W\d]\w*)*", value):
        return ""
    return f"its entry point should name a module, such as my_package.my_type, not {value!r}"


def declares(path: Path, kind: str, keyword: str) -> bool:
    """True if a Python file has a class of this kind with this keyword, as far as its text shows.

    A class with bases from another file may be of any kind.
    """
    try:
        text = read_regular(path) if path.stat().st_size <= LONGEST else b""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # repeated where the file is run
            tree = ast.parse(text)
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return False  # reported where the file is run
    kinds = dict(_BASES)
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            of_bases = [kinds.get(b.id, "") for b in node.bases if isinstance(b, ast.Name)]
            kinds[node.name] = next(filter(None, of_bases), "")
            if keyword in _keywords(node) and kinds[node.name] in (kind, ""):
                return True
    return False


def _keywords(node: ast.ClassDef) -> list[str]:
    """Values that a class assigns to ``keyword``, alone or as one of several names."""
    keywords = []
    for line in node.body:
        if isinstance(line, ast.Assign) and len(line.targets) == 1:
            target = line.targets[0]
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            values = line.value.elts if isinstance(line.value, ast.Tuple) else [line.value]
            for name, value in zip(names, values, strict=False):
                is_keyword = isinstance(name, ast.Name) and name.id == "keyword"
                if is_keyword and isinstance(value, ast.Constant):
                    keywords.append(str(value.value))
    return keywords


def not_yet_installed(keyword: str) -> str:
    """The remedy for a type that the source of an editable package declares since; "" for none.

    The entry points of an editable install are those of the day it was made.
    """
    for distribution in distributions():
        try:
            folder = editable_folder(distribution)
            if folder is None:
                continue
            file = folder / "pyproject.toml"
            entry_points = tomllib.loads(file.read_text("utf-8"))["project"]["entry-points"]
            groups = [entry_points.get(group, {}) for group, _ in GROUPS.values()]
        except Exception:  # the files are missing or damaged
            continue
        if any(keyword in group for group in groups):
            return (
                f"{file} declares {keyword!r} since it was installed: "
                f"run pip install -e {shlex.quote(str(folder))} again"
            )
    return ""


def editable_folder(distribution: Distribution) -> Path | None:
    """The folder of the sources of an editable install; None for any other install.

    Raises:
        Exception: what the install says of its origin is damaged.
    """
    origin = json.loads(distribution.read_text("direct_url.json") or "{}")
    is_editable = origin.get("dir_info", {}).get("editable")
    return _folder(origin["url"]) if is_editable else None


def _folder(url: str) -> Path:
    """The folder of a file URL."""
    path = unquote(url.removeprefix("file://"))
    return Path(path.lstrip("/") if os.name == "nt" else path)
