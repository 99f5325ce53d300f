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
from dap3d_formats.sdf.reader import SdfReader, is_true, numbers, scoped, values_of

#: Type -> kind of a joint.
KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
    "ball": "ball", "universal": "universal", "screw": "screw", "revolute2": "universal",
}  # fmt: skip
#: Axes are parallel up to this departure of the cosine of their angle from 1.
PARALLEL = 1e-6
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
    here = reader.frames.in_world(name, element.place)
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

    theta_2 = -ratio theta_1: angles of the child about axis2 and of the parent about axis, each
    against the reference body (SDF 1.5 to 1.12, element gearbox_ratio).

    Raises:
        FormatError: its parent or child has no joint on the reference body along its axis.
    """
    name = scoped(scope, element.require("name"))
    reference = _end(reader, element, scope, "gearbox_reference_body")
    leader, first = _geared(reader, element, scope, reference, "parent", "axis")
    follower, second = _geared(reader, element, scope, reference, "child", "axis2")
    if leader == follower:
        raise FormatError(f"gearbox {name}: its parent is its child", element.place)
    factor = -numbers(element, "gearbox_ratio", 1, (1.0,))[0] * first * second
    reader.model.couplings.append(Coupling(name, follower, leader, factor, place=element.place))
    reader.remarks.translate(element.place, "a gearbox couples the rates of two joints")


def _geared(
    reader: SdfReader, element: XmlElement, scope: str, reference: str, end: str, tag: str
) -> tuple[str, float]:
    """The joint of an end of a gearbox on the reference body, and 1 or -1 to make it theta."""
    link = _end(reader, element, scope, end)
    ends = {_holder(reader, reference), _holder(reader, link)}
    hinges = [one for one in reader.model.joints.values() if one.kind == "revolute"]
    joint = next((one for one in hinges if ends ==
                  {_holder(reader, one.parent), _holder(reader, one.child)}), None)  # fmt: skip
    name = scoped(scope, element.require("name"))
    if joint is None:
        what = f"gearbox {name}: no revolute joint holds {link} on {reference}"
        raise FormatError(what, element.place)
    direction = _direction(reader, name, element, tag, scope)
    here, there = (reader.frames.in_world(one, element.place).A for one in (name, joint.name))
    along = float((here @ direction) @ (there @ joint.axes[0]))
    if abs(along) < 1.0 - PARALLEL:
        what = f"gearbox {name}: its <{tag}> is not parallel to that of joint {joint.name}"
        raise FormatError(what, element.place)
    moves = _holder(reader, joint.child) == _holder(reader, link)
    return joint.name, (1.0 if moves else -1.0) * (1.0 if along > 0.0 else -1.0)


def _holder(reader: SdfReader, link: str) -> str:
    """The link, or the world, that a link is fixed to by fixed joints; itself otherwise."""
    path = [link]
    fixed = [j for j in reader.model.joints.values() if j.kind == "fixed"]
    while (joint := next((j for j in fixed if j.child == path[-1]), None)) is not None:
        if joint.parent in path:
            break
        path.append(joint.parent)
    return path[-1]


def _direction(
    reader: SdfReader, name: str, element: XmlElement, tag: str, scope: str
) -> tuple[float, ...]:
    """The direction of an axis of a joint, in the frame of the joint."""
    axis = element.first(tag)
    if axis is None:
        raise FormatError(f"joint {name} has no <{tag}>; it is required", element.place)
    xyz = axis.first("xyz")
    direction = (0.0, 0.0, 1.0) if xyz is None else unit(xyz.content(3), xyz)
    return _expressed(reader, name, axis, direction, scope)


def _end(reader: SdfReader, element: XmlElement, scope: str, tag: str) -> str:
    """The link of an end of a joint."""
    child = element.first(tag)
    if child is None or not child.text.strip():
        raise FormatError(f"<joint> has no <{tag}>; it is required", element.place)
    name = scoped(scope, child.text.strip())
    return reader.frames.link_of(name, reader.model.links, child.place)


def _of_link(reader: SdfReader, link: str, place: Place) -> Frame:
    return Frame() if link == WORLD else reader.frames.in_world(link, place)


def _axes(reader: SdfReader, joint: Joint, element: XmlElement, scope: str) -> None:
    """Axes, limits and dynamics of a joint."""
    tags = ("axis", "axis2") if joint.kind == "universal" else ("axis",)
    axes, limits, dynamics = [], [], []
    for tag in tags:
        axes.append(_direction(reader, joint.name, element, tag, scope))
        axis: Any = element.first(tag)
        unlimited = element.get("type") == "continuous"
        limits.append(Limits() if unlimited else _limits(axis, joint.name))
        dynamics.append(_dynamics(axis))
        _mimic(reader, joint, axis, scope)
    joint.axes, joint.limits = tuple(axes), tuple(limits)
    joint.damping = tuple(one["damping"] for one in dynamics)
    joint.friction = tuple(one["friction"] for one in dynamics)
    joint.stiffness = tuple(one["spring_stiffness"] for one in dynamics)
    joint.rest = tuple(one["spring_reference"] for one in dynamics)
    joint.armature = (_reflected(element), *(0.0,) * (len(axes) - 1))


def _reflected(element: XmlElement) -> float:
    """The inertia of a rotor behind a gear, as Drake's extension of the format has it."""
    if element.first("drake:rotor_inertia") is None:
        return 0.0
    ratio, inertia = (
        numbers(element, "drake:gear_ratio", 1, (1.0,))[0],
        numbers(element, "drake:rotor_inertia", 1)[0],
    )
    return ratio * ratio * inertia


def _expressed(
    reader: SdfReader, joint: str, axis: XmlElement, direction: Any, scope: str
) -> tuple[float, ...]:
    """The direction of an axis in the frame of its joint."""
    xyz = axis.first("xyz")
    frame = None if xyz is None else xyz.get("expressed_in")
    if is_true(axis, "use_parent_model_frame"):
        frame = "__model__"
    if not frame:
        return tuple(direction)
    there = reader.frames.in_world(scoped(scope, frame), axis.place)
    here = reader.frames.in_world(joint, axis.place)
    return tuple(float(x) for x in here.A.T @ there.A @ direction)


def _limits(axis: XmlElement, joint: str) -> Limits:
    limit = axis.first("limit")
    if limit is None:
        return Limits()
    values = values_of(limit, "lower", "upper", unbounded=True)
    stiffness = values_of(limit, "stiffness", unbounded=True, least=0.0).get("stiffness", RIGID)
    return Limits.between(
        values.get("lower", -inf), values.get("upper", inf), joint, limit.place,
        stiffness if 0.0 < stiffness < RIGID else None,
    )  # fmt: skip


def _dynamics(axis: XmlElement) -> dict[str, float]:
    losses, spring = ("damping", "friction"), ("spring_stiffness", "spring_reference")
    given = axis.first("dynamics")
    found = values_of(given, *losses, least=0.0) | values_of(given, *spring)
    return dict.fromkeys((*losses, *spring), 0.0) | found


def _mimic(reader: SdfReader, joint: Joint, axis: XmlElement, scope: str) -> None:
    """A coordinate that follows another: q = multiplier (q_leader - reference) + offset."""
    mimic = axis.first("mimic")
    if mimic is None:
        return
    values = values_of(mimic, "multiplier", "offset", "reference")
    ratio = values.get("multiplier", 1.0)
    offset = values.get("offset", 0.0) - ratio * values.get("reference", 0.0)
    leader = scoped(scope, mimic.require("joint"))
    reader.model.couplings.append(Coupling("", joint.name, leader, ratio, offset, mimic.place))


def _pitch(element: XmlElement) -> float:
    """Advance in a turn, m, right-handed."""
    turns = values_of(element, "thread_pitch").get("thread_pitch", 0.0)
    if element.first("screw_thread_pitch") is None and turns:
        return -2.0 * pi / turns
    return numbers(element, "screw_thread_pitch", 1, (1.0,))[0]
