"""Loads plugins, each in a guard: every failure is a ``PluginError``."""

import hashlib
import importlib
import inspect
import os
import sys
from functools import cache
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pluggy

from dap3d_core.interface import PluginError, hooks
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import fault_of_keyword, where_is
from dap3d_core.interface.examine.examine import examine
from dap3d_core.interface.hooks import GROUPS, KINDS, PROJECT
from dap3d_core.interface.types import INTERFACE_VERSION, TypeBase
from dap3d_core.registry.discovery import Source
from dap3d_core.registry.guard import guard, within
from dap3d_core.registry.regular_files import read_regular
from dap3d_core.registry.suggestions import did_you_mean

#: What modules of packages bring: the same in all registries of a process.
_loaded: dict[tuple[Source, ModuleType], TypeInfo] = {}


def load(
    source: Source, notes: list[str], limit_s: float | None = None, given_up: str = ""
) -> TypeInfo:
    """Import a plugin and examine the type that its entry point names.

    Args:
        source: the origin of the type.
        notes: takes the changes of the process that were undone.
        limit_s: time limit, s; None for no limit.
        given_up: the limit that another plugin of its package has exceeded: this one is not tried.

    Raises:
        PluginError: names distribution, module or file, reason and remedy.
    """
    module = sys.modules.get(source.module)
    if module is not None and (source, module) in _loaded:
        return _loaded[source, module]
    if limit_s is not None:
        importlib.import_module("dap3d_core.kernels")  # imported by all plugins: not counted
    with guard(source, notes), within(limit_s):
        if source.fault:
            raise PluginError(source.fault)
        if given_up and limit_s is not None:
            raise PluginError(f"its package was not loaded after {given_up}")
        type_: Any = source.type
        if type_ is None:
            module = importlib.import_module(source.module)
            type_ = _with_keyword(source, types_of(module, (source.kind,))[source.kind])
            _loaded[source, module] = examined(type_)
        return examined(type_)


@cache
def examined(type_: type[TypeBase]) -> TypeInfo:
    """The type of a class, examined once: what it says is the same in all registries."""
    return examine(type_)


def compile_kernels(source: Source, type_info: TypeInfo, notes: list[str]) -> None:
    """Compile all kernels of a loaded type.

    Raises:
        PluginError: one cannot be compiled; names distribution, module, reason and remedy.
    """
    # imported here: finding types by keyword does not need the compiler
    from dap3d_core.interface.codegen.compile_loops import compile_all

    with guard(source, notes):
        compile_all(type_info)


def load_file(path: Path, notes: list[str]) -> list[Source]:
    """Import a model's own Python file and return its types, one source each.

    The module name is made from path and contents, so that two models never share a module, and no
    bytecode is written.

    Raises:
        PluginError: names file, reason and remedy.
    """
    with guard(Source("", "", str(path)), notes):
        types = types_of(_module_of(path), tuple(GROUPS))
        sources = [
            Source(kind, type_.keyword, str(path), type=type_)
            for kind in GROUPS
            for type_ in types[kind]
        ]
        if not sources:
            raise PluginError("it brings no type; return at least one class from a hook")
        return sources


def types_of(module: ModuleType, kinds: tuple[str, ...]) -> dict[str, list[type[TypeBase]]]:
    """The types that a plugin module returns from its hooks.

    Args:
        module: the plugin.
        kinds: joint, force, function: the hooks to call. A single hook must exist.

    Raises:
        PluginError: wrong interface version, hook missing, unknown or of wrong signature, or it
            returns anything but a list of classes.
    """
    brought = hooks_of(module, hooks)
    return {kind: _call_hook(brought, kind, must_exist=len(kinds) == 1) for kind in kinds}


def _call_hook(brought: pluggy.HookRelay, kind: str, *, must_exist: bool) -> list[type[TypeBase]]:
    base, hook = KINDS[kind], GROUPS[kind][1]
    caller = getattr(brought, hook)
    if not caller.get_hookimpls():
        if must_exist:
            raise PluginError(
                f"it has no hook for a {kind}; write @hookimpl above def {hook}(), "
                "which returns a list of classes"
            )
        return []
    types: list[type[TypeBase]] = []
    for result in caller() or [None]:
        if not isinstance(result, (list, tuple)):
            given = result.__name__ if inspect.isclass(result) else repr(result)
            raise PluginError(f"{hook}() should return a list of classes; it returned {given}")
        for type_ in result:
            if not (inspect.isclass(type_) and issubclass(type_, base)):
                raise PluginError(
                    f"{hook}() should return subclasses of {base.__name__}; "
                    f"it returned {type_!r} among them"
                )
            if fault := fault_of_keyword(type_):
                raise PluginError(f"{where_is(type_)} {fault}")
            types.append(type_)
    return types


def hooks_of(module: ModuleType, specs: ModuleType) -> pluggy.HookRelay:
    """The hooks that a module implements, ready to be called.

    Args:
        module: the plugin.
        specs: the module that specifies the hooks.

    Raises:
        PluginError: no interface version, or another one; a hook is unknown, not marked, or of
            another signature.
    """
    _check_version(module)
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(specs)
    _check_hooks(module, manager)
    manager.register(module)
    return manager.hook


def _check_hooks(module: ModuleType, manager: pluggy.PluginManager) -> None:
    known = list(vars(manager.hook))
    for name, function in vars(module).items():
        if not inspect.isfunction(function):
            continue
        if manager.parse_hookimpl_opts(module, name) is None:
            if name in known:
                raise PluginError(f"{name}() is not marked; write @hookimpl above it")
        elif name not in known:
            hint = did_you_mean(name, known, otherwise=f"hooks: {', '.join(known)}")
            raise PluginError(f"there is no hook {name}(); {hint}")
        elif parameters := ", ".join(inspect.signature(function).parameters):
            raise PluginError(f"the hook {name}() takes no arguments; remove {parameters}")


def _check_version(module: ModuleType) -> None:
    version = getattr(module, "interface_version", None)
    if type(version) is not int:
        said = "says no interface_version" if version is None else f"says {version!r}"
        raise PluginError(
            f"it {said}; write the line interface_version = {INTERFACE_VERSION} (an integer) in it"
        )
    if version != INTERFACE_VERSION:
        newer = "dap3d" if version > INTERFACE_VERSION else "version of the plugin"
        raise PluginError(
            f"it is written for interface version {version}, this dap3d has {INTERFACE_VERSION}; "
            f"install a newer {newer}"
        )


def _with_keyword(source: Source, types: list[type[TypeBase]]) -> type[TypeBase]:
    matching = [t for t in types if t.keyword == source.keyword]
    if len(matching) == 1:
        return matching[0]
    if matching:
        names = " and ".join(t.__name__ for t in matching)
        raise PluginError(f"its classes {names} have the same keyword {source.keyword!r}")
    words = [t.keyword for t in types]
    known = f"its keywords: {', '.join(words) or '-'}"
    raise PluginError(
        f"it has no class with the keyword {source.keyword!r} that its entry point names; "
        f"{did_you_mean(source.keyword, words, otherwise=known)}"
    )


def _module_of(path: Path) -> ModuleType:
    """Run a file as a module with its source visible to ``inspect``; one per path and contents."""
    try:
        text = read_regular(path)
    except OSError as error:
        raise PluginError(f"it cannot be read: {error.strerror}") from error
    path = path.resolve()
    digest = hashlib.sha256(os.fsencode(path) + b"\0" + text).hexdigest()[:16]
    name = f"dap3d_model_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    module.__spec__ = spec_from_file_location(name, path)
    sys.modules[name] = module
    try:
        # The user has allowed this file by --allow-code; no bytecode is written.
        exec(compile(text, str(path), "exec", dont_inherit=True), vars(module))
    except BaseException:
        del sys.modules[name]
        raise
    return module
