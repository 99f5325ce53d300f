"""The formats floor: models of other programs as scenes, and scenes as their models."""

from dap3d_core.formats.export_model import ExportReport, export_model
from dap3d_core.formats.import_model import ImportReport, import_model

__all__ = ["ExportReport", "ImportReport", "export_model", "import_model"]
