"""Finds kinds of shapes that packages bring, where a scene names one that dap3d has not."""

import importlib
import inspect
from typing import TYPE_CHECKING

import pluggy

from dap3d_core.interface import INTERFACE_VERSION, PluginError
from dap3d_core.interface.hooks import PROJECT, SHAPE_GROUP
from dap3d_core.registry.discovery import Source, discover
from dap3d_core.registry.guard import guard

if TYPE_CHECKING:
    from dap3d_core.interface.shapes import ShapeKind


def added_shapes() -> dict[str, list[Source]]:
    """The installed kinds by keyword, without those that DAP3D_BLOCK leaves out; loads none."""
    sources: dict[str, list[Source]] = {}
    for source in discover((SHAPE_GROUP[0],)):
        if source.kind and not source.blocked:
            sources.setdefault(source.keyword, []).append(source)
    return sources


def load_shape(keyword: str) -> "type[ShapeKind]":
    """The kind of a keyword, checked.

    Raises:
        PluginError: there is none, two packages bring it, or its module is broken.
    """
    sources = added_shapes().get(keyword, [])
    if len(sources) > 1:
        both = " and ".join(map(str, sources))
        raise PluginError(f"shape {keyword!r} is brought by {both}; uninstall one of them")
    if not sources:
        raise PluginError(f"there is no shape {keyword!r}")
    (source,) = sources
    with guard(source, []):
        if source.fault:
            raise PluginError(source.fault)
        return _kind_of(source)


def _kind_of(source: Source) -> "type[ShapeKind]":
    from dap3d_core.interface import shapes

    module = importlib.import_module(source.module)
    version = getattr(module, "interface_version", None)
    if version != INTERFACE_VERSION:
        raise PluginError(
            f"it says interface_version = {version!r}; this dap3d has {INTERFACE_VERSION}"
        )
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(shapes)
    manager.register(module)
    manager.check_pending()
    hook = SHAPE_GROUP[1]
    listed: list[list[type[shapes.ShapeKind]]] = getattr(manager.hook, hook)()
    kinds = [one for several in listed for one in several or ()]
    if not all(inspect.isclass(one) and issubclass(one, shapes.ShapeKind) for one in kinds):
        raise PluginError(f"{hook}() should return a list of subclasses of ShapeKind")
    matching = [one for one in kinds if one.keyword == source.keyword]
    if not matching:
        raise PluginError(f"{hook}() returns no kind with the keyword {source.keyword!r}")
    shapes.check_shape(matching[0])
    return matching[0]
