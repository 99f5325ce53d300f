"""Gathers mistakes and notes while a scene is checked, and finds their lines at the end."""

from collections.abc import Collection
from typing import Any

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.errors import MISSING, Key, Mistake, SceneError, dotted
from dap3d_core.scene.scene import NAMED, Scene

#: Mistakes for which the nearest spelling is searched among all names of the scene.
SUGGESTIONS = 200
#: Notes of one kind that are written out; the rest is counted.
NOTES_OF_A_KIND = 10


class Collector:
    """What was found while checking a scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._mistakes: list[tuple[Key, Mistake]] = list(scene.faults)
        self._notes: dict[str, list[str]] = {}
        self._plain_notes: list[str] = list(scene.notes)

    def add(self, key: Key, value: Any, what: str, nearest: str = "", remedy: str = "") -> None:
        """Keep a mistake: where, what stands there, what is wrong, right spelling, remedy."""
        self._mistakes.append((key, Mistake(dotted(key), value, what, nearest, remedy)))

    def nearest(self, word: Any, allowed: Collection[str]) -> str:
        """The nearest right spelling; no longer searched after many mistakes, it takes time."""
        return nearest(word, allowed) if len(self._mistakes) < SUGGESTIONS else ""

    def has(self, key: Key) -> bool:
        """Whether a mistake was found at exactly this key."""
        return any(k == key for k, _ in self._mistakes)

    def extend(self, mistakes: list[tuple[Key, Mistake]]) -> None:
        """Keep mistakes that were found elsewhere."""
        self._mistakes += mistakes

    def note(self, text: str, kind: str = "") -> None:
        """Keep a note; of one kind only the first few are written out."""
        self._notes.setdefault(kind or text, []).append(text)

    def notes(self) -> list[str]:
        """All notes, in the order in which their kinds first came up."""
        found = list(self._plain_notes)
        for kind, texts in self._notes.items():
            found += texts[:NOTES_OF_A_KIND]
            if len(texts) > NOTES_OF_A_KIND:
                found.append(f"... and {len(texts) - NOTES_OF_A_KIND} more: {kind}")
        return found

    def raise_mistakes(self) -> None:
        """Raise all mistakes as one error, with file and lines, in the order of the file.

        Raises:
            SceneError: there is at least one.
        """
        if self._mistakes:
            raise SceneError(located(self.scene, self._mistakes))


def located(scene: Scene, mistakes: list[tuple[Key, Mistake]]) -> list[Mistake]:
    """Mistakes with the file and the line of their keys, sorted by line."""
    lines = _lines(scene)
    file = str(scene.path) if scene.path else ""
    found = []
    for key, mistake in mistakes:
        # What is missing is reported where its table begins; a table that a script made, nowhere.
        shortest = min(len(key), 2 if key[:1] and key[0] in NAMED else 1)
        parts = (key[:n] for n in range(len(key), shortest - 1, -1))
        line = next((lines[part] for part in parts if part in lines), None)
        found.append(
            Mistake(
                mistake.key,
                mistake.value,
                mistake.what,
                mistake.nearest,
                mistake.remedy,
                file,
                line,
            )
        )
    return sorted(found, key=lambda m: (m.line is None, m.line or 0))


def mistake_at(scene: Scene, key: Key, what: str, remedy: str = "") -> Mistake:
    """A mistake that a higher floor found: ``("joints", "J1")`` and what is wrong there."""
    return located(scene, [(key, Mistake(dotted(key), MISSING, what, remedy=remedy))])[0]


def _lines(scene: Scene) -> dict[Key, int]:
    """Lines of the keys in the file that a scene was read from, as it is now."""
    from dap3d_core.scene.files.line_numbers import lines_of

    if scene.path is None:
        return {}
    try:
        text = scene.path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):  # gone since: mistakes are reported without lines
        return {}
    return lines_of(text)
