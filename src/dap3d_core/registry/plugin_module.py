"""The hooks of a plugin's module, after the version of the interface that it is written for."""

from types import ModuleType

import pluggy

from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.hooks import PROJECT
from dap3d_core.interface.types import INTERFACE_VERSION


def hooks_of(module: ModuleType, specs: ModuleType) -> pluggy.HookRelay:
    """The hooks that a module implements, ready to be called.

    Args:
        module: the plugin.
        specs: the module that specifies the hooks.

    Raises:
        PluginError: no interface version, or another one.
        pluggy.PluginValidationError: a hook is unknown, or of another signature.
    """
    _check_version(module)
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(specs)
    manager.register(module)
    manager.check_pending()
    return manager.hook


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
