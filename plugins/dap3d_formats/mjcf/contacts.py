"""Which geoms of MJCF meet, beside what their own bits say: pairs, and bodies that stay apart."""

from collections import Counter

import attrs

from dap3d_core.interface.formats import (
    FRICTION_DIRECTIONS,
    WORLD,
    FormatError,
    Geometry,
    XmlElement,
)
from dap3d_formats.mjcf.reader import MjcfReader

#: Where a geom lies: its link, and which of the shapes of that it is.
Slot = tuple[str, int]


def read_contacts(reader: MjcfReader) -> None:
    """Read exclusions, and where contacts are asked for, pairs of geoms.

    Raises:
        FormatError: one names a body that is not there.
    """
    document, model = reader.document, reader.model
    for element in document.section("contact", "exclude"):
        ends = element.require("body1"), element.require("body2")
        for name in ends:
            if name not in (*model.links, WORLD) and document.source.contacts:
                raise FormatError(f"there is no body {name}", element.place)
        if reader.ground in model.links or WORLD not in ends:
            one, other = (reader.ground if name == WORLD else name for name in ends)
            model.excluded.append((one, other))
    if document.source.contacts and not document.disables("contact", "constraint"):
        pairs = document.section("contact", "pair")
        _meet(reader, [slots for p in pairs if (slots := _pair(reader, p)) is not None])


def _pair(reader: MjcfReader, given: XmlElement) -> tuple[Slot, Slot] | None:
    """Where the geoms of a pair lie, whose friction is noted; None, with a remark, for none."""
    document, model = reader.document, reader.model
    element, text = document.settled(given, "main"), ""
    names = element.require("geom1"), element.require("geom2")
    slots = {
        shape.name: (link, k)
        for link, holder in model.links.items()
        for k, shape in enumerate(holder.geometries)
        if shape.name in names
    }
    if len(slots) < 2:
        text = "a pair of geoms that are no two shapes here"
    elif _joined(reader, *(slots[name][0] for name in names)):
        text = "a pair of geoms of one body, or of two that joints hold together"
    if text:
        reader.remarks.leave_out(element.place, text, motion=True)
        return None
    both = [_shape(reader, slots[name]).contact for name in names]
    one, other = (contact for contact in both if contact is not None)
    if one.priority != other.priority:
        one = other = max(one, other, key=lambda contact: contact.priority)
    mu, spin, roll = (max(getattr(one, n), getattr(other, n)) for n in ("mu", "mu_spin", "mu_roll"))
    directions = element.number("condim", max(one.directions, other.directions))
    friction = element.numbers("friction", None, (mu,))
    usual = (mu, friction[0], spin, roll, friction[3] if len(friction) == 4 else roll)
    mu, across, spin, roll, around = friction + usual[len(friction) :]
    if directions >= 3 and (across != mu or (directions >= 6 and around != roll)):
        text = "friction of a pair that differs along its directions: the first holds"
        reader.remarks.translate(element.place, text, motion=True)
    found = {"mu": mu, "mu_spin": spin, "mu_roll": roll}
    found |= {name: 0.0 for name, least in FRICTION_DIRECTIONS.items() if directions < least}
    model.friction[frozenset(names)] = found
    return slots[names[0]], slots[names[1]]


def _shape(reader: MjcfReader, slot: Slot) -> Geometry:
    return reader.model.links[slot[0]].geometries[slot[1]]


def _joined(reader: MjcfReader, one: str, other: str) -> bool:
    """True for one link, and for two with joints between, and at most links without shapes."""
    links = reader.model.links
    above = {joint.child: joint.parent for joint in reader.model.joints.values()}
    for link, goal in ((one, other), (other, one)):
        parent = above.get(link, WORLD)
        while parent not in (WORLD, goal) and not links[parent].geometries:
            parent = above.get(parent, WORLD)
        if goal in (parent, link):
            return True
    return False


def _meet(reader: MjcfReader, pairs: list[tuple[Slot, Slot]]) -> None:
    """Let pairs of geoms meet by bits that no other has: one for all pairs with the same geom."""
    model, used = reader.model, 0
    for link in model.links.values():
        for shape in link.geometries:
            if shape.contact is not None:
                used |= shape.contact.group | shape.contact.meets
    free = [1 << k for k in range(32) if not used >> k & 1]
    while pairs:
        hub = Counter(slot for pair in pairs for slot in pair).most_common(1)[0][0]
        if not free:
            text = "pairs of geoms: bits for 32 groups are taken"
            reader.remarks.leave_out(model.place, text, motion=True)
            return
        bit = free.pop()
        others = {slot for pair in pairs if hub in pair for slot in pair} - {hub}
        pairs = [pair for pair in pairs if hub not in pair]
        _add_bits(reader, hub, 0, bit)
        for slot in others:
            _add_bits(reader, slot, bit, 0)


def _add_bits(reader: MjcfReader, slot: Slot, group: int, meets: int) -> None:
    shape = _shape(reader, slot)
    assert shape.contact is not None
    contact = attrs.evolve(
        shape.contact, group=shape.contact.group | group, meets=shape.contact.meets | meets
    )
    reader.model.links[slot[0]].geometries[slot[1]] = attrs.evolve(shape, contact=contact)
