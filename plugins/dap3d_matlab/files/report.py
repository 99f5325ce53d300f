"""Report of an import: files, names, defaults, changes and omissions."""

from typing import ClassVar

import attrs

from dap3d_core.interface.formats import Place


@attrs.frozen
class Remark:
    """A remark on a place in a file.

    Attributes:
        file: name of the file in the folder.
        line: in that file, or None.
        text: the remark.
    """

    file: str
    line: int | None
    text: str

    @property
    def place(self) -> Place:
        """File and line."""
        return Place(self.file, self.line)

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


@attrs.frozen
class FileFacts:
    """A file of the folder: its name, its state, its content for users.

    ``state`` is read, absent, shown (user_force.m) or "not read".
    """

    name: str
    state: str
    holds: str


@attrs.define
class ImportReport:
    """The report of an import.

    Attributes:
        folder: of the MATLAB model.
        files: the files of the model, and other files of the folder.
        names: name in the scene -> name in MATLAB, such as ``Bodies(1) (B1)``.
        defaulted: missing values, with the manual's defaults.
        changed: values that were converted.
        unused: values without a meaning here, left out.
        notes: notes of the check of the scene.
        user_force: text of user_force.m where a force is of type user, else "".
        stub: a ``plugin.py`` for it, to be completed; "" where none is needed.
    """

    title: ClassVar[str] = "MATLAB"
    folder: str
    files: list[FileFacts] = attrs.field(factory=list)
    names: dict[str, str] = attrs.field(factory=dict)
    defaulted: list[Remark] = attrs.field(factory=list)
    changed: list[Remark] = attrs.field(factory=list)
    unused: list[Remark] = attrs.field(factory=list)
    notes: list[str] = attrs.field(factory=list)
    user_force: str = ""
    stub: str = ""


def remark(place: Place, text: str) -> Remark:
    """A remark at a place, with the name of the file without its folder."""
    name = place.file.replace("\\", "/").rpartition("/")[2]
    return Remark(name, place.line, text)
