"""The exchange floor: results as files of other programs: VTK, glTF, MATLAB, CSV."""

from dap3d_core.exchange.export import FORMATS, Export, check_fps, export, format_of

__all__ = ["FORMATS", "Export", "check_fps", "export", "format_of"]
