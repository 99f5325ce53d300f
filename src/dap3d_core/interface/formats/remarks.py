"""What an import says: remarks with file and line, and the error that ends it."""

from collections.abc import Iterator

import attrs


@attrs.frozen
class Place:
    """A place in a file: its name as the user knows it, and a line or None."""

    file: str = ""
    line: int | None = None

    def __str__(self) -> str:
        return ":".join(str(part) for part in (self.file, self.line) if part)


#: No place in a file: of what a script makes.
NOWHERE = Place()


class FormatError(Exception):
    """A file cannot be imported, or a scene cannot be exported.

    Attributes:
        place: the place in the file; an empty one for a scene.
        what: the fault, and what is allowed.
        remedy: what to do, or "".
    """

    def __init__(self, what: str, place: Place | None = None, remedy: str = "") -> None:
        self.what, self.place, self.remedy = what, place or Place(), remedy
        super().__init__(what)

    def __str__(self) -> str:
        text = f"{self.place}: {self.what}" if str(self.place) else self.what
        return f"{text}\n    {self.remedy}" if self.remedy else text


@attrs.frozen
class Remark:
    """One line of a report.

    Attributes:
        place: the place in the file.
        text: the remark.
        count: number of places with the same remark, of which this is the first.
        motion: True where the difference changes the motion.
    """

    place: Place
    text: str
    count: int = 1
    motion: bool = False

    def __str__(self) -> str:
        more = f" ({self.count} times)" if self.count > 1 else ""
        text = f"{self.text}{more}"
        return f"{self.place}: {text}" if str(self.place) else text


@attrs.define
class Remarks:
    """Remarks on an import or export, each once, with the first of its places.

    Those of what changes the motion come first.

    Attributes:
        translated: contents that the scene says in another way, with the difference.
        left_out: contents without a counterpart.
    """

    _translated: dict[str, Remark] = attrs.Factory(dict)
    _left_out: dict[str, Remark] = attrs.Factory(dict)

    @property
    def translated(self) -> tuple[Remark, ...]:
        """Contents that the scene says in another way, with the difference."""
        return _ordered(self._translated)

    @property
    def left_out(self) -> tuple[Remark, ...]:
        """Contents without a counterpart."""
        return _ordered(self._left_out)

    def translate(self, place: Place, text: str, *, motion: bool = False) -> None:
        """Remark that something is said in another way, with ``motion`` if that changes it."""
        _add(self._translated, place, text, motion)

    def leave_out(self, place: Place, text: str, *, motion: bool = False) -> None:
        """Remark that something is left out, and why, with ``motion`` if that changes it."""
        _add(self._left_out, place, text, motion)

    def __iter__(self) -> Iterator[Remark]:
        yield from (*self.translated, *self.left_out)


def _ordered(remarks: dict[str, Remark]) -> tuple[Remark, ...]:
    return tuple(sorted(remarks.values(), key=lambda one: not one.motion))


def _add(remarks: dict[str, Remark], place: Place, text: str, motion: bool) -> None:
    first = remarks.get(text, Remark(place, text, 0))
    remarks[text] = attrs.evolve(first, count=first.count + 1, motion=first.motion or motion)
