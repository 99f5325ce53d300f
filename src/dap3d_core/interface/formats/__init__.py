"""The interface of file formats: what an importer returns and what an exporter is given."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar, Protocol

import pluggy

from dap3d_core.interface.formats.articulation import (
    FRICTION_DIRECTIONS,
    UNBOUNDED,
    WORLD,
    Actuator,
    Articulation,
    Contact,
    Coupling,
    Drum,
    Geometry,
    Inertial,
    Joint,
    Limits,
    Link,
    Tendon,
)
from dap3d_core.interface.formats.frames import (
    IDENTITY,
    Frame,
    axis_angle,
    euler_angles,
    from_quaternion,
    quaternion,
    rpy,
    rpy_of,
)
from dap3d_core.interface.formats.joint_inertia import LEAST, JointInertia
from dap3d_core.interface.formats.joint_motion import held
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Place, Remark, Remarks
from dap3d_core.interface.formats.solids import (
    balanced_inertia,
    inertia_moved,
    inertia_of_mesh,
    inertia_of_solid,
    total_inertia,
)
from dap3d_core.interface.formats.tendon_length import length_of_line
from dap3d_core.interface.formats.xml_tree import XmlElement, parse_xml
from dap3d_core.interface.types import INTERFACE_VERSION
from dap3d_core.kernels.array_types import Floats, Integers

__all__ = [
    "IDENTITY",
    "INTERFACE_VERSION",
    "LEAST",
    "NOWHERE",
    "FRICTION_DIRECTIONS",
    "UNBOUNDED",
    "WORLD",
    "Actuator",
    "Articulation",
    "Contact",
    "Coupling",
    "Drum",
    "Exporter",
    "FolderImporter",
    "FormatError",
    "Frame",
    "Geometry",
    "Importer",
    "Inertial",
    "Joint",
    "JointInertia",
    "Limits",
    "Link",
    "Place",
    "Remark",
    "Remarks",
    "ResultExporter",
    "Source",
    "Tendon",
    "XmlElement",
    "axis_angle",
    "balanced_inertia",
    "euler_angles",
    "from_quaternion",
    "held",
    "hookimpl",
    "inertia_moved",
    "inertia_of_mesh",
    "inertia_of_solid",
    "length_of_line",
    "parse_xml",
    "quaternion",
    "rpy",
    "rpy_of",
    "total_inertia",
]


hookspec = pluggy.HookspecMarker("dap3d")
hookimpl = pluggy.HookimplMarker("dap3d")


class Source(Protocol):
    """The file that is imported, and the files that it may name.

    Every file is read through it: it refuses those that lie outside of the folder of the model and
    of the packages that the user names.

    Attributes:
        path: the file.
        remarks: takes what is translated with a difference and what is left out.
        allow_code: whether the user allows that code of the file is run.
        contacts: whether shapes are to meet each other.
        packages: name of a package -> its folder.
        arguments: values that the user gives for names in the file, as those of macros.
        unused: names of arguments; an importer removes those that the file has, and what is left is
            refused.
        key: the keyframe that the model starts at; an importer that has them puts None there.
    """

    path: Path
    remarks: Remarks
    allow_code: bool
    contacts: bool
    packages: Mapping[str, Path]
    arguments: Mapping[str, str]
    unused: set[str]
    key: str | None

    def read_text(self) -> str:
        """The text of the file itself, UTF-8."""

    def xml(self) -> XmlElement:
        """The root of the file itself."""

    def include(self, name: str, place: Place, base: Path | None = None) -> XmlElement:
        """The root of another file that it names; a cycle is refused."""

    def has(self, name: str, base: Path | None = None) -> bool:
        """True if a file that it names is there, and may be read."""

    def including(self, name: str, base: Path | None = None) -> AbstractContextManager[None]:
        """While what an included file holds is read: it must not include itself."""

    def locate(
        self, uri: str, place: Place, base: Path | None = None, *, required: bool = False
    ) -> Path | None:
        """The path of a file that it names, such as a mesh; None, with a remark, if not found.

        With ``required`` it must be there.
        """

    def mesh(self, path: Path, place: Place) -> tuple[Floats, Integers]:
        """Vertices (k, 3) and triangles (m, 3) of a mesh file."""

    def image(self, path: Path, place: Place) -> Floats:
        """The red of each pixel of a PNG file, 0 to 1, in rows from the lowest."""


class Importer:
    """A format that models are read from.

    Attributes:
        keyword: its name: ``dap3d import --format KEYWORD``.
        title: its name for people.
        suffixes: endings of its files, such as ".urdf".
        roots: names of the root element, where its files are XML.
    """

    keyword: ClassVar[str] = ""
    title: ClassVar[str] = ""
    suffixes: ClassVar[tuple[str, ...]] = ()
    roots: ClassVar[tuple[str, ...]] = ()

    def read(self, source: Source) -> Articulation:
        """The model in a file.

        Raises:
            FormatError: it cannot be read.
        """
        raise NotImplementedError


class FolderImporter(Importer):
    """A format whose models are folders, and say what a scene says.

    Attributes:
        marker: name of the file by which a folder is known for a model.
    """

    marker: ClassVar[str] = ""

    def read_folder(self, folder: Path, registry: Any) -> tuple[Any, Any]:
        """The ``Scene`` of a folder, and a report: a record of attrs.

        The report has ``title``, that of the importer, ``folder``, ``files`` (with name, state and
        holds), ``defaulted``, ``changed``, ``unused`` (with text and place) and ``notes``; and of
        code that is not translated ``user_force``, its text, with ``stub``, a plugin.py to be
        completed, both "" without any.

        Args:
            folder: the folder, which may be none of a model.
            registry: the installed types.

        Raises:
            SceneError: it cannot be read; with files and lines.
        """
        raise NotImplementedError


class Exporter:
    """A format that models are written to.

    Attributes:
        keyword: its name: ``dap3d export --format KEYWORD``.
        title: its name for people.
        suffix: ending of its files.
    """

    keyword: ClassVar[str] = ""
    title: ClassVar[str] = ""
    suffix: ClassVar[str] = ""

    def write(self, model: Articulation, remarks: Remarks) -> str:
        """The text of a file.

        Args:
            model: the model; meshes have paths relative to the folder of the scene.
            remarks: takes what is translated with a difference and what is left out.

        Raises:
            FormatError: the format cannot say something that would change the mechanism.
        """
        raise NotImplementedError


class ResultExporter(Exporter):
    """A format that results are written to: ``dap3d export RESULT --format KEYWORD``."""

    def write_result(
        self, result: Any, path: Path, *, model: Any, progress: Callable[[int, int], None] | None
    ) -> Sequence[str]:
        """Write a file; returns notes of what is left out, and why.

        Args:
            result: the ``Result``, with one or more instants.
            path: the file, which gets its name at the end.
            model: the model (a name, a folder, a file) in whose folder meshes of shapes lie.
            progress: called as progress(done, total).

        Raises:
            ResultError: it cannot be written.
        """
        raise NotImplementedError


@hookspec
def dap3d_importers() -> list[type[Importer]]:
    """The importers of a module: a list of subclasses of ``Importer``."""
    raise NotImplementedError


@hookspec
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of a module: a list of subclasses of ``Exporter``."""
    raise NotImplementedError
