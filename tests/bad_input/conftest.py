"""The command line, as the end-to-end tests have it."""

from e2e.conftest import dap3d, refuse

__all__ = ["dap3d", "refuse"]
