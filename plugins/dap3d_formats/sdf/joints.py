"""Joints of SDF."""

from math import inf, pi
from typing import Any

from dap3d_core.interface.formats import (
    WORLD,
    Coupling,
    FormatError,
    Frame,
    Joint,
    Limits,
    Place,
    XmlElement,
)
from dap3d_formats.axes import unit
from dap3d_formats.sdf.reader import SdfReader, scoped, text_of

#: Type -> kind of a joint.
KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
    "ball": "ball", "universal": "universal", "screw": "screw", "revolute2": "universal",
}  # fmt: skip
#: Limits beyond are none.
UNLIMITED = 1e15
#: Stiffness of limits beyond is the default of the format, which no spring of a model has.
RIGID = 1e8


def read_joint(reader: SdfReader, element: XmlElement, scope: str) -> None:
    """Read a joint; a link with two parents closes a loop.

    Raises:
        FormatError: it has no counterpart.
    """
    name, type_ = scoped(scope, element.require("name")), element.require("type")
    if type_ == "gearbox":
        return
    if type_ not in KINDS:
        raise FormatError(f"joint {name}: type {type_!r} is unknown; one of {', '.join(KINDS)}",
                          element.place)  # fmt: skip
    parent, child = _end(reader, element, scope, "parent"), _end(reader, element, scope, "child")
    frames = reader.frames
    here = frames.in_world(name, element.place)
    joint = Joint(
        name, KINDS[type_], parent, child,
        _of_link(reader, parent, element.place).inverse() @ here,
        _of_link(reader, child, element.place).inverse() @ here, place=element.place,
    )  # fmt: skip
    if joint.kind not in ("fixed", "ball"):
        _axes(reader, joint, element, scope)
    if joint.kind == "screw":
        joint.pitch = _pitch(element)
    if name in reader.model.joints:
        raise FormatError(f"there are two joints {name}", element.place)
    reader.model.joints[name] = joint


def read_gearbox(reader: SdfReader, element: XmlElement, scope: str) -> None:
    """Read a gearbox: a coupling of two joints on its reference body.

    theta_1 = -ratio theta_2, of the parent and the child against the reference body.

    Raises:
        FormatError: its parent or child has no joint on the reference body.
    """
    name = scoped(scope, element.require("name"))
    reference = scoped(scope, text_of(element, "gearbox_reference_body"))
    ratio = element.first("gearbox_ratio")
    pair = []
    for tag in ("parent", "child"):
        link = _end(reader, element, scope, tag)
        joint = next((j for j in reader.model.joints.values() if {j.parent, j.child} ==
                      {reference, link} and j.kind == "revolute"), None)  # fmt: skip
        if joint is None:
            what = f"gearbox {name}: no revolute joint holds {link} on {reference}"
            raise FormatError(what, element.place)
        pair.append((joint.name, 1.0 if joint.child == link else -1.0))
    (first, sign), (second, other) = pair
    factor = -(1.0 if ratio is None else ratio.content(1)[0]) * sign * other
    reader.model.couplings.append(Coupling(name, first, second, factor, place=element.place))
    reader.remarks.translate(element.place, "a gearbox couples the rates of two joints")


def _end(reader: SdfReader, element: XmlElement, scope: str, tag: str) -> str:
    """The link of an end of a joint."""
    child = element.first(tag)
    if child is None or not child.text.strip():
        raise FormatError(f"<joint> has no <{tag}>; it is required", element.place)
    name = scoped(scope, child.text.strip())
    links: Any = reader.model.links
    return reader.frames.link_of(name, links, child.place)


def _of_link(reader: SdfReader, link: str, place: Place) -> Frame:
    return Frame() if link == WORLD else reader.frames.in_world(link, place)


def _axes(reader: SdfReader, joint: Joint, element: XmlElement, scope: str) -> None:
    """Axes, limits and dynamics of a joint."""
    tags = ("axis", "axis2") if joint.kind == "universal" else ("axis",)
    default = {"axis": (0.0, 0.0, 1.0), "axis2": (0.0, 0.0, 1.0)}
    axes, limits = [], []
    keys = ("damping", "friction", "stiffness", "rest")
    columns: dict[str, list[float]] = {key: [] for key in keys}
    for tag in tags:
        axis = element.first(tag)
        if axis is None:
            raise FormatError(f"joint {joint.name} has no <{tag}>; it is required", joint.place)
        xyz = axis.first("xyz")
        direction = default[tag] if xyz is None else unit(xyz.content(3), xyz)
        axes.append(_expressed(reader, joint, axis, direction, scope))
        limits.append(_limits(axis, unlimited=element.get("type") == "continuous"))
        for key, value in _dynamics(axis).items():
            columns[key].append(value)
        _mimic(reader, joint, axis, scope)
    joint.axes, joint.limits = tuple(axes), tuple(limits)
    joint.damping, joint.friction = tuple(columns["damping"]), tuple(columns["friction"])
    joint.stiffness, joint.rest = tuple(columns["stiffness"]), tuple(columns["rest"])
    joint.armature = (_reflected(element), *(0.0,) * (len(axes) - 1))


def _reflected(element: XmlElement) -> float:
    """The inertia of a rotor behind a gear, as Drake's extension of the format has it."""
    rotor, gear = element.first("drake:rotor_inertia"), element.first("drake:gear_ratio")
    if rotor is None:
        return 0.0
    ratio = 1.0 if gear is None else gear.content(1)[0]
    return float(ratio * ratio * rotor.content(1)[0])


def _expressed(
    reader: SdfReader, joint: Joint, axis: XmlElement, direction: Any, scope: str
) -> tuple[float, ...]:
    """The direction of an axis in the frame of its joint."""
    xyz = axis.first("xyz")
    frame = None if xyz is None else xyz.get("expressed_in")
    old = axis.first("use_parent_model_frame")
    if old is not None and old.text.strip() in ("true", "1"):
        frame = "__model__"
    if not frame:
        return tuple(direction)
    there = reader.frames.in_world(scoped(scope, frame), axis.place)
    here = reader.frames.in_world(joint.name, axis.place)
    return tuple(float(x) for x in here.A.T @ there.A @ direction)


def _limits(axis: XmlElement, *, unlimited: bool) -> Limits:
    limit = axis.first("limit")
    if limit is None or unlimited:
        return Limits()
    used = ("lower", "upper", "stiffness")
    values = {child.name: _number(child) for child in limit if child.name in used}
    lower, upper = values.get("lower", -inf), values.get("upper", inf)
    if lower > upper:
        raise FormatError(f"lower = {lower:g} lies above upper = {upper:g}", limit.place)
    stiffness = values.get("stiffness", RIGID)
    return Limits(
        lower if lower > -UNLIMITED else -inf, upper if upper < UNLIMITED else inf,
        stiffness if 0.0 < stiffness < RIGID else None,
    )  # fmt: skip


def _number(element: XmlElement) -> float:
    """A number that may be infinite."""
    text = element.text.strip().lower()
    if text in ("inf", "+inf", "-inf"):
        return float(text)
    return element.content(1)[0]


def _dynamics(axis: XmlElement) -> dict[str, float]:
    dynamics = axis.first("dynamics")
    used = ("damping", "friction", "spring_stiffness", "spring_reference")
    values = {c.name: c.content(1)[0] for c in dynamics or () if c.name in used}
    return {
        "damping": values.get("damping", 0.0), "friction": values.get("friction", 0.0),
        "stiffness": values.get("spring_stiffness", 0.0),
        "rest": values.get("spring_reference", 0.0),
    }  # fmt: skip


def _mimic(reader: SdfReader, joint: Joint, axis: XmlElement, scope: str) -> None:
    """A coordinate that follows another: q = multiplier (q_leader - reference) + offset."""
    mimic = axis.first("mimic")
    if mimic is None:
        return
    used = ("multiplier", "offset", "reference")
    values = {child.name: child.content(1)[0] for child in mimic if child.name in used}
    ratio = values.get("multiplier", 1.0)
    offset = values.get("offset", 0.0) - ratio * values.get("reference", 0.0)
    leader = scoped(scope, mimic.require("joint"))
    reader.model.couplings.append(Coupling("", joint.name, leader, ratio, offset, mimic.place))
    if offset:
        joint.position = (offset,)


def _pitch(element: XmlElement) -> float:
    """Advance in a turn, m, right-handed."""
    pitch, old = element.first("screw_thread_pitch"), element.first("thread_pitch")
    if pitch is None and old is not None and old.content(1)[0]:
        return -2.0 * pi / old.content(1)[0]
    return 1.0 if pitch is None else pitch.content(1)[0]
