"""URDF, the Unified Robot Description Format of ROS."""

from dap3d_core.interface.formats import Exporter, Importer, hookimpl

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[Importer]]:
    """The importers of this module."""
    from dap3d_formats.urdf.importer import UrdfImporter

    return [UrdfImporter]


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    from dap3d_formats.urdf.exporter import UrdfExporter

    return [UrdfExporter]
