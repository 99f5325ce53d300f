"""Shapes of links and their colours, as several formats have them."""

from collections.abc import Callable, Iterable

from dap3d_core.interface.formats import Geometry, Link, Source, XmlElement
from dap3d_formats.element_table import NO_CONTACTS

#: Kind of a shape -> names of its sizes, with the count of the numbers of each.
SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}


def add_shapes(
    link: Link, element: XmlElement, source: Source,
    read: Callable[[XmlElement, XmlElement | None, bool], Geometry | None],
) -> None:  # fmt: skip
    """Add the shapes of a link: visuals, and collisions where it has none or contacts are read.

    Args:
        link: the link.
        element: its element.
        source: the file.
        read: reads a <visual> or <collision>, of which the second argument is the shape, and the
            third says that it is a collision.
    """
    both = source.contacts or not element.all("visual")
    if element.all("collision") and not source.contacts:
        source.remarks.translate(element.place, NO_CONTACTS, motion=True)
    for tag in ("visual", "collision") if both else ("visual",):
        for child in element.all(tag):
            shape = next(iter(child.first("geometry") or ()), None)
            geometry = read(child, shape, tag == "collision")
            if geometry is not None:
                link.geometries.append(geometry)


def hexadecimal(rgb: Iterable[float]) -> str:
    """A colour as #rrggbb."""
    return "#" + "".join(f"{round(255 * min(max(x, 0.0), 1.0)):02x}" for x in rgb)


def rgba(color: str) -> list[float]:
    """The four numbers of an opaque colour #rrggbb."""
    return [*(int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)), 1.0]
