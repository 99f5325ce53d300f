"""Finds integrators that packages bring, where a scene names one that dap3d has not."""

import importlib
from typing import TYPE_CHECKING

import pluggy

from dap3d_core.interface import INTERFACE_VERSION, PluginError
from dap3d_core.interface.hooks import INTEGRATOR_GROUP, PROJECT
from dap3d_core.registry.discovery import Source, discover
from dap3d_core.registry.guard import guard

if TYPE_CHECKING:
    from dap3d_core.interface.integrators import RungeKuttaMethod


def added_integrators() -> dict[str, list[Source]]:
    """The installed integrators by name, without those that DAP3D_BLOCK leaves out; loads none."""
    sources: dict[str, list[Source]] = {}
    for source in discover((INTEGRATOR_GROUP[0],)):
        if source.kind and not source.blocked:
            sources.setdefault(source.keyword, []).append(source)
    return sources


def load_integrator(name: str) -> "RungeKuttaMethod":
    """The method of a name, checked.

    Raises:
        PluginError: there is none, two packages bring it, its module is broken, or it is not of the
            order that it says.
    """
    sources = added_integrators().get(name, [])
    if len(sources) > 1:
        both = " and ".join(map(str, sources))
        raise PluginError(f"integrator {name!r} is brought by {both}; uninstall one of them")
    if not sources:
        raise PluginError(f"there is no integrator {name!r}")
    (source,) = sources
    with guard(source, []):
        if source.fault:
            raise PluginError(source.fault)
        method = _method_of(source)
        method.check()
        return method


def _method_of(source: Source) -> "RungeKuttaMethod":
    from dap3d_core.interface import integrators

    module = importlib.import_module(source.module)
    version = getattr(module, "interface_version", None)
    if version != INTERFACE_VERSION:
        raise PluginError(
            f"it says interface_version = {version!r}; this dap3d has {INTERFACE_VERSION}"
        )
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(integrators)
    manager.register(module)
    manager.check_pending()
    hook = INTEGRATOR_GROUP[1]
    listed: list[list[integrators.RungeKuttaMethod]] = getattr(manager.hook, hook)()
    methods = [one for several in listed for one in several or ()]
    if not all(isinstance(one, integrators.RungeKuttaMethod) for one in methods):
        raise PluginError(f"{hook}() should return a list of RungeKuttaMethod")
    matching = [one for one in methods if one.keyword == source.keyword]
    if not matching:
        raise PluginError(f"{hook}() returns no method with the keyword {source.keyword!r}")
    return matching[0]
