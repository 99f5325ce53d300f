"""Mistakes in a scene, and the error that reports all of them at once."""

import math
from collections.abc import Callable, Collection, Iterable
from typing import Any, Final

import attrs

from dap3d_core.registry.suggestions import nearest

#: Path to a value in a scene file: names of tables and keys, indices in lists from 0.
Key = tuple[str | int, ...]
#: Value of a key that is missing.
MISSING: Final = "<missing>"
#: Number of mistakes printed; all of them are in ``SceneError.mistakes``.
PRINTED = 1000
#: Number of mistakes up to which the nearest spelling is searched: it takes time.
SUGGESTIONS = 200


@attrs.frozen
class Mistake:
    """A mistake in a scene.

    Attributes:
        file: the scene file, "" for a scene made by a script.
        line: line of the key in that file, or None.
        key: dotted, such as ``bodies.crank.mass``; "" for the file as a whole.
        value: the value given; ``MISSING`` where there is none.
        what: the fault, or the allowed values.
        nearest: the nearest right spelling, or "".
        remedy: the remedy, or "".
    """

    key: str
    value: Any
    what: str
    nearest: str = ""
    remedy: str = ""
    file: str = ""
    line: int | None = None

    def __str__(self) -> str:
        file = self.file if self.file.isprintable() else shown(self.file, len(self.file))
        place = ":".join(str(p) for p in (file, self.line) if p)
        given = "" if self.value is MISSING or not self.key else f" = {shown(self.value)}"
        text = f"{self.key}{given}: {self.what}" if self.key else self.what
        text = f"{place}: {text}" if place else text
        if self.nearest:
            text += f"; did you mean {self.nearest!r}?"
        return f"{text}\n    {self.remedy}" if self.remedy else text


class SceneError(Exception):
    """The scene cannot be used.

    Attributes:
        mistakes: every ``Mistake``, in the order of the file.
    """

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        lines = [str(m) for m in self.mistakes[:PRINTED]]
        if len(self.mistakes) > PRINTED:
            lines.append(f"... and {len(self.mistakes) - PRINTED} more mistakes")
        return "\n".join(lines)


class MistakeList:
    """Mistakes with their keys, in the order in which they are found."""

    def __init__(self, mistakes: Iterable[tuple[Key, Mistake]] = ()) -> None:
        self.mistakes = list(mistakes)

    def add(self, key: Key, value: Any, what: str, nearest: str = "", remedy: str = "") -> None:
        """Append a mistake: its key, the value, the fault, the right spelling, the remedy."""
        self.mistakes.append((key, Mistake(dotted(key), value, what, nearest, remedy)))

    def add_unknown_keys(
        self,
        key: Key,
        table: dict[str, Any],
        allowed: Collection[str],
        *,
        in_order: bool = False,
        remedy: Callable[[str], str] = lambda name: "",
    ) -> None:
        """Append a mistake for each key of a table that is not allowed.

        Args:
            key: of the table.
            table: its content.
            allowed: the keys it may have.
            in_order: list these in their order, else sorted.
            remedy: of a key that is not allowed.
        """
        if table.keys() <= set(allowed):
            return
        words = allowed if in_order else sorted(allowed)
        what = f"unknown key; allowed: {', '.join(words) or 'none'}"
        for name, value in table.items():
            if name not in allowed:
                self.add((*key, name), value, what, self.nearest(name, allowed), remedy(name))

    def nearest(self, word: Any, allowed: Collection[str]) -> str:
        """The nearest right spelling; "" after many mistakes."""
        return nearest(word, allowed) if len(self.mistakes) < SUGGESTIONS else ""

    def raise_mistakes(self) -> None:
        """Raise all mistakes as one error.

        Raises:
            SceneError: there is at least one.
        """
        if self.mistakes:
            raise SceneError(mistake for _, mistake in self.mistakes)


def file_error(file: Any, what: str, *, line: int | None = None, remedy: str = "") -> SceneError:
    """The error for a file or a folder as a whole."""
    return SceneError([Mistake("", MISSING, what, remedy=remedy, file=str(file), line=line)])


def dotted(key: Key) -> str:
    """A key as messages write it; indices in lists count from 1."""
    return ".".join(_part(part) for part in key)


def _part(part: str | int) -> str:
    if isinstance(part, int):
        return str(part + 1)
    return part if part and part.isprintable() else shown(part)


def shown(value: Any, width: int = 60) -> str:
    """A value in a message: as the scene file writes it, shortened where it is long."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, dict):
        items = [f"{k} = {shown(v, width)}" for k, v in list(value.items())[:width]]
        text = "{" + ", ".join(items) + "}"
    elif isinstance(value, (tuple, list)):
        items = [shown(v, width) for v in value[: width // 2]]
        text = f"[{', '.join(items)}{', ...' if len(value) > len(items) else ''}]"
    elif isinstance(value, int) and value.bit_length() > 4 * width:
        # Python refuses to write out thousands of digits; a hexadecimal number may have them.
        cut = value.bit_length() - 64
        size, power = math.modf(math.log10(abs(value) >> cut) + cut * math.log10(2.0))
        text = f"{'-' if value < 0 else ''}{10.0**size:.3g}e+{power:.0f}"
    elif isinstance(value, str):
        text = '"' + repr(value[:width])[1:-1] + '"'
    else:
        text = str(value.isoformat()) if hasattr(value, "isoformat") else repr(value)
        text = " ".join(text.split())
    return text if len(text) <= width else f"{text[: width - 4]} ..."
