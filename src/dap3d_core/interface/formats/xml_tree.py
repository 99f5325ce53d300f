"""XML with line numbers, read by the parser of the standard library.

A document type is refused: with it go entities, of which bombs and readings of other files are
made. Nothing is fetched.
"""

import math
import re
from collections.abc import Iterator
from typing import Any
from xml.parsers import expat

import attrs

from dap3d_core.interface.formats.remarks import FormatError, Place

#: Depth of nested elements beyond which a file is refused.
DEEPEST = 200
#: Larger numbers are refused: no length, mass or angle of a model is, and their powers overflow.
LARGEST = 1e50
#: What comes before a declaration, and the declaration.
_LATE = re.compile(r"\A(?!<\?)(\s*(?:<!--(?:(?!-->).)*-->\s*)*)<\?xml[^>]*\?>", re.DOTALL)
#: Number of elements beyond which a file is refused.
MOST_ELEMENTS = 500_000


@attrs.define(eq=False)
class XmlElement:
    """An element: its name, attributes, text and children, and its place in the file.

    ``scope`` is for an importer that puts several files together: by whose settings it is read.
    """

    name: str
    attributes: dict[str, str]
    place: Place
    children: list["XmlElement"] = attrs.Factory(list)
    text: str = ""
    scope: str = ""

    def __iter__(self) -> Iterator["XmlElement"]:
        return iter(self.children)

    def all(self, name: str) -> list["XmlElement"]:
        """Its children of a name."""
        return [child for child in self.children if child.name == name]

    def first(self, name: str) -> "XmlElement | None":
        """Its first child of a name, or None."""
        return next((child for child in self.children if child.name == name), None)

    def get(self, key: str, default: str | None = None) -> str | None:
        """An attribute as text."""
        return self.attributes.get(key, default)

    def require(self, key: str) -> str:
        """An attribute that must be there.

        Raises:
            FormatError: it is missing.
        """
        value = self.attributes.get(key)
        if value is None or not value.strip():
            raise FormatError(f"<{self.name}> has no {key}; it is required", self.place)
        return value

    def number(
        self, key: str, default: float | None = None, *,
        unbounded: bool = False, least: float = -math.inf,
    ) -> float:  # fmt: skip
        """An attribute that is a number.

        Args:
            key: the attribute.
            default: where it is missing.
            unbounded: it may be infinite, or the largest number of a program, as limits are.
            least: the least that is allowed.

        Raises:
            FormatError: it is no finite number, below the least, or missing without a default.
        """
        if default is not None and key not in self.attributes:
            return default
        return self.numbers(key, 1, unbounded=unbounded, least=least)[0]

    def numbers(
        self, key: str, count: int | None = None, default: Any = None, *,
        unbounded: bool = False, least: float = -math.inf,
    ) -> tuple[float, ...]:  # fmt: skip
        """An attribute of several numbers, separated by spaces.

        Raises:
            FormatError: they are not ``count`` finite numbers, one is below the least, or they are
                missing without a default.
        """
        if default is not None and key not in self.attributes:
            return tuple(default)
        label = f"{key} of <{self.name}>"
        return _numbers_in(self.require(key), label, self.place, count, unbounded, least)

    def content(
        self, count: int | None = None, *, unbounded: bool = False, least: float = -math.inf
    ) -> tuple[float, ...]:
        """The numbers in its text.

        Raises:
            FormatError: they are not ``count`` finite numbers, or one is below the least.
        """
        return _numbers_in(self.text, f"<{self.name}>", self.place, count, unbounded, least)


def _numbers_in(
    text: str, label: str, place: Place, count: int | None, unbounded: bool, least: float
) -> tuple[float, ...]:
    """Numbers separated by spaces.

    Raises:
        FormatError: they are not ``count`` numbers, finite ones unless ``unbounded``, or one is
            below the least.
    """
    try:
        values = tuple(map(float, text.split()))
    except ValueError:
        values = (math.nan,)
    largest = math.inf if unbounded else LARGEST
    # Python takes 1_000 for a number; no format does
    known = "_" not in text and all(abs(x) <= largest for x in values)
    if not known or len(values) != (count or len(values)) or min(values, default=least) < least:
        finite = "" if unbounded else "finite "
        wanted = {None: f"{finite}numbers", 1: f"a {finite}number"}.get(
            count, f"{count} {finite}numbers"
        )
        bound = "" if least == -math.inf else f", {least:g} or more"
        shown = text.strip() if len(text) <= 60 else f"{text.strip()[:56]} ..."
        raise FormatError(f"{label} = {shown!r} should be {wanted}{bound}", place)
    return values


def parse_xml(text: str | bytes, file: str) -> XmlElement:
    """The root of an XML document.

    Its comments may hold ``--``, and its declaration may come after blanks and comments: XML
    forbids it, and the readers of Gazebo and MuJoCo allow it.

    Raises:
        FormatError: it is not well-formed, has a document type, or too many or too deep elements.
    """
    parser = expat.ParserCreate()
    builder = _Builder(parser, file)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        # Latin-1 has a character for each byte, whatever the encoding is
        bare = _repaired(text if isinstance(text, str) else text.decode("latin-1"))
        repaired = bare if isinstance(text, str) else bare.encode("latin-1")
        if repaired != text:
            return parse_xml(repaired, file)
        what = f"is not well-formed XML: {expat.errors.messages[error.code]}"
        raise FormatError(what, Place(file, error.lineno)) from None
    except (UnicodeError, LookupError, ValueError) as error:
        raise FormatError(f"is no text that can be read: {error}", Place(file)) from None
    return builder.root


def _repaired(text: str) -> str:
    """The text with an empty comment for each that holds ``--``; lines keep their numbers.

    A declaration that does not begin it is left out.
    """
    text = _LATE.sub(r"\1", text)
    parts, done = [], 0
    while (start := text.find("<!--", done)) >= 0:
        data = text.find("<![CDATA[", done, start)
        opening, closing = (start + 4, "-->") if data < 0 else (data, "]]>")
        stop = text.find(closing, opening)
        if stop < 0:
            break
        after = stop + len(closing)
        comment = "" if data >= 0 else text[opening:stop]
        if "--" in comment or comment.endswith("-"):
            parts.append(text[done:start] + "<!--" + "\n" * comment.count("\n") + "-->")
        else:
            parts.append(text[done:after])
        done = after
    return "".join([*parts, text[done:]])


class _Builder:
    """Makes elements of the events of a parser."""

    def __init__(self, parser: Any, file: str) -> None:
        self.root = XmlElement("", {}, Place(file))
        self._file, self._parser, self._count = file, parser, 0
        self._open: list[XmlElement] = []
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._refuse

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        place = Place(self._file, self._parser.CurrentLineNumber)
        self._count += 1
        if len(self._open) >= DEEPEST:
            raise FormatError(f"has elements nested {DEEPEST} deep; no model needs them", place)
        if self._count > MOST_ELEMENTS:
            raise FormatError(f"has more than {MOST_ELEMENTS} elements", place)
        element = XmlElement(name, attributes, place)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, name: str) -> None:
        self._open.pop()

    def _text(self, data: str) -> None:
        if self._open:
            self._open[-1].text += data

    def _refuse(self, *about: Any) -> None:
        place = Place(self._file, self._parser.CurrentLineNumber)
        what = "has a document type (<!DOCTYPE ...>), which is refused: it may define entities"
        raise FormatError(what, place, "remove it; no model needs one")
