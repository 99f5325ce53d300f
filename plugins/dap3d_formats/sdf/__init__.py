"""SDF, the format of Gazebo and Drake."""

from dap3d_core.interface.formats import Importer, hookimpl
from dap3d_formats.sdf.importer import SdfImporter

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[Importer]]:
    """The importers of this module."""
    return [SdfImporter]
