"""Models of the MATLAB program DAP3D, whose files are read and never run."""

from dap3d_core.interface.formats import FolderImporter, hookimpl

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[FolderImporter]]:
    """The importers of this module."""
    from dap3d_matlab.importer import MatlabImporter

    return [MatlabImporter]
