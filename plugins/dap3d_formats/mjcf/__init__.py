"""MJCF, the format of MuJoCo."""

from dap3d_formats.mjcf.importer import MjcfImporter

from dap3d_core.interface.formats import Importer, hookimpl

interface_version = 1


@hookimpl
def dap3d_importers() -> list[type[Importer]]:
    """The importers of this module."""
    return [MjcfImporter]
