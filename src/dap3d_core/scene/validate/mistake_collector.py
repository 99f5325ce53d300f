"""Collects mistakes and notes of the check of a scene, and locates them in its file."""

from collections.abc import Callable
from typing import Any

import attrs

from dap3d_core.scene.errors import MISSING, Key, Mistake, MistakeList, SceneError, dotted
from dap3d_core.scene.scene import NAMED, Scene
from dap3d_core.scene.validate.coerce_values import Fault

#: Notes of one kind that are written out; the others are counted.
NOTES_OF_A_KIND = 10


class Collector(MistakeList):
    """Mistakes and notes of a scene."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene.faults)
        self.scene = scene
        self._notes: dict[str, list[str]] = {}

    def read(self, key: Key, value: Any, reader: Callable[[Any], Any], doc: str = "") -> Any:
        """The value of a field as its reader returns it; a ``Fault`` is reported under its key.

        Args:
            key: of the field.
            value: as written; ``MISSING`` where it is required and missing.
            reader: returns the value that is used, or a ``Fault``.
            doc: description of a required field, for the message.
        """
        result = Fault(f"is required{doc}") if value is MISSING else reader(value)
        if isinstance(result, Fault):
            what = result.what
            if value is None:
                value, what = MISSING, f"is required; it {what.removesuffix(', not nothing')}"
            self.add(key, value, what, result.nearest, result.remedy)
        return result

    def note(self, text: str, kind: str = "") -> None:
        """Append a note; of one kind only the first few are written out."""
        self._notes.setdefault(kind or text, []).append(text)

    def notes(self) -> list[str]:
        """All notes, in the order in which their kinds first occurred."""
        notes = list(self.scene.notes)
        for kind, texts in self._notes.items():
            notes += texts[:NOTES_OF_A_KIND]
            if len(texts) > NOTES_OF_A_KIND:
                notes.append(f"... and {len(texts) - NOTES_OF_A_KIND} more: {kind}")
        return notes

    def raise_mistakes(self) -> None:
        """Raise all mistakes as one error, with file and lines, in the order of the file.

        Raises:
            SceneError: there is at least one.
        """
        if self.mistakes:
            raise SceneError(located(self.scene, self.mistakes))


def located(scene: Scene, mistakes: list[tuple[Key, Mistake]]) -> list[Mistake]:
    """Mistakes with the file and the line of their keys, sorted by line."""
    lines = _lines(scene)
    file = str(scene.path) if scene.path else ""

    def line_of(key: Key) -> int | None:
        """Line of a key; of a missing key that of its table; None in a table made by a script."""
        shortest = min(len(key), 2 if key[:1] and key[0] in NAMED else 1)
        parts = (key[:n] for n in range(len(key), shortest - 1, -1))
        return next((lines[part] for part in parts if part in lines), None)

    result = [attrs.evolve(m, file=file, line=line_of(key)) for key, m in mistakes]
    return sorted(result, key=lambda m: (m.line is None, m.line or 0))


def mistake_at(scene: Scene, key: Key, what: str, remedy: str = "") -> Mistake:
    """A mistake found by a higher floor, located: ``("joints", "J1")`` and the fault there."""
    return located(scene, [(key, Mistake(dotted(key), MISSING, what, remedy=remedy))])[0]


def _lines(scene: Scene) -> dict[Key, int]:
    """Lines of the keys in the file that a scene was read from, in its present state."""
    from dap3d_core.scene.files.line_numbers import lines_of

    if scene.path is None:
        return {}
    try:
        text = scene.path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):  # deleted since: mistakes are reported without lines
        return {}
    return lines_of(text)
