"""MJCF, the format of MuJoCo."""

from dap3d_core.interface.formats import Articulation, Importer, Source


class MjcfImporter(Importer):
    """Bodies, joints, geoms, equalities and actuators of an MJCF file."""

    keyword, title = "mjcf", "MJCF"
    suffixes, roots = (".xml", ".mjcf"), ("mujoco",)

    def read(self, source: Source) -> Articulation:
        """The model in a file."""
        from dap3d_formats.mjcf.actuators import read_actuators
        from dap3d_formats.mjcf.constraints import read_equalities
        from dap3d_formats.mjcf.contacts import read_contacts
        from dap3d_formats.mjcf.copies import read_document
        from dap3d_formats.mjcf.keyframes import Keyframe
        from dap3d_formats.mjcf.reader import MjcfReader
        from dap3d_formats.mjcf.tendons import read_tendons

        reader = MjcfReader(read_document(source))
        reader.read_bodies()
        read_contacts(reader)
        keyframe = Keyframe.of(reader)
        reader.scale_masses()
        reader.add_armatures()
        inertia = reader.inertia()
        reader.scale_springs(inertia)
        read_tendons(reader)
        read_equalities(reader)
        read_actuators(reader, inertia, keyframe)
        keyframe.start()
        return reader.model
