"""MJCF, the format of MuJoCo."""

from dap3d_core.interface.formats import Exporter, Importer, hookimpl

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[Importer]]:
    """The importers of this module."""
    from dap3d_formats.mjcf.importer import MjcfImporter

    return [MjcfImporter]


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    from dap3d_formats.mjcf.exporter import MjcfExporter

    return [MjcfExporter]
