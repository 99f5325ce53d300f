"""Text of XML files."""

from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import attrs


def words(numbers: Iterable[float]) -> str:
    """Numbers that read back as they are."""
    return " ".join(repr(float(x) + 0.0).removesuffix(".0") for x in numbers)


@attrs.define
class XmlText:
    """Lines of an XML file, indented."""

    lines: list[str] = attrs.Factory(lambda: ['<?xml version="1.0"?>'])
    depth: int = 0

    def open(self, tag: str, **attributes: str) -> None:
        """Open an element; what follows is in it."""
        self._add(f"<{self._with(tag, attributes)}>")
        self.depth += 1

    def close(self, tag: str) -> None:
        """Close an element."""
        self.depth -= 1
        self._add(f"</{tag}>")

    def empty(self, tag: str, **attributes: str) -> None:
        """Add an element without content."""
        self._add(f"<{self._with(tag, attributes)}/>")

    def text(self) -> str:
        """The text of the file."""
        return "\n".join([*self.lines, ""])

    def _add(self, line: str) -> None:
        self.lines.append("  " * self.depth + line)

    @staticmethod
    def _with(tag: str, attributes: dict[str, str]) -> str:
        """A tag with its attributes; a final _ of a name keeps it from being a word of Python."""
        pairs = (f"{k.rstrip('_')}={quoteattr(v)}" for k, v in attributes.items())
        return " ".join([tag, *pairs])
