"""Replicas of MJCF: copies of elements, each in a frame that is moved further."""

from typing import TYPE_CHECKING

import attrs

from dap3d_core.interface.formats import FormatError, Frame, XmlElement, quaternion

if TYPE_CHECKING:
    from dap3d_formats.mjcf.document import Document

#: Elements of all replicas of a file beyond which it is refused.
MOST_COPIES = 100_000


def expand_replicas(document: "Document") -> None:
    """Put frames with copies in the place of each <replicate>, all over a document.

    Replica k has k times the offset and the rotation of the element, accumulated; names end in
    the separator and k, with zeros before it so that all are of one length.

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
        self.made += count * _size(element)
        if self.made > MOST_COPIES:
            raise FormatError(f"replicates make more than {MOST_COPIES} elements", element.place)
        turn = self.document.rotation(element)
        step = Frame(element.numbers("offset", 3, (0.0, 0.0, 0.0)), turn)
        copies, pose, digits = [], Frame(), len(str(count))
        for k in range(count):
            suffix = f"{element.get('sep', '')}{k:0{digits}d}"
            words = {
                "pos": " ".join(map(repr, pose.r.tolist())),
                "quat": " ".join(map(repr, quaternion(pose.A))),
            }
            inner = [_renamed(child, suffix) for child in element]
            copies.append(XmlElement("frame", words, element.place, inner))
            pose = pose @ step
        return copies


def _size(element: XmlElement) -> int:
    return 1 + sum(_size(child) for child in element)


def _renamed(element: XmlElement, suffix: str) -> XmlElement:
    """A copy of an element and all below, whose names end in a suffix."""
    given = dict(element.attributes)
    if "name" in given:
        given["name"] += suffix
    inner = [_renamed(child, suffix) for child in element]
    return attrs.evolve(element, attributes=given, children=inner)
