"""Reads the files of a model: none outside of its folder and of packages that the user names."""

import os
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import attrs
import numpy as np

from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Place, Remarks
from dap3d_core.interface.formats.xml_tree import XmlElement, parse_xml
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.registry.regular_files import read_regular
from dap3d_core.scene.files.read_mesh import read_mesh

#: Larger files are not read, bytes.
LARGEST = 64 * 2**20
#: Meshes of more triangles, and images of more pixels, are refused.
MOST_TRIANGLES, MOST_PIXELS = 3_000_000, 1_000_000
#: Folders below the root that are looked through for packages.
MOST_FOLDERS = 50_000
#: Number of included files beyond which a model is refused, and their depth.
MOST_INCLUDES, DEEPEST_INCLUDE = 500, 30


class _UnknownPlaceError(FormatError):
    """A file is in a package that is not known, or would have to be fetched."""


@attrs.define(eq=False)
class SourceFiles:
    """The file that is imported, and those that it names (``interface.formats.Source``).

    Attributes:
        path: the file; the names in it are relative to its folder.
        folder: the folder that its files must lie in, or below.
        packages: name of a package -> its folder.
        allow_code: whether the user allows that code of the file is run.
        shapes: whether files of shapes are looked for.
        contacts: whether shapes are to meet each other.
        arguments: of macros, by name.
        unused: names of arguments that the file has not asked for.
        key: the keyframe that the model starts at, until an importer takes it.
        remarks: of the import.
        text: replaces the contents of the file, as the output of a macro processor.
    """

    path: Path
    folder: Path
    packages: Mapping[str, Path] = attrs.Factory(dict)
    allow_code: bool = False
    shapes: bool = True
    contacts: bool = False
    arguments: Mapping[str, str] = attrs.Factory(dict)
    unused: set[str] = attrs.Factory(lambda self: set(self.arguments), takes_self=True)
    key: str | None = None
    remarks: Remarks = attrs.Factory(Remarks)
    text: bytes | str | None = None
    _open: list[Path] = attrs.Factory(list)
    _count: int = 0
    _meshes: dict[Path, tuple[Floats, Integers]] = attrs.Factory(dict)
    _below: dict[str, list[Path]] | None = None

    def read_text(self) -> str:
        """The text of the file itself.

        Raises:
            FormatError: it cannot be read, is too large, or is not UTF-8.
        """
        try:
            return self._read(self.path, NOWHERE).decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = error.object[: error.start].count(b"\n") + 1
            what = f"{error.object[error.start]:#04x} is no character of UTF-8"
            raise FormatError(what, Place(self.path.name, line), "save it as UTF-8") from None

    def xml(self) -> XmlElement:
        """The root of the file itself."""
        if self.text is not None:
            return parse_xml(self.text, self.path.name)
        self._open = [self.path.resolve()]
        return parse_xml(self._read(self.path, NOWHERE), self.path.name)

    def include(self, name: str, place: Place, base: Path | None = None) -> XmlElement:
        """The root of another file that it names.

        Raises:
            FormatError: it is not found, lies elsewhere, or includes itself.
        """
        path = self._inside(name, place, base or self.path.parent)
        if not os.path.isfile(path):
            raise FormatError(f"there is no file {name}", place)
        resolved = path.resolve()
        self._count += 1
        if resolved in self._open:
            chain = " -> ".join(p.name for p in (*self._open, resolved))
            raise FormatError(f"the file includes itself: {chain}", place)
        if self._count > MOST_INCLUDES or len(self._open) > DEEPEST_INCLUDE:
            raise FormatError(f"includes more than {MOST_INCLUDES} files, or too deep", place)
        return parse_xml(self._read(path, place), self._name(path))

    def has(self, name: str, base: Path | None = None) -> bool:
        """True if a file that it names is there, and may be read."""
        try:
            return os.path.isfile(self._inside(name, NOWHERE, base or self.path.parent))
        except FormatError:
            return False

    @contextmanager
    def including(self, name: str, base: Path | None = None) -> Iterator[None]:
        """While what an included file holds is read: it must not include itself."""
        self._open.append(self._inside(name, NOWHERE, base or self.path.parent).resolve())
        try:
            yield
        finally:
            self._open.pop()

    def locate(
        self, uri: str, place: Place, base: Path | None = None, *, required: bool = False
    ) -> Path | None:
        """The path of the file of a shape; None, with a remark, where there is none.

        With ``required`` it must be there.

        Raises:
            FormatError: it lies outside of the folder of the model, or is required and not found.
        """
        if not self.shapes and not required:
            return None
        text, remedy = f"there is no file {uri}", ""
        try:
            path = self._inside(uri, place, base or self.path.parent, missing=True)
            if os.path.isfile(path):
                return path
        except _UnknownPlaceError as error:
            text, remedy = error.what, error.remedy
        if required:
            raise FormatError(f"{text}; its mass properties count", place, remedy)
        text += ": its shape is not drawn" + (", and meets no others" if self.contacts else "")
        text += f"; {remedy}" if remedy else ""
        self.remarks.leave_out(place, text, motion=self.contacts)
        return None

    def mesh(self, path: Path, place: Place) -> tuple[Floats, Integers]:
        """Vertices (k, 3) and triangles (m, 3) of a mesh file.

        Raises:
            FormatError: it cannot be read, is too large, or trimesh is not installed.
        """
        if path not in self._meshes:
            mesh = read_mesh(path, path.name)
            if isinstance(mesh, str):
                raise FormatError(mesh, place)
            if len(mesh[1]) > MOST_TRIANGLES:
                raise FormatError(f"{path.name} has more than {MOST_TRIANGLES} triangles", place)
            self._meshes[path] = mesh
        return self._meshes[path]

    def image(self, path: Path, place: Place) -> Floats:
        """The red of each pixel of a PNG file, 0 to 1, in rows from the lowest.

        Raises:
            FormatError: it is none, or is too large.
        """
        from PIL import Image

        try:
            with Image.open(BytesIO(self._read(path, place)), formats=("PNG",)) as image:
                if image.width * image.height > MOST_PIXELS:
                    raise FormatError(f"{path.name} has more than {MOST_PIXELS} pixels", place)
                if image.mode.startswith("I"):
                    return np.array(image)[::-1] // 256 / 255.0
                return np.array(image.convert("RGB"))[::-1, :, 0] / 255.0
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise FormatError(f"{path.name} is no PNG image: {error}", place) from None

    def _inside(self, uri: str, place: Place, base: Path, *, missing: bool = False) -> Path:
        """A path within the folder or a package; with ``missing`` also one that is nowhere."""
        root, name = self.folder, uri.strip()
        scheme, separator, rest = name.partition("://")
        if separator and scheme in ("package", "model"):
            package, _, name = rest.lstrip("/").partition("/")
            root = base = self._package(package, uri, place)
        elif separator and scheme == "file":
            name = rest
        elif separator:
            what = f"{uri!r} is no file of the model; nothing is fetched"
            raise _UnknownPlaceError(what, place)
        if "\0" in name or not name.isprintable():
            raise FormatError("the name of a file holds control characters", place)
        try:
            path = Path(os.path.normpath(base / name))
            roots = [root, *self.packages.values()]
            if any(path.resolve().is_relative_to(one.resolve()) for one in roots):
                return path
            if missing and not os.path.lexists(path):  # on the machine of its author
                return path
        except (OSError, RuntimeError, ValueError) as error:
            raise FormatError(f"{uri!r} is no path: {error}", place) from None
        remedy = "copy it there, or import with --root FOLDER, a folder that holds both"
        raise FormatError(f"{uri!r} lies outside of the folder of the model", place, remedy)

    def _package(self, package: str, uri: str, place: Place) -> Path:
        """The folder of a package: given, or the nearest one of its name within the root.

        It is above the file, beside such a folder, or the only one of its name anywhere below.
        """
        if package in self.packages:
            return self.packages[package]
        root = self.folder.resolve()
        above = [one for one in self.path.resolve().parents if one.is_relative_to(root)]
        for folder in (one for place in above for one in (place, place / package)):
            known = package and folder.name == package and os.path.isdir(folder)
            if known and folder.resolve().is_relative_to(root):
                return folder
        found = self._folders().get(package, [])
        if len(found) == 1:
            return found[0]
        what = f"{uri}: the package {package} is not known"
        option = f"--package {shlex.quote(f'{package}=FOLDER')}"
        remedy = f"name its folder with {option}, or one that holds it with --root"
        if found:
            what = f"{uri}: there are {len(found)} folders {package} within the root"
            remedy = f"name one with {option}"
        raise _UnknownPlaceError(what, place, remedy)

    def _folders(self) -> dict[str, list[Path]]:
        """The folders below the root by their names, but for hidden ones and links."""
        if self._below is None:
            self._below, count = {}, 0
            for folder, names, _ in os.walk(self.folder):
                names[:] = sorted(name for name in names if not name.startswith("."))
                for path in (Path(folder, name) for name in names):
                    if not path.is_symlink():
                        self._below.setdefault(path.name, []).append(path)
                count += len(names)
                if count > MOST_FOLDERS:
                    break
        return self._below

    def _read(self, path: Path, place: Place) -> bytes:
        try:
            data = read_regular(path, LARGEST + 1)
        except OSError as error:
            raise FormatError(f"{path} cannot be read: {error.strerror or error}", place) from None
        if len(data) > LARGEST:
            raise FormatError(f"{path.name} has more than {LARGEST >> 20} MiB", place)
        return data

    def _name(self, path: Path) -> str:
        """A file as messages name it: relative to the folder of the model."""
        try:
            return str(path.resolve().relative_to(self.folder.resolve()))
        except ValueError:
            return path.name
