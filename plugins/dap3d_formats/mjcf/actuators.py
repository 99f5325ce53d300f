"""Actuators of MJCF: motors, and servos whose law is a spring and a damper."""

from math import sqrt

from dap3d_core.interface.formats import (
    LEAST,
    Actuator,
    FormatError,
    Joint,
    JointInertia,
    XmlElement,
)
from dap3d_formats.mjcf.document import ACTUATORS
from dap3d_formats.mjcf.reader import MjcfReader

#: Joints with one coordinate.
SCALAR = ("revolute", "prismatic")


def read_actuators(reader: MjcfReader, inertia: JointInertia) -> None:
    """Read actuators on joints whose force is linear; others are left out, remarked.

    Args:
        reader: of the bodies, which have been read.
        inertia: of the joints where the model starts.

    Raises:
        FormatError: one names a joint that is not there.
    """
    document = reader.document
    options = document.root.all("option")
    disabled = {g for one in options for g in one.numbers("actuatorgroupdisable", None, ())}
    for holder in document.root.all("actuator"):
        for given in holder:
            if given.name not in ACTUATORS or given.name == "plugin":
                continue
            element = document.settled(given, "main")
            if element.number("group", 0.0) in disabled:
                text = "an actuator of a group that is disabled"
                document.source.remarks.leave_out(given.place, text)
            else:
                _read(reader, element, inertia)


def _read(reader: MjcfReader, element: XmlElement, inertia: JointInertia) -> None:
    remarks = reader.document.source.remarks
    name = element.get("name") or f"actuator{len(reader.model.actuators) + 1}"
    joint = element.get("joint") or element.get("jointinparent")
    law = _law(element)
    if joint is None or law is None:
        what = "its law" if joint else "on tendons, sites and bodies"
        remarks.leave_out(element.place, f"an actuator <{element.name}>: {what}", motion=True)
        return
    if joint not in reader.model.joints:
        raise FormatError(f"actuator {name}: there is no joint {joint!r}", element.place)
    target = reader.model.joints[joint]
    if target.kind not in SCALAR:
        text = "actuators of joints with several coordinates"
        remarks.leave_out(element.place, text, motion=True)
        return
    gear = element.numbers("gear", None, (1.0,))[0]
    gain, constant, position, rate = law
    if rate > 0.0 and gain == -position:
        moved = inertia.of(joint)
        if moved is None:
            text = "dampratio: links without mass, or too many, for a mass matrix"
            remarks.leave_out(element.place, text, motion=True)
        rate *= -_critical(gain, gear, moved or 0.0)
    _add_law(target, gear * constant + gear * gear * position * target.reference,
             -gear * gear * position, -gear * gear * rate)  # fmt: skip
    if gear * constant and not target.stiffness[0]:
        remarks.leave_out(element.place, "a constant force of an actuator", motion=True)
    if position or rate:
        text = "a servo is an input, and a spring and a damper of its joint"
        remarks.translate(element.place, text)
    reader.model.actuators.append(Actuator(name, joint, gear * gain, element.place))


def _critical(kp: float, gear: float, inertia: float) -> float:
    """The damping of a servo whose damping ratio is one."""
    mass = inertia / gear**2 if gear**2 > LEAST else 0.0
    return 2.0 * sqrt(max(0.0, kp * mass))


def _law(element: XmlElement) -> tuple[float, float, float, float] | None:
    """Gain g and bias (b0, b1, b2) of the force g u + b0 + b1 length + b2 rate; None for others.

    A positive b2 of a servo, b1 = -g, is a damping ratio.
    """
    if element.name == "motor":
        return 1.0, 0.0, 0.0, 0.0
    if element.name == "position":
        kp = element.number("kp", 1.0)
        if {"kv", "dampratio"} <= element.attributes.keys():
            raise FormatError("<position> takes kv or dampratio, not both", element.place)
        ratio = element.number("dampratio", 0.0)  # above 0, as the compiler stores it
        return kp, 0.0, -kp, ratio if ratio > 0.0 else -element.number("kv", 0.0)
    if element.name == "velocity":
        kv = element.number("kv", 1.0)
        return kv, 0.0, 0.0, -kv
    plain = {"dyntype": ("none",), "gaintype": ("fixed",), "biastype": ("none", "affine")}
    if element.name != "general" or any(
        element.get(key, words[0]) not in words for key, words in plain.items()
    ):
        return None
    gain = element.numbers("gainprm", None, (1.0,))[0]
    if element.get("biastype", "none") == "none":
        return gain, 0.0, 0.0, 0.0
    b0, b1, b2 = (*element.numbers("biasprm", None, (0.0,)), 0.0, 0.0)[:3]
    return gain, b0, b1, b2


def _add_law(joint: Joint, constant: float, stiffness: float, damping: float) -> None:
    """Add a force constant - stiffness q - damping q_dot to the spring and damper of a joint."""
    k, rest = joint.stiffness[0], joint.rest[0]
    total = k + stiffness
    joint.damping = (joint.damping[0] + damping,)
    if total:
        joint.rest = ((k * rest + constant) / total,)
        joint.stiffness = (total,)
