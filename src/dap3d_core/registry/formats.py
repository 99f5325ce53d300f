"""Importers and exporters of file formats, found by their entry points and loaded in a guard."""

import importlib
import inspect
from typing import Any

import attrs
import pluggy

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.hooks import FORMAT_GROUPS
from dap3d_core.registry.discovery import Source, discover
from dap3d_core.registry.guard import guard
from dap3d_core.registry.suggestions import nearest


@attrs.frozen(eq=False)
class Formats:
    """The installed importers, or exporters.

    Attributes:
        kind: importer or exporter.
        sources: origin of each, by keyword; one that DAP3D_BLOCK names is left out.
    """

    kind: str
    sources: dict[str, list[Source]]

    @property
    def keywords(self) -> tuple[str, ...]:
        """Names of the formats, sorted."""
        return tuple(sorted(self.sources))

    def get(self, keyword: str) -> Any:
        """The importer or exporter of a keyword, made anew.

        Raises:
            PluginError: there is none, two packages bring it, or its module is broken.
        """
        sources = self.sources.get(keyword, [])
        if not sources:
            near = nearest(keyword, self.keywords)
            hint = f"; did you mean {near!r}?" if near else ""
            known = ", ".join(self.keywords) or "none"
            raise PluginError(f"there is no {self.kind} {keyword!r}{hint} (installed: {known})")
        if len(sources) > 1:
            both = " and ".join(map(str, sources))
            raise PluginError(
                f"{self.kind} {keyword!r} is brought by {both}; uninstall one of them"
            )
        return _load(sources[0])


def load_formats(kind: str) -> Formats:
    """Find the importers or exporters; imports none of them.

    Args:
        kind: importer or exporter.
    """
    sources: dict[str, list[Source]] = {}
    for source in discover((FORMAT_GROUPS[kind][0],)):
        if source.kind and not source.blocked:
            sources.setdefault(source.keyword, []).append(source)
    return Formats(kind, sources)


def _load(source: Source) -> Any:
    """An instance of the class that an entry point names.

    Raises:
        PluginError: names distribution, module, reason and remedy.
    """
    from dap3d_core.interface.formats import INTERFACE_VERSION, format_types

    with guard(source, []):
        if source.fault:
            raise PluginError(source.fault)
        module = importlib.import_module(source.module)
        version = getattr(module, "interface_version", None)
        if version != INTERFACE_VERSION:
            raise PluginError(
                f"it says interface_version = {version!r}, formats of this dap3d have "
                f"{INTERFACE_VERSION}"
            )
        hook = FORMAT_GROUPS[source.kind][1]
        manager = pluggy.PluginManager("dap3d")
        manager.add_hookspecs(format_types)
        manager.register(module)
        manager.check_pending()
        classes: list[Any] = [c for listed in getattr(manager.hook, hook)() for c in listed or ()]
        base = format_types.BASES[source.kind]
        if not all(inspect.isclass(class_) and issubclass(class_, base) for class_ in classes):
            raise PluginError(f"{hook}() should return subclasses of {base.__name__}")
        matching = [class_ for class_ in classes if class_.keyword == source.keyword]
        if matching:
            return matching[0]()
        raise PluginError(f"{hook}() returns no class with the keyword {source.keyword!r}")
