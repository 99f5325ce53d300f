"""Notes on a run: what was changed of a request, and what is worth knowing."""

import re
from collections.abc import Iterable, Iterator

#: Severities: of what changes nothing of a request, and of what does (``--strict`` refuses it).
INFORMATION, WARNING = "information", "warning"
#: How a note of severity INFORMATION begins where it is printed or stored.
_PREFIX = "for information: "
#: Tables of a scene whose entries a note may begin with, as ``joints.J1: ...``.
_WHERE = re.compile(
    r"((?:bodies|points|vectors2?|joints|forces|functions|inputs|shapes|outputs)\.[^\s:]+): "
)


class Note(str):
    """A note: the line that is printed and stored, with its parts."""

    __slots__ = ()

    @property
    def severity(self) -> str:
        """``"information"`` or ``"warning"``."""
        return INFORMATION if self.startswith(_PREFIX) else WARNING

    @property
    def is_warning(self) -> bool:
        """True for what changes a request."""
        return self.severity == WARNING

    @property
    def where(self) -> str:
        """The entry of the scene that it is of, such as ``joints.J1``; ``""`` for the whole run."""
        found = _WHERE.match(self.removeprefix(_PREFIX))
        return found[1] if found else ""

    @property
    def text(self) -> str:
        """The sentence, without severity and entry."""
        line = self.removeprefix(_PREFIX)
        return line[len(self.where) + 2 :] if self.where else line


def information(text: str) -> Note:
    """A note that changes nothing of a request."""
    return Note(f"{_PREFIX}{text}")


def warnings_of(notes: Iterable[str]) -> Iterator[Note]:
    """The notes that are warnings."""
    return (note for note in map(Note, notes) if note.is_warning)
