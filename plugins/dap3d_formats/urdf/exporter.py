"""Writes URDF."""

from math import isfinite, isinf

from dap3d_core.interface.formats import (
    NOWHERE,
    WORLD,
    Articulation,
    Coupling,
    Exporter,
    FormatError,
    Frame,
    Geometry,
    Joint,
    Link,
    Remarks,
    from_quaternion,
    rpy_of,
)
from dap3d_formats.shapes import rgba
from dap3d_formats.unwritten import leave_out_forces
from dap3d_formats.xml_text import XmlText, words

#: Kind of a joint -> type in the tree, and of a <constraint>.
TYPES = {"revolute": "revolute", "prismatic": "prismatic", "fixed": "fixed", "free": "floating"}
LOOPS = {"revolute": "revolute", "prismatic": "prismatic", "fixed": "fixed", "ball": "ball"}


class UrdfExporter(Exporter):
    """Links and joints as a URDF file; loops as ``<constraint>``."""

    keyword, title, suffix = "urdf", "URDF", ".urdf"

    def write(self, model: Articulation, remarks: Remarks) -> str:
        """The text of a file."""
        text = XmlText()
        text.open("robot", name=model.name)
        _note(model, remarks)
        text.empty("link", name=WORLD)
        for link in model.links.values():
            _write_link(text, link, remarks)
        mimics = {coupling.joint: coupling for coupling in model.couplings}
        for joint in model.joints.values():
            if joint.closes:
                leave_out_forces(joint, remarks)
                _write_loop(text, joint)
            else:
                _write_joint(text, joint, mimics.get(joint.name), remarks)
        text.close("robot")
        return text.text()


def _note(model: Articulation, remarks: Remarks) -> None:
    if tuple(model.gravity) != (0.0, 0.0, -9.81):
        text = (
            f"gravity {words(model.gravity)} m/s^2: URDF has none, and readers take 9.81 along -z"
        )
        remarks.leave_out(NOWHERE, text, motion=True)
    for actuator in model.actuators:
        text = f"actuator {actuator.name} of joint {actuator.joint}: URDF has none"
        remarks.leave_out(NOWHERE, text, motion=True)
    if any(joint.closes for joint in model.joints.values()):
        text = "loops are <constraint> elements, an extension of URDF that most readers pass over"
        remarks.translate(NOWHERE, text, motion=True)


def _write_link(text: XmlText, link: Link, remarks: Remarks) -> None:
    text.open("link", name=link.name)
    if link.inertial is not None:
        J = link.inertial.inertia
        text.open("inertial")
        text.empty("origin", xyz=words(link.inertial.com), rpy="0 0 0")
        text.empty("mass", value=words([link.inertial.mass]))
        parts = {"ixx": J[0, 0], "ixy": J[0, 1], "ixz": J[0, 2], "iyy": J[1, 1], "iyz": J[1, 2],
                 "izz": J[2, 2]}  # fmt: skip
        text.empty("inertia", **{key: words([value]) for key, value in parts.items()})
        text.close("inertial")
    for geometry in link.geometries:
        if geometry.kind == "ellipsoid":
            remarks.leave_out(NOWHERE, "shapes of type ellipsoid: URDF has none")
        else:
            _write_shape(text, geometry)
    text.close("link")


def _write_shape(text: XmlText, geometry: Geometry) -> None:
    text.open("visual")
    _write_frame(text, "origin", geometry.pose)
    text.open("geometry")
    if geometry.kind == "box":
        text.empty("box", size=words(geometry.size))
    elif geometry.kind == "sphere":
        text.empty("sphere", radius=words(geometry.size))
    elif geometry.kind == "cylinder":
        radius, length = geometry.size
        text.empty("cylinder", radius=words([radius]), length=words([length]))
    else:
        text.empty("mesh", filename=str(geometry.mesh), scale=words(geometry.scale))
    text.close("geometry")
    if geometry.color:
        text.open("material", name=geometry.color)
        text.empty("color", rgba=words(rgba(geometry.color)))
        text.close("material")
    text.close("visual")


def _write_frame(text: XmlText, tag: str, frame: Frame) -> None:
    if not frame.is_identity():
        text.empty(tag, xyz=words(frame.r), rpy=words(rpy_of(frame.A)))


def _write_joint(text: XmlText, joint: Joint, mimic: Coupling | None, remarks: Remarks) -> None:
    type_ = TYPES.get(joint.kind)
    if type_ is None:
        what = f"joint {joint.name} is {joint.kind}, which URDF does not have"
        raise FormatError(what, remedy="mjcf has balls and closed loops")
    limits = joint.limits[0]
    if joint.kind == "revolute" and isinf(limits.lower) and isinf(limits.upper):
        type_ = "continuous"
    text.open("joint", name=joint.name, type=type_)
    _write_ends(text, joint)
    if type_ in ("revolute", "prismatic"):
        _write_limit(text, joint, remarks)
    if joint.kind in ("revolute", "prismatic") and (joint.damping[0] or joint.friction[0]):
        numbers = {"damping": joint.damping, "friction": joint.friction}
        text.empty("dynamics", **{key: words(value) for key, value in numbers.items() if value[0]})
    if mimic is not None:
        if mimic.curve:
            what = f"a coupling of {joint.name} by a polynomial: that of the start"
            remarks.translate(NOWHERE, what, motion=True)
        text.empty("mimic", joint=mimic.other, multiplier=words([mimic.ratio]))
    text.close("joint")
    leave_out_forces(joint, remarks, ("stiffness", "armature"))


def _write_limit(text: XmlText, joint: Joint, remarks: Remarks) -> None:
    """Limits; a slider without any has some far away, which URDF asks for."""
    limits = joint.limits[0]
    low, high = (x if isfinite(x) else s * 1e9 for x, s in ((limits.lower, -1), (limits.upper, 1)))
    if (low, high) == (-1e9, 1e9):
        remarks.translate(NOWHERE, "a slider without limits has some of 1e9 m, as URDF asks for")
    text.empty("limit", lower=words([low]), upper=words([high]), effort="1e9", velocity="1e9")


def _write_loop(text: XmlText, joint: Joint) -> None:
    if joint.kind not in LOOPS:
        raise FormatError(f"joint {joint.name} closes a loop; as {joint.kind} it has no element")
    text.open("constraint", name=joint.name, type=LOOPS[joint.kind])
    _write_ends(text, joint)
    text.close("constraint")


def _write_ends(text: XmlText, joint: Joint) -> None:
    """Parent, child, and the joint's frame; in the tree the child's origin is that of the joint."""
    text.empty("parent", link=joint.parent)
    text.empty("child", link=joint.child)
    frame = joint.in_parent
    if joint.kind == "free":
        frame = Frame(joint.position[:3], from_quaternion(joint.position[3:]))
    _write_frame(text, "origin", frame)
    if joint.closes:
        _write_frame(text, "child_origin", joint.in_child)
    if joint.kind in ("revolute", "prismatic"):
        text.empty("axis", xyz=words(joint.axes[0]))
