"""A mistake in a scene, and the error that reports all of them at once."""

from collections.abc import Iterable
from typing import Any, Final

import attrs

#: Where something stands in a scene file: names of tables and keys, places in lists from 0.
Key = tuple[str | int, ...]
#: Stands for the value of a key that is not there.
MISSING: Final = "<missing>"
#: How many mistakes are printed; all of them are in ``SceneError.mistakes``.
PRINTED = 1000


@attrs.frozen
class Mistake:
    """One thing that is wrong in a scene.

    Attributes:
        file: where the scene was read from, "" for one made by a script.
        line: line of the key in that file, or None.
        key: dotted, such as ``bodies.crank.mass``; "" for the file as a whole.
        value: what stands there; ``MISSING`` where nothing does.
        what: what is wrong, or what is allowed.
        nearest: the nearest right spelling, or "".
        remedy: what to do, or "".
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
    """A scene cannot be used; holds every mistake that was found.

    Attributes:
        mistakes: tuple of ``Mistake``, in the order of the file.
    """

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        lines = [str(m) for m in self.mistakes[:PRINTED]]
        if len(self.mistakes) > PRINTED:
            lines.append(f"... and {len(self.mistakes) - PRINTED} more mistakes")
        return "\n".join(lines)


def dotted(key: Key) -> str:
    """A key as messages write it; places in lists count from 1."""
    return ".".join(_part(part) for part in key)


def _part(part: str | int) -> str:
    if isinstance(part, int):
        return str(part + 1)
    return part if part and part.isprintable() else shown(part)


def shown(value: Any, width: int = 60) -> str:
    """A value in a message: as the scene file writes it, cut where it is long."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, dict):
        items = [f"{k} = {shown(v, width)}" for k, v in list(value.items())[:width]]
        text = "{" + ", ".join(items) + "}"
    elif isinstance(value, (tuple, list)):
        # A long value is cut anyway: its tail need not be written out.
        items = [shown(v, width) for v in value[: width // 2]]
        text = f"[{', '.join(items)}{', ...' if len(value) > len(items) else ''}]"
    elif isinstance(value, int) and value.bit_length() > 4 * width:
        # Python refuses to write out thousands of digits; a hexadecimal number may have them.
        first = abs(value) >> (value.bit_length() - 32)
        text = f"{'-' if value < 0 else ''}{first:#x} ... of {value.bit_length()} bits"
    elif isinstance(value, str):
        text = '"' + repr(value[:width])[1:-1] + '"'
    else:
        text = str(value.isoformat()) if hasattr(value, "isoformat") else repr(value)
        text = " ".join(text.split())
    return text if len(text) <= width else f"{text[: width - 4]} ..."
