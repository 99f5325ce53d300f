"""SDF, the format of Gazebo and Drake."""

from dap3d_core.interface.formats import Importer, hookimpl

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[Importer]]:
    """The importers of this module."""
    from dap3d_formats.sdf.importer import SdfImporter

    return [SdfImporter]
