"""Collects mistakes and notes of the check of a scene, and locates them in its file."""

import contextlib
import re
import tomllib
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

_KEY = re.compile(
    r"""[ \t]*(?:(?P<bare>[A-Za-z0-9_-]+)"""
    r"""|(?P<basic>"(?:[^"\\\n]|\\.)*")|'(?P<literal>[^'\n]*)')[ \t]*"""
)
_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_COMMA_OR_BLANK = re.compile(r"(?:[ \t\r\n,]+|#[^\n]*)*")
_STRING = re.compile(
    r'''"""(?:\\.|[^\\])*?"{3,5}(?!")|\'\'\'.*?\'{3,5}(?!\')|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'''',
    re.DOTALL,
)
_FLAT_LIST = re.compile(r"""\[[^\[\]{}"'#]*\]""")
_PLAIN_VALUE = re.compile(r"[^,\]}#\n]*")


class Collector(MistakeList):
    """Mistakes and notes of a scene.

    Attributes:
        scene: the scene.
        muted: keys of values that other mistakes have left without meaning.
    """

    def __init__(self, scene: SceneTables) -> None:
        super().__init__(scene.faults)
        self.scene = scene
        self.muted: set[Key] = set()
        self._notes: dict[str, list[str]] = {}

    def add(self, key: Key, value: Any, what: str, nearest: str = "", remedy: str = "") -> None:
        """Append a mistake, unless its key, one above or one below it is muted."""
        if not any(key[: len(other)] == other[: len(key)] for other in self.muted):
            super().add(key, value, what, nearest, remedy)

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
    if path is None:
        return {}
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):  # deleted since: mistakes are reported without lines
        return {}
    return lines_of(text)


def lines_of(text: str) -> dict[Key, int]:
    """The line (from 1) of every table and key of a text that ``tomllib`` reads.

    Keys of tables in lists hold their index, from 0. An invalid text gives the lines up to the
    fault.
    """
    scanner = _Scanner(text)
    with contextlib.suppress(_LostError, RecursionError, IndexError):
        scanner.document()
    return scanner.found


class _LostError(Exception):
    """The text is not valid at this position."""


class _Scanner:
    """One pass over a text; ``at`` is its position."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.found: dict[Key, int] = {}
        self._counted_to = 0
        self._line = 1
        self._list_length: dict[Key, int] = {}

    def document(self) -> None:
        table: Key = ()
        self._skip(_BLANK)
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip(_BLANK)

    def _header(self) -> Key:
        in_list = self.text.startswith("[[", self.at)
        start = self.at
        self.at += 2 if in_list else 1
        key = self._in_lists(self._key())
        self.at += 2 if in_list else 1
        if in_list:
            place = self._list_length.get(key, 0)
            self._list_length[key] = place + 1
            self._note(key, start)
            key = (*key, place)
        for n in range(1, len(key) + 1):
            self._note(key[:n], start)
        return key

    def _in_lists(self, key: Key) -> Key:
        """The key with indices: a table below a list of tables belongs to its last one."""
        whole: Key = ()
        for n, part in enumerate(key):
            whole = (*whole, part)
            if n < len(key) - 1 and whole in self._list_length:
                whole = (*whole, self._list_length[whole] - 1)
        return whole

    def _pair(self, table: Key) -> None:
        start = self.at
        key = (*table, *self._key())
        for n in range(len(table) + 1, len(key) + 1):
            self._note(key[:n], start)
        self.at += 1  # the equals sign
        self._value(key)

    def _key(self) -> Key:
        parts: list[str] = []
        while True:
            match = self._skip(_KEY)
            if (basic := match["basic"]) is not None:
                parts.append(tomllib.loads(f"key = {basic}")["key"])
            else:
                parts.append(match["bare"] if match["bare"] is not None else match["literal"])
            if self.text[self.at] != ".":
                return tuple(parts)
            self.at += 1

    def _value(self, key: Key) -> None:
        self._skip(_BLANK)
        first = self.text[self.at]
        if first in "\"'":
            self._skip(_STRING)
        elif first == "{":
            self._note(key, self.at)
            self.at += 1
            self._skip(_COMMA_OR_BLANK)
            while self.text[self.at] != "}":
                self._pair(key)
                self._skip(_COMMA_OR_BLANK)
            self.at += 1
        elif first == "[":
            self._list(key)
        else:
            self._skip(_PLAIN_VALUE)

    def _list(self, key: Key) -> None:
        if match := _FLAT_LIST.match(self.text, self.at):
            self.at = match.end()
            return
        self.at += 1
        self._skip(_COMMA_OR_BLANK)
        place = 0
        while self.text[self.at] != "]":
            self._value((*key, place))
            place += 1
            self._skip(_COMMA_OR_BLANK)
        self.at += 1

    def _skip(self, pattern: re.Pattern[str]) -> re.Match[str]:
        match = pattern.match(self.text, self.at)
        if match is None:
            raise _LostError
        self.at = match.end()
        return match

    def _note(self, key: Key, at: int) -> None:
        if key not in self.found:
            self._line += self.text.count("\n", self._counted_to, at)
            self._counted_to = at
            self.found[key] = self._line
