"""What was understood of a MATLAB model, what was filled in, and what was left out."""

import attrs

from dap3d_core.matlab.language.parse import Place


@attrs.frozen
class Remark:
    """Something worth saying, and where it stands.

    Attributes:
        file: name of the file in the folder.
        line: in that file, or None.
        text: what there is to say.
    """

    file: str
    line: int | None
    text: str

    def __str__(self) -> str:
        place = ":".join(str(p) for p in (self.file, self.line) if p)
        return f"{place}: {self.text}"


@attrs.frozen
class FileFacts:
    """A file of the folder: its name, what was done with it, what it holds in words.

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
        files: the files of the model, and others that stand beside them.
        names: name in the scene -> what MATLAB calls it, such as ``Bodies(1) (B1)``.
        defaulted: values that the files leave out, with the manual's defaults.
        changed: what was read in another form than it is written.
        unused: what has no meaning here and was left out.
        notes: what the check of the scene has to say.
        user_force: text of user_force.m where a force is of type user, else "".
        stub: a ``plugin.py`` for it, to be filled in; "" where none is needed.
    """

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
    """A remark at a place; of the path only the name is kept."""
    name = place.file.replace("\\", "/").rpartition("/")[2]
    return Remark(name, place.line, text)
