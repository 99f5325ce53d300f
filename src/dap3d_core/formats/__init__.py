"""The formats floor: models of other programs as scenes, and scenes as their models."""

from dap3d_core.formats.import_model import ImportReport, import_model

__all__ = ["ImportReport", "import_model"]
