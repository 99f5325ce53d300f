"""URDF, the Unified Robot Description Format of ROS, and its macros, xacro."""

from dap3d_core.interface.formats import Articulation, FormatError, Importer, Source


class UrdfImporter(Importer):
    """Links, joints, mimic and ``<constraint>`` loops of a URDF file."""

    keyword, title = "urdf", "URDF"
    suffixes, roots = (".urdf", ".xacro"), ("robot",)

    def read(self, source: Source) -> Articulation:
        """The model in a file."""
        from dap3d_formats.urdf.reader import UrdfReader

        root = source.xml()
        has_macros = any(child.name.startswith("xacro:") for child in root)
        if source.path.suffix.lower() == ".xacro" or has_macros:
            from dap3d_formats.urdf.xacro import expanded

            root = expanded(source, root)
        if root.name != "robot":
            raise FormatError(f"a URDF file is a <robot>, not a <{root.name}>", root.place)
        return UrdfReader(source, root).read()
