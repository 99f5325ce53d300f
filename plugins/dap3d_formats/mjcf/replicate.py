"""Replicas of MJCF: copies of elements, each in a frame that is moved further."""

from collections.abc import Container, Iterator
from typing import TYPE_CHECKING

import attrs

from dap3d_core.interface.formats import FormatError, Frame, XmlElement, quaternion

if TYPE_CHECKING:
    from dap3d_formats.mjcf.document import Document

#: Elements of all replicas of a file beyond which it is refused.
MOST_COPIES = 100_000
#: Sections whose elements are copied with what they name, those first that others name.
NAMING = ("tendon", "equality", "actuator", "contact")


def expand_replicas(document: "Document") -> None:
    """Put frames with copies in the place of each <replicate>, all over a document.

    Replica k has k times the offset and the rotation of the element, accumulated; names end in
    the separator and k, with zeros before it so that all are of one length. Tendons, equalities,
    actuators and pairs that name one of these are copied with it.

    Raises:
        FormatError: the count is none, or there are too many copies.
    """
    _Replicator(document).expand(document.root)


@attrs.define
class _Replicator:
    document: "Document"
    made: int = 0

    def expand(self, element: XmlElement) -> None:
        children: list[XmlElement] = []
        for child in element:
            self.expand(child)
            children += self._copies(child) if child.name == "replicate" else [child]
        element.children = children

    def _copies(self, element: XmlElement) -> list[XmlElement]:
        number = element.number("count")
        if not number.is_integer() or number < 1.0:
            raise FormatError(f"count = {number:g} should be an integer above 0", element.place)
        count = int(number)
        self._count(count, element)
        turn = self.document.rotation(element)
        step = Frame(element.numbers("offset", 3, (0.0, 0.0, 0.0)), turn)
        copies, pose, digits = [], Frame(), len(str(count))
        suffixes = [f"{element.get('sep', '')}{k:0{digits}d}" for k in range(count)]
        self._copy_naming(set(_named(element)), suffixes)
        for suffix in suffixes:
            words = {
                "pos": " ".join(map(repr, pose.r.tolist())),
                "quat": " ".join(map(repr, quaternion(pose.A))),
            }
            inner = [_renamed(child, suffix) for child in element]
            copies.append(XmlElement("frame", words, element.place, inner))
            pose = pose @ step
        return copies

    def _count(self, copies: int, element: XmlElement) -> None:
        self.made += copies * _size(element)
        if self.made > MOST_COPIES:
            raise FormatError(f"replicates make more than {MOST_COPIES} elements", element.place)

    def _copy_naming(self, names: set[tuple[str, str]], suffixes: list[str]) -> None:
        """Copy elements outside of bodies that name one of those that are copied."""
        root = self.document.root
        for section in (one for tag in NAMING for one in root.all(tag)):
            children: list[XmlElement] = []
            for child in section:
                names_one = any(
                    (_kind(key), word) in names
                    for part in (child, *child)
                    for key, word in part.attributes.items()
                )
                if names_one:
                    self._count(len(suffixes), child)
                    children += [_renamed(child, suffix, names) for suffix in suffixes]
                    names |= {(section.name, child.get("name") or "")} - {(section.name, "")}
                else:
                    children.append(child)
            section.children = children


def _kind(key: str) -> str:
    """What an attribute names: sidesite a site, body1 a body, joint a joint."""
    return "site" if key.endswith("site") else key.removesuffix("inparent").rstrip("12")


def _named(element: XmlElement) -> Iterator[tuple[str, str]]:
    """The kinds and names of all elements below one."""
    for child in element:
        if "name" in child.attributes:
            yield child.name.removeprefix("free"), child.attributes["name"]
        yield from _named(child)


def _size(element: XmlElement) -> int:
    return 1 + sum(_size(child) for child in element)


def _renamed(
    element: XmlElement, suffix: str, names: Container[tuple[str, str]] = ()
) -> XmlElement:
    """A copy of an element and all below: its names, and those that it names, end in a suffix."""
    given = {
        key: word + suffix if key == "name" or (_kind(key), word) in names else word
        for key, word in element.attributes.items()
    }
    inner = [_renamed(child, suffix, names) for child in element]
    return attrs.evolve(element, attributes=given, children=inner)
