"""Importers, exporters, integrators and shapes of packages, found by their entry points."""

import importlib
import inspect
from functools import partial
from typing import Any

import attrs

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.hooks import EXTENSIONS
from dap3d_core.registry.discovery import Source, discover
from dap3d_core.registry.guard import guard, within
from dap3d_core.registry.loading import hooks_of
from dap3d_core.registry.registry import LOAD_LIMIT, PluginInfo, by_keyword, collision, info_of
from dap3d_core.registry.suggestions import did_you_mean

#: Module of each kind's hook and base class, and the name of the class.
_BASES = {
    "importer": ("dap3d_core.interface.formats", "Importer"),
    "exporter": ("dap3d_core.interface.formats", "Exporter"),
    "integrator": ("dap3d_core.interface.integrators", "RungeKuttaMethod"),
    "shape": ("dap3d_core.interface.shapes", "ShapeKind"),
}
#: Kinds whose base class can check what is declared.
_CHECKED = ("integrator", "shape")


@attrs.frozen(eq=False)
class Extensions:
    """The installed extensions of a kind.

    Attributes:
        kind: importer, exporter, integrator or shape.
        sources: origin of each, by keyword; one that DAP3D_BLOCK names is left out.
    """

    kind: str
    sources: dict[str, list[Source]]

    @property
    def keywords(self) -> tuple[str, ...]:
        """Their names, sorted."""
        return tuple(sorted(self.sources))

    @property
    def first(self) -> tuple[str, ...]:
        """Their names, those of dap3d itself before those of other packages."""

        def others(keyword: str) -> bool:
            return self.sources[keyword][0].distribution != "dap3d"

        return tuple(sorted(self.keywords, key=others))

    def load(self, keyword: str, limit_s: float | None = None) -> Any:
        """What the hook of a module returns with this keyword, checked: a class, or a method.

        Args:
            keyword: of the extension.
            limit_s: time limit of the loading of its module; by default none.

        Raises:
            PluginError: there is none, two packages bring it, its module is broken, or it fails the
                check of its kind.
        """
        sources = self.sources.get(keyword, [])
        if not sources:
            hint = did_you_mean(keyword, self.keywords, "; {}")
            known = ", ".join(self.keywords) or "none"
            raise PluginError(f"there is no {self.kind} {keyword!r}{hint} (installed: {known})")
        if len(sources) > 1:
            raise PluginError(collision(sources))
        return _load(sources[0], limit_s)


def extensions(kind: str) -> Extensions:
    """Find the extensions of a kind; imports none of them.

    Args:
        kind: importer, exporter, integrator or shape.
    """
    found = (s for s in discover((EXTENSIONS[kind][0],)) if s.kind and not s.blocked)
    return Extensions(kind, {word: same for (_, word), same in by_keyword(found).items()})


def extension_listing(limit_s: float | None = LOAD_LIMIT) -> list[PluginInfo]:
    """Every extension with its state; loads each in its own guard and raises nothing.

    Args:
        limit_s: time limit of the loading of each; one that takes longer is broken.
    """
    found = discover([group for group, _ in EXTENSIONS.values()])
    # entry points that cannot be read are in the listing of types
    same = by_keyword(source for source in found if source.kind)
    load = partial(_load, limit_s=limit_s)
    return [info_of(source, rivals, load) for rivals in same.values() for source in rivals]


def _load(source: Source, limit_s: float | None = None) -> Any:
    """What an entry point names, loaded within a time limit, s."""
    hook = EXTENSIONS[source.kind][1]
    module_name, base_name = _BASES[source.kind]
    specs = importlib.import_module(module_name)
    base = getattr(specs, base_name)
    with guard(source, []), within(limit_s):
        if source.fault:
            raise PluginError(source.fault)
        results = getattr(hooks_of(importlib.import_module(source.module), specs), hook)()
        brought = [one for result in results for one in result or ()]
        if not all(_is_a(one, base) for one in brought):
            raise PluginError(f"{hook}() should return a list of {base_name}")
        matching = [one for one in brought if one.keyword == source.keyword]
        if not matching:
            raise PluginError(f"{hook}() returns none with the keyword {source.keyword!r}")
        if source.kind in _CHECKED:
            matching[0].check()
        return matching[0]


def _is_a(one: Any, base: type) -> bool:
    """True for a subclass of the base, or one of its instances: a method is data."""
    return issubclass(one, base) if inspect.isclass(one) else isinstance(one, base)
