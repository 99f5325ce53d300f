"""Equalities of MJCF."""

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    WORLD,
    Coupling,
    FormatError,
    Frame,
    Joint,
    Limits,
    Place,
    Tendon,
    XmlElement,
    from_quaternion,
    held,
    length_of_line,
)
from dap3d_formats.mjcf.reader import SCALAR, MjcfReader
from dap3d_formats.mjcf.tendons import line_of, pose_of, tendon_of

#: Limits of a joint that follows another are implied by those up to this part of their range.
IMPLIED = 1e-3


def read_equalities(reader: MjcfReader) -> None:
    """Read equalities: connect, weld, joint and tendon.

    Raises:
        FormatError: one names something that is not there.
    """
    remarks, document = reader.remarks, reader.document
    if document.disables("equality", "constraint"):
        return
    for given in document.section("equality"):
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
        reader.remarks.translate(element.place, text, motion=True)
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


def _joint(reader: MjcfReader, name: str, place: Place) -> None:
    joint = reader.model.joints.get(name)
    if joint is None or joint.kind not in (*SCALAR, "fixed"):  # fixed by an equality of its own
        raise FormatError(f"there is no hinge or slide {name!r}", place)


def _couple(reader: MjcfReader, element: XmlElement) -> None:
    """q1 - ref1 = a0 + a1 (q2 - ref2); coordinates of the model are without their references."""
    joint, other = element.require("joint1"), element.get("joint2")
    _joint(reader, joint, element.place)
    a0, a1, *higher = (*element.numbers("polycoef", None, (0.0, 1.0)), 0.0, 0.0)[:5]
    if other is None:
        _hold_sum(reader, element, "", {joint: 1.0}, a0)
        return
    _joint(reader, other, element.place)
    name, curve = element.get("name") or "", (a0, a1, *higher) if any(higher) else ()
    coupling = Coupling(name, joint, other, a1, a0, element.place, curve)
    reader.model.couplings.append(coupling)
    if curve:
        _imply_limits(reader, coupling)


def _imply_limits(reader: MjcfReader, coupling: Coupling) -> None:
    """Leave the limits of a joint to the one that it follows, where those imply them.

    They are often the ends of the curve, where the other joint would be held by no finite force.
    """
    joints = reader.model.joints
    own, leading = joints[coupling.joint].limits[0], joints[coupling.other].limits[0]
    if np.isfinite([leading.lower, leading.upper, own.upper - own.lower]).all():
        q = np.linspace(leading.lower, leading.upper, 1001)
        ends, slack = np.polynomial.polynomial.polyval(q, coupling.curve), own.upper - own.lower
        if (abs(ends - 0.5 * (own.lower + own.upper)) <= (0.5 + IMPLIED) * slack).all():
            text = "limits of a joint that follows another, which that one's imply: left to it"
            reader.remarks.translate(coupling.place, text)
            joints[coupling.joint].limits = (Limits(),)


def _couple_by_tendon(reader: MjcfReader, element: XmlElement) -> None:
    """L - L_0 = a0 + a1 (L' - L'_0) of two tendons, or L - L_0 = a0 of one, as MuJoCo has it.

    L_0 is the length where the file draws it. Of fixed tendons this is a sum of coordinates.
    """
    remarks, place = reader.remarks, element.place
    keys = [key for key in ("tendon1", "tendon2") if key in element.attributes]
    lines = [line_of(reader, tendon_of(reader, element, key), element.require(key))
             for key in keys or ("tendon1",)]  # fmt: skip
    a0, a1, *higher = (*element.numbers("polycoef", None, (0.0, 1.0)), 0.0, 0.0)[:5]
    found = [line for line in lines if line is not None]
    if len(found) < len(lines):
        return
    name = element.get("name") or found[0].name
    if len(found) == 1 and found[0].points:
        length = length_of_line(found[0], lambda link: pose_of(reader, link)) + a0
        reader.model.held.append(attrs.evolve(found[0], name=name, rest=length, place=place))
        return
    if any(line.points for line in found) or (len(found) == 2 and any(higher)):
        text = "an equality of two tendons that are not fixed, or with"
        remarks.leave_out(place, f"{text} a polynomial of a higher degree", motion=True)
        return
    factors: dict[str, float] = {}
    for line, share in zip(found, (1.0, -a1), strict=False):
        for joint, factor in line.terms:
            factors[joint] = factors.get(joint, 0.0) + share * factor
    _hold_sum(reader, element, name, {q: c for q, c in factors.items() if c}, a0)


def _hold_sum(
    reader: MjcfReader, element: XmlElement, name: str, factors: dict[str, float], a0: float
) -> None:
    """A sum of coordinates stays a0: of one joint, of two that are coupled, of more."""
    model, remarks = reader.model, reader.remarks
    if not factors:
        text = "an equality of tendons that are the same, or have coefficients of 0"
        remarks.leave_out(element.place, text, motion=bool(a0))
        return
    (q1, c1), *others = factors.items()
    if not others:
        remarks.translate(element.place, "an equality of one joint holds it fixed")
        model.joints[q1] = held(model.joints[q1], a0 / c1)
    elif len(others) == 1:
        ((q2, c2),) = others
        model.couplings.append(Coupling(name, q1, q2, -c2 / c1, a0 / c1, element.place))
    else:
        model.held.append(Tendon(name, rest=a0, terms=tuple(factors.items()), place=element.place))
