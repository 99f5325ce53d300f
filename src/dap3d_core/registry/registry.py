"""The registry of types; each is loaded and examined on first use."""

import re
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import attrs

from dap3d_core.interface import PluginError
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.hooks import EXTENSIONS, GROUPS
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.discovery import (
    BLOCK_VARIABLE,
    Source,
    discover,
    normal_name,
    not_yet_installed,
)
from dap3d_core.registry.guard import OverdueError, noun_of
from dap3d_core.registry.loading import compile_kernels, load, load_file
from dap3d_core.registry.suggestions import nearest

#: Time limit of the loading of a plugin that no scene needs, s: a listing of all types must not
#: wait for one that never ends.
LOAD_LIMIT = 60.0
#: The distribution of dap3d's own types, which its tests compile and run.
OWN = "dap3d"


class UnknownTypeError(PluginError, LookupError):
    """No installed type has this keyword.

    Attributes:
        nearest: the most similar keyword of this kind, or None.
    """

    nearest: str | None = None


@attrs.frozen
class PluginInfo:
    """A type or an extension and its state, a line of ``dap3d plugins``.

    Attributes:
        kind: joint, force or function, or one of ``EXTENSIONS``; "" where a distribution's entry
            points cannot be read.
        keyword: the type's name in a scene.
        distribution, version: the installed package; "" for a model's own file.
        module: the module, or the path of a model's own file.
        state: ok, broken, blocked or duplicate.
        reason: the fault, with the remedy; "" where the state is ok.
    """

    kind: str
    keyword: str
    distribution: str
    version: str
    module: str
    state: str
    reason: str = ""


@attrs.frozen(eq=False)
class Registry:
    """The types that scenes may name; made by ``load_registry``, immutable.

    Attributes:
        sources: origin of each type, by kind and keyword; several where packages collide.
        notes: changes of the process by plugins that were undone.
    """

    sources: dict[tuple[str, str], list[Source]]
    notes: list[str] = attrs.field(factory=list)
    _loaded: dict[Source, TypeInfo | str] = attrs.field(factory=dict, repr=False)
    _overdue: dict[str, str] = attrs.field(factory=dict, repr=False)  # packages given up

    def get(self, kind: str, keyword: str, *, limit_s: float | None = None) -> TypeInfo:
        """The type of this keyword, loaded and examined on first use.

        Args:
            kind: joint, force or function.
            keyword: the type's name in a scene, or ``package:keyword``.
            limit_s: time limit of the loading of its plugin; by default none.

        Raises:
            UnknownTypeError: there is none; names the nearest and all others.
            PluginError: the type cannot be used: two packages have it, or its plugin is broken.
                Names distribution, module or file, reason and remedy.
        """
        _check_kind(kind)
        sources = self.sources_of(kind, keyword)
        if not sources:
            raise self._unknown(kind, keyword)
        if len(sources) > 1:
            raise PluginError(collision(sources))
        return self._load(sources[0], limit_s)

    def sources_of(self, kind: str, keyword: str) -> list[Source]:
        """The origins of a type that are not blocked; several where packages collide.

        Args:
            kind: joint, force or function.
            keyword: of the type, or ``package:keyword``, the type of one distribution.
        """
        package, _, word = keyword.rpartition(":")
        if not package or (kind, keyword) in self.sources:
            return [s for s in self.sources.get((kind, keyword), ()) if not s.blocked]
        name, same = normal_name(package), self.sources.get((kind, word.strip()), ())
        return [s for s in same if not s.blocked and normal_name(s.distribution) == name]

    def keyword_of_synonym(self, kind: str, word: str) -> str:
        """The keyword of dap3d's own type of a kind with this other name; "" where there is none.

        Loads these types: for messages alone.
        """
        every = (s for sources in self.sources.values() for s in sources)
        for source in every:
            if source.kind != kind or source.distribution != OWN or source.blocked:
                continue
            try:
                synonyms = self._load(source).type.synonyms
            except PluginError:
                continue
            if _plain(word) in map(_plain, synonyms):
                return source.keyword
        return ""

    def word_of(self, source: Source) -> str:
        """The keyword of a type, or ``package:keyword`` where several packages have this one."""
        is_shared = len(self.sources_of(source.kind, source.keyword)) > 1
        named = is_shared and source.distribution
        return f"{source.distribution}:{source.keyword}" if named else source.keyword

    def keywords(self, kind: str) -> tuple[str, ...]:
        """All keywords of a kind, sorted, without those of blocked packages. Loads nothing."""
        _check_kind(kind)
        return tuple(
            sorted(
                word
                for (of_kind, word), found in self.sources.items()
                if of_kind == kind and not all(source.blocked for source in found)
            )
        )

    def listing(
        self, *, compiling: bool = False, limit_s: float | None = LOAD_LIMIT
    ) -> list[PluginInfo]:
        """Every type with its state; loads each in its own guard and raises nothing.

        Args:
            limit_s: time limit of the loading of each plugin; one that takes longer is broken.
            compiling: compile the kernels of types from other packages as well, which takes a
                second a type the first time.
        """
        infos = [
            (s, info_of(s, same, lambda source: self._load(source, limit_s)))
            for same in self.sources.values()
            for s in same
        ]
        return [self._compiled(s, info) if compiling else info for s, info in infos]

    def with_file(self, path: str | Path) -> "Registry":
        """A registry with the types of a model's own Python file as well; runs that file.

        Args:
            path: the file, ``plugin.py`` of a model's folder.

        Raises:
            PluginError: the file cannot be used; names file, reason and remedy.
        """
        sources = {key: list(found) for key, found in self.sources.items()}
        notes = list(self.notes)
        for source in load_file(Path(path), notes):
            sources.setdefault((source.kind, source.keyword), []).append(source)
        return Registry(sources, notes, dict(self._loaded))

    def clash(self, kind: str, keyword: str, path: Path) -> str:
        """The fault of a model's own file with the keyword of an installed type."""
        sources = [s for s in self.sources[kind, keyword] if not s.blocked]
        return collision([*sources, Source(kind, keyword, str(path))])

    def _load(self, source: Source, limit_s: float | None = None) -> TypeInfo:
        loaded = self._loaded.get(source)
        if loaded is None:
            package = source.module.partition(".")[0]
            try:
                loaded = load(source, self.notes, limit_s, self._overdue.get(package, ""))
            except PluginError as error:
                self._loaded[source] = str(error)
                if isinstance(error.__cause__, OverdueError):
                    self._overdue[package] = str(error.__cause__)
                raise
            self._loaded[source] = loaded
        if isinstance(loaded, str):
            raise PluginError(loaded)
        return loaded

    def _compiled(self, source: Source, info: PluginInfo) -> PluginInfo:
        """The info after compiling the kernels of a type; dap3d's own are compiled by its tests."""
        loaded = self._loaded.get(source)
        if info.state != "ok" or info.distribution == OWN or not isinstance(loaded, TypeInfo):
            return info
        try:
            compile_kernels(source, loaded, self.notes)
        except PluginError as error:
            return attrs.evolve(info, state="broken", reason=str(error))
        return info

    def _unknown(self, kind: str, keyword: str) -> UnknownTypeError:
        package, _, word = keyword.rpartition(":")
        if package and (rivals := self.sources_of(kind, word)):
            return self._not_of_package(rivals, package)
        known = self.keywords(kind)
        near = self.keyword_of_synonym(kind, keyword) or nearest(keyword, known)
        words = f"there is no {kind} type {keyword!r}"
        blocked = self.sources.get((kind, keyword), [])
        others = [k for k in GROUPS if k != kind and (k, keyword) in self.sources]
        if blocked:
            words += f": {BLOCK_VARIABLE} leaves {blocked[0].blocked} out"
        elif others:
            words += f"; {keyword!r} is a {others[0]} type and belongs under {others[0]}s"
        elif near:
            words += f"; did you mean {near!r}?"
        words += f" (installed {kind} types: {', '.join(known) or 'none'})"
        if not blocked and (how := not_yet_installed(keyword)):
            words += f"; {how}"
        error = UnknownTypeError(words)
        error.nearest = near if near and not blocked and not others else None
        return error

    @staticmethod
    def _not_of_package(sources: list[Source], package: str) -> UnknownTypeError:
        """The error for ``package:keyword`` where other packages bring the keyword."""
        known = [f"{s.distribution}:{s.keyword}" for s in sources if s.distribution]
        what = f"the distribution {package!r} brings no {sources[0].kind} type"
        others = " and ".join(map(str, sources))
        error = UnknownTypeError(f"{what} {sources[0].keyword!r}, which is brought by {others}")
        error.nearest = nearest(f"{package}:{sources[0].keyword}", known) or None
        return error


@checked
def load_registry(*, groups: Collection[str] | None = None) -> Registry:
    """Find the installed types by their entry points; imports no plugin.

    Args:
        groups: entry-point groups to read, by default ``dap3d.joints``, ``dap3d.forces`` and
            ``dap3d.functions``; an empty collection gives an empty registry.
    """
    return Registry(by_keyword(discover(groups)))


def by_keyword(found: Iterable[Source]) -> dict[tuple[str, str], list[Source]]:
    """Sources by kind and keyword; several of one where packages collide."""
    sources: dict[tuple[str, str], list[Source]] = {}
    for source in found:
        sources.setdefault((source.kind, source.keyword), []).append(source)
    return sources


def info_of(source: Source, rivals: list[Source], load: Callable[[Source], object]) -> PluginInfo:
    """A line of the listing: the state of a type or an extension, and the fault if there is one.

    Args:
        source: its origin.
        rivals: all origins of its kind and keyword, itself as well.
        load: loads it, or raises a PluginError.
    """
    state, reason = "ok", ""
    active = [s for s in rivals if not s.blocked]
    if source.blocked:
        state, reason = "blocked", f"{BLOCK_VARIABLE} names {source.blocked}"
    elif not source.kind:
        state, reason = "broken", source.fault
    elif len(active) > 1:
        state, reason = "duplicate", collision(active)
    else:
        try:
            load(source)
        except PluginError as error:
            state, reason = "broken", str(error)
    s = source
    return PluginInfo(s.kind, s.keyword, s.distribution, s.version, s.module, state, reason)


def _plain(word: str) -> str:
    """A name of a type without what writers differ in: case, signs, "joint" behind it."""
    return re.sub(r"[^a-z]", "", word.casefold()).removesuffix("joint")


def _check_kind(kind: str) -> None:
    if kind not in GROUPS:
        raise ValueError(f"a kind is one of {', '.join(GROUPS)}, not {kind!r}")


def collision(sources: list[Source]) -> str:
    """The fault of several types with one keyword, and the remedies."""
    title = f"{noun_of(sources[0].kind)} {sources[0].keyword!r}"
    both = " and ".join(str(s) for s in sources)
    names = sorted({s.distribution for s in sources} - {""})
    leaving = " or ".join(f"{BLOCK_VARIABLE}={n}:{sources[0].keyword}" for n in names)
    if any(not s.distribution for s in sources):
        return (
            f"{title} is brought by {both}; rename the one in the model's own file, or leave the "
            f"installed one out with {leaving}"
        )
    if len(names) == 1:
        return f"{title} is declared twice, by {both}; update or uninstall {names[0]}"
    if sources[0].kind in EXTENSIONS:
        return (
            f"{title} is brought by {both}; uninstall one of them, or leave one out with {leaving}"
        )
    others = " or ".join(n for n in names if n != OWN)
    words = " or ".join(f'"{n}:{sources[0].keyword}"' for n in names)
    return (
        f"{title} is brought by {both}; say which one in the scene, type = {words}, give the one "
        f"of {others} another keyword, uninstall one of them, or leave one type out with {leaving}"
    )
