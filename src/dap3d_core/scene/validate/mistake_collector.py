"""Collects mistakes and notes of the check of a scene, and locates them in its file."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.scene.errors import MISSING, Key, Mistake, MistakeList, SceneError, dotted
from dap3d_core.scene.tables import NAMED, SceneTables
from dap3d_core.scene.validate.coerce_values import Fault

#: Notes of one kind that are written out; the others are counted.
NOTES_OF_A_KIND = 10
#: Tables of words, which in sub-assemblies have the names of these before them.
WORDS = ("parameters", "inputs", "outputs")


class Collector(MistakeList):
    """Mistakes and notes of a scene."""

    def __init__(self, scene: SceneTables) -> None:
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

    def add_missing_type(self, key: Key, fields: Mapping[str, Any], what: str) -> None:
        """Report that an element has no type; or the key that is its misspelling, as ``typ``.

        Args:
            key: of the element.
            fields: as written.
            what: that it is required, and what it may be.
        """
        near = [field for field in fields if self.nearest(field, ("type",))]
        if near:
            self.add((*key, near[0]), fields[near[0]], f"unknown key; type {what}", "type")
        else:
            self.add((*key, "type"), MISSING, what)

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


def located(scene: SceneTables, mistakes: list[tuple[Key, Mistake]]) -> list[Mistake]:
    """Mistakes with the file and the line of their keys, sorted by line."""
    files = {"": scene.path} | scene.included
    lines = {name: _lines(path) for name, path in files.items()}

    def place_of(key: Key) -> tuple[str, int | None]:
        """File and line of a key; of a missing key that of its table; None in a script's table."""
        shortest, name = min(len(key), 2 if key[:1] and key[0] in NAMED else 1), ""
        if shortest == 2 and "/" in str(key[1]):
            head, _, tail = str(key[1]).rpartition("/")
            name, key = (head, (key[0], tail, *key[2:])) if head in files else ("", key)
        elif key[:1] and key[0] in WORDS and key[:2] not in lines[""]:
            name, key = next(_of_part(key, lines), ("", key))
        parts = (key[:n] for n in range(len(key), shortest - 1, -1))
        line = next((lines[name][part] for part in parts if part in lines[name]), None)
        return str(files[name] or ""), line

    result = []
    for key, mistake in mistakes:
        file, line = place_of(key)
        result.append(attrs.evolve(mistake, file=file, line=line))
    return sorted(result, key=lambda m: (m.line is None, m.line or 0))


def _of_part(key: Key, lines: Mapping[str, Mapping[Key, int]]) -> Iterator[tuple[str, Key]]:
    """The files and keys that may have given a parameter, input or output of a sub-assembly."""
    table, long_word = str(key[0]), str(key[1])
    for name in lines:
        word = long_word.removeprefix(f"{name.replace('/', '_')}_")
        outer, _, last = name.rpartition("/")
        given: Key = ("include", last, table, word)
        if word != long_word and given in lines.get(outer, {}):
            yield outer, given
        if word != long_word and (table, word) in lines[name]:
            yield name, (table, word, *key[2:])


def mistake_at(scene: SceneTables, key: Key, what: str, remedy: str = "") -> Mistake:
    """A mistake found by a higher floor, located: ``("joints", "J1")`` and the fault there."""
    return located(scene, [(key, Mistake(dotted(key), MISSING, what, remedy=remedy))])[0]


def _lines(path: Path | None) -> dict[Key, int]:
    """Lines of the keys in a scene file, in its present state."""
    from dap3d_core.scene.files.line_numbers import lines_of

    if path is None:
        return {}
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):  # deleted since: mistakes are reported without lines
        return {}
    return lines_of(text)
