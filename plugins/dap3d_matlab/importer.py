"""The importer of models of the MATLAB program DAP3D."""

from pathlib import Path

from dap3d_core.interface.formats import FolderImporter
from dap3d_core.registry import Registry
from dap3d_core.scene import Scene
from dap3d_matlab.files.report import ImportReport


class MatlabImporter(FolderImporter):
    """A folder with inBodies.m and the other files of a model."""

    keyword, title, marker = "matlab", "MATLAB", "inBodies.m"

    def read_folder(self, folder: Path, registry: Registry) -> tuple[Scene, ImportReport]:
        """The scene of a folder, and the report."""
        from dap3d_matlab.import_matlab import import_matlab

        return import_matlab(folder, registry)
