"""Equalities of MJCF."""

from dap3d_core.interface.formats import (
    WORLD,
    Coupling,
    FormatError,
    Frame,
    Joint,
    Place,
    XmlElement,
    from_quaternion,
    held,
)
from dap3d_formats.mjcf.reader import MjcfReader
from dap3d_formats.mjcf.tendons import pose_of, tendon_of

#: Joints with one coordinate.
SCALAR = ("revolute", "prismatic")


def read_equalities(reader: MjcfReader) -> None:
    """Read equalities: connect, weld, joint, and tendon of a fixed tendon of two joints.

    Raises:
        FormatError: one names something that is not there.
    """
    remarks, document = reader.document.source.remarks, reader.document
    holders = document.root.all("equality")
    for holder in () if document.disables("equality", "constraint") else holders:
        for given in holder:
            element = document.settled_equality(given)
            if element.get("active", "true") == "false":
                remarks.leave_out(element.place, "equalities that are not active")
            elif element.name in ("connect", "weld"):
                _close(reader, element)
            elif element.name == "joint":
                _couple(reader, element)
            elif element.name == "tendon":
                _couple_by_tendon(reader, element)


def _link(reader: MjcfReader, element: XmlElement, key: str) -> str:
    name = element.get(key) or WORLD
    if name != WORLD and name not in reader.model.links:
        raise FormatError(f"{key} of <{element.name}>: there is no body {name!r}", element.place)
    return name


def _close(reader: MjcfReader, element: XmlElement) -> None:
    """Close a loop: two points, or two frames, of two bodies coincide."""
    model = reader.model
    name = reader.free_joint(element.get("name") or f"{element.name}{len(model.joints) + 1}")
    kind = "ball" if element.name == "connect" else "fixed"
    if "site1" in element.attributes:
        ends = [reader.site(element, key) for key in ("site1", "site2")]
        (parent, in_parent), (child, in_child) = ends
    else:
        parent, child = _link(reader, element, "body1"), _link(reader, element, "body2")
        if kind == "ball":
            in_parent = Frame(element.numbers("anchor", 3))
            in_child = _relative(reader, child, parent) @ in_parent
        else:
            in_parent, in_child = _weld(reader, element, parent, child)
    if "solref" in element.attributes or "solimp" in element.attributes:
        text = "softness of an equality (solref, solimp): it holds exactly"
        reader.document.source.remarks.translate(element.place, text, motion=True)
    model.joints[name] = Joint(name, kind, parent, child, in_parent, in_child, closes=True,
                               place=element.place)  # fmt: skip


def _weld(reader: MjcfReader, element: XmlElement, parent: str, child: str) -> tuple[Frame, Frame]:
    """The frames of a weld in its two bodies: relpose is that of body 2 in body 1."""
    relpose = element.numbers("relpose", 7, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    if not any(relpose[3:]):
        return _relative(reader, parent, child), Frame()
    anchor = Frame(element.numbers("anchor", 3, (0.0, 0.0, 0.0)))
    return Frame(relpose[:3], from_quaternion(relpose[3:])) @ anchor, anchor


def _relative(reader: MjcfReader, of: str, other: str) -> Frame:
    """The pose of link ``other`` in link ``of``, where the model starts."""
    return pose_of(reader, of).inverse() @ pose_of(reader, other)


def _joint(reader: MjcfReader, name: str, place: Place) -> Joint:
    joint = reader.model.joints.get(name)
    if joint is None or joint.kind not in (*SCALAR, "fixed"):  # fixed by an equality of its own
        raise FormatError(f"there is no hinge or slide {name!r}", place)
    return joint


def _couple(reader: MjcfReader, element: XmlElement) -> None:
    """q1 - ref1 = a0 + a1 (q2 - ref2); coordinates of the model are without their references."""
    joint, remarks = element.require("joint1"), reader.document.source.remarks
    one = _joint(reader, joint, element.place)
    a0, a1, *higher = (*element.numbers("polycoef", None, (0.0, 1.0)), 0.0, 0.0)[:5]
    other = element.get("joint2")
    if other is None:
        text = "an equality of one joint holds it fixed"
        remarks.translate(element.place, text)
        reader.model.joints[joint] = held(one, a0)
        return
    _joint(reader, other, element.place)
    if any(higher):
        text = "an equality of joints with a polynomial of a higher degree"
        remarks.leave_out(element.place, text, motion=True)
        return
    reader.model.couplings.append(
        Coupling(element.get("name") or "", joint, other, a1, a0, element.place)
    )


def _couple_by_tendon(reader: MjcfReader, element: XmlElement) -> None:
    """The length of a fixed tendon of two joints stays constant: c1 q1 + c2 q2 = 0."""
    remarks, name = reader.document.source.remarks, element.require("tendon1")
    tendon = tendon_of(reader, element, "tendon1")
    terms = tendon.all("joint")
    simple = tendon.name == "fixed" and len(terms) == 2 and "tendon2" not in element.attributes
    polycoef = element.numbers("polycoef", None, (0.0, 1.0))
    if not simple or polycoef[0]:
        text = "an equality of tendons but fixed ones of two joints"
        remarks.leave_out(element.place, text, motion=True)
        return
    (c1, q1), (c2, q2) = ((t.number("coef"), t.require("joint")) for t in terms)
    for joint in (q1, q2):
        _joint(reader, joint, element.place)
    if not c1:
        text = "an equality of a tendon with a coefficient of 0"
        remarks.leave_out(element.place, text, motion=True)
        return
    reader.model.couplings.append(Coupling(name, q1, q2, -c2 / c1, 0.0, element.place))
