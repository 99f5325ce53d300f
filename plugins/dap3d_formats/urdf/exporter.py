"""Writes URDF."""

from dap3d_core.interface.formats import Articulation, Exporter, Remarks


class UrdfExporter(Exporter):
    """Links and joints as a URDF file."""

    keyword, title, suffix = "urdf", "URDF", ".urdf"

    def write(self, model: Articulation, remarks: Remarks) -> str:
        """The text of a file."""
        raise NotImplementedError
