"""Finds types by keyword: entry points are read at once, a plugin is imported on first use."""

from dap3d_core.interface.errors import PluginError
from dap3d_core.registry.discovery import BLOCK_VARIABLE
from dap3d_core.registry.registry import (
    LOAD_LIMIT,
    PluginInfo,
    Registry,
    UnknownTypeError,
    load_registry,
)

__all__ = [
    "BLOCK_VARIABLE", "LOAD_LIMIT", "PluginError", "PluginInfo", "Registry", "UnknownTypeError",
    "load_registry",
]  # fmt: skip
