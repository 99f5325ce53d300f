"""Line numbers of the keys of a TOML text; needed only to report a mistake."""

import contextlib
import re
import tomllib

from dap3d_core.scene.errors import Key

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
