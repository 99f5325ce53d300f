"""The command line: each command calls the library and shows what it says."""

from dap3d_core.cli.group import dap3d, main

__all__ = ["dap3d", "main"]
