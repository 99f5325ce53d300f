"""Import of models of the MATLAB program DAP3D, whose files are read and never run."""

from dap3d_core.matlab.files.report import FileFacts, ImportReport, Remark
from dap3d_core.matlab.import_matlab import import_matlab

__all__ = ["FileFacts", "ImportReport", "Remark", "import_matlab"]
