"""SDF, the format of Gazebo and Drake: frames, nested models, closed loops."""

from dap3d_core.interface.formats import Articulation, FormatError, Importer, Source


class SdfImporter(Importer):
    """Links, joints, frames, nested and included models of an SDF file."""

    keyword, title = "sdf", "SDF"
    suffixes, roots = (".sdf", ".world"), ("sdf", "gazebo")

    def read(self, source: Source) -> Articulation:
        """The model in a file."""
        from dap3d_formats.sdf.joints import read_gearbox, read_joint
        from dap3d_formats.sdf.reader import SdfReader

        root = source.xml()
        if root.name not in self.roots:
            raise FormatError(f"an SDF file is an <sdf>, not a <{root.name}>", root.place)
        reader = SdfReader(source, root)
        reader.read_links()
        for element, scope in reader.elements:
            read_joint(reader, element, scope)
        for element, scope in reader.elements:
            if element.get("type") == "gearbox":
                read_gearbox(reader, element, scope)
        return reader.finish()
