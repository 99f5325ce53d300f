"""Writes MJCF."""

from math import isfinite, isinf
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    NOWHERE,
    UNBOUNDED,
    WORLD,
    Actuator,
    Articulation,
    Exporter,
    FormatError,
    Frame,
    Geometry,
    Inertial,
    Joint,
    Link,
    Remarks,
    quaternion,
)
from dap3d_formats.shapes import rgba
from dap3d_formats.unwritten import leave_out_forces
from dap3d_formats.xml_text import XmlText, words

#: Kind of a joint -> types of the joints of a body.
TYPES = {
    "revolute": ("hinge",), "prismatic": ("slide",), "ball": ("ball",), "fixed": (),
    "universal": ("hinge", "hinge"), "cylindrical": ("slide", "hinge"),
}  # fmt: skip
#: Least mass, and least moment of inertia, of a body that MuJoCo reads, some times its own limits
#: of 1e-15 and 1e-14, and the part of the largest moment that it resolves.
LEAST_MASS, LEAST_MOMENT, LEAST_PART = 2e-15, 2e-14, 1e-12
#: A link of less than this part of the mass of the next one counts as one without.
WITHOUT_MASS = 1e-9
#: Coordinates beyond stand for no limit on one side.
UNLIMITED = 1e6


class MjcfExporter(Exporter):
    """Bodies, joints, equalities and shapes as an MJCF file."""

    keyword, title, suffix = "mjcf", "MJCF", ".xml"

    def write(self, model: Articulation, remarks: Remarks) -> str:
        """The text of a file."""
        return _Writer(model, remarks).write()


class _Writer:
    """Writes one model."""

    def __init__(self, model: Articulation, remarks: Remarks) -> None:
        self.model, self.remarks, self.text = model, remarks, XmlText()
        self.loops = [joint for joint in model.joints.values() if joint.closes]
        self.placing = {j.child: j for j in model.joints.values() if not j.closes}
        self.children: dict[str, list[str]] = {}
        for name in model.links:
            parent = self.placing[name].parent if name in self.placing else WORLD
            self.children.setdefault(parent, []).append(name)
        meshes = [g for link in model.links.values() for g in link.geometries if g.kind == "mesh"]
        self.meshes = {(str(g.mesh), g.scale): "" for g in meshes}
        for k, key in enumerate(self.meshes, 1):
            self.meshes[key] = f"mesh{k}"

    def write(self) -> str:
        """The text of the file."""
        text, model = self.text, self.model
        text.open("mujoco", model=model.name)
        text.empty("compiler", angle="radian", inertiafromgeom="false")
        text.empty("option", gravity=words(model.gravity))
        if self.meshes:
            text.open("asset")
            for (file, scale), name in self.meshes.items():
                # its mass counts for nothing; a flat one has a volume of a shell alone
                text.empty("mesh", name=name, file=file, scale=words(scale), inertia="shell")
            text.close("asset")
        text.open("worldbody")
        for name in self.children.get(WORLD, []):
            self._body(model.links[name])
        text.close("worldbody")
        self._equalities()
        if model.actuators:
            text.open("actuator")
            for one in model.actuators:
                self._actuator(one)
            text.close("actuator")
        text.close("mujoco")
        return text.text()

    def _body(self, link: Link) -> None:
        text, joint = self.text, self.placing.get(link.name)
        joints = [] if joint is None else [joint]
        while (inner := self._below(link)) is not None:
            link = self.model.links[inner.child]
            step = (inner.in_parent @ inner.in_child.inverse()).inverse()
            joints = [attrs.evolve(one, in_child=step @ one.in_child) for one in joints]
            joints.append(inner)
        if joint is not None and joint.kind == "free":
            pos, quat = joint.position[:3], joint.position[3:]
        else:
            pose = joints[0].in_parent @ joints[0].in_child.inverse() if joints else Frame()
            pos, quat = tuple(pose.r), quaternion(pose.A)
        text.open("body", name=link.name, pos=words(pos), quat=words(quat))
        for one in joints:
            self._joint(one)
        if link.inertial is not None:
            mass, J = self._mass(link, link.inertial)
            full = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
            text.empty("inertial", pos=words(link.inertial.com), mass=words([mass]),
                       fullinertia=words(full))  # fmt: skip
        for geometry in link.geometries:
            self._geom(geometry)
        for name in self.children.get(link.name, []):
            self._body(self.model.links[name])
        text.close("body")

    def _below(self, link: Link) -> Joint | None:
        """The joint of the link that one without mass carries: both joints are those of one body.

        Such links stand between the joints in a row that an import makes of those of a body.
        """
        joint, children = self.placing.get(link.name), self.children.get(link.name, [])
        if joint is None or len(children) != 1 or link.geometries or link.inertial is None:
            return None
        below = self.placing[children[0]]
        looped = any(link.name in (one.parent, one.child) for one in self.loops)
        single = {joint.kind, below.kind} <= {"revolute", "prismatic"}
        light = link.inertial.mass < WITHOUT_MASS * self._carried(children[0])
        return below if single and light and not looped else None

    def _carried(self, link: str) -> float:
        """The mass of a link and of all that hangs from it."""
        inertial = self.model.links[link].inertial
        own = 0.0 if inertial is None else inertial.mass
        return own + sum(map(self._carried, self.children.get(link, [])))

    def _mass(self, link: Link, inertial: Inertial) -> tuple[float, Any]:
        """Mass and inertia of a link, not below the least that MuJoCo reads."""
        J = inertial.inertia
        moments, axes = np.linalg.eigh(0.5 * (J + J.T))
        least = max(LEAST_MOMENT, LEAST_PART * float(moments[-1]))
        mass = max(inertial.mass, LEAST_MASS)
        if mass > inertial.mass or moments[0] < least:
            text = f"mass or inertia of {link.name} is raised to the least that MuJoCo reads"
            self.remarks.translate(NOWHERE, text, motion=True)
        if moments[0] < least:
            J = axes @ np.diag(np.maximum(moments, least)) @ axes.T
        return mass, J

    def _joint(self, joint: Joint) -> None:
        if joint.kind == "free":
            self.text.empty("freejoint", name=joint.name)
            return
        if joint.kind not in TYPES:
            raise FormatError(f"joint {joint.name} is {joint.kind}, which MJCF does not have")
        types = TYPES[joint.kind]
        if joint.kind == "fixed":
            text = (
                f"joint {joint.name} has no name: bodies without joints are fixed to their parent"
            )
            self.remarks.translate(NOWHERE, text)
        if len(types) > 1:
            text = f"joint {joint.name} is {joint.kind}: two joints of a body"
            self.remarks.translate(NOWHERE, text)
        axes = joint.axes if joint.kind == "universal" else joint.axes * len(types)
        for k, type_ in enumerate(types):
            attributes = {"name": joint.name if not k else f"{joint.name}_{k + 1}", "type": type_,
                          "pos": words(joint.in_child.r)}  # fmt: skip
            if type_ != "ball":
                attributes["axis"] = words(joint.in_child.A @ axes[k])
            if len(types) == 1:
                attributes |= self._dynamics(joint)
            self.text.empty("joint", **attributes)

    def _dynamics(self, joint: Joint) -> dict[str, str]:
        attributes = {
            key: words(values)
            for key, values in (("damping", joint.damping), ("stiffness", joint.stiffness),
                                ("springref", joint.rest), ("armature", joint.armature),
                                ("frictionloss", joint.friction))
            if values[0]
        }  # fmt: skip
        limits = joint.limits[0]
        if not (isinf(limits.lower) and isinf(limits.upper)):
            low = limits.lower if isfinite(limits.lower) else -UNLIMITED
            high = limits.upper if isfinite(limits.upper) else UNLIMITED
            attributes["range"] = words([low, high])
            text = "stops are limits, whose stiffness is the solver's"
            self.remarks.translate(NOWHERE, text, motion=True)
        return attributes

    def _geom(self, geometry: Geometry) -> None:
        kind, size = geometry.kind, geometry.size
        attributes = {"type": kind, "pos": words(geometry.pose.r),
                      "quat": words(quaternion(geometry.pose.A)), "contype": "0",
                      "conaffinity": "0", "mass": "0"}  # fmt: skip
        if kind == "mesh":
            attributes["mesh"] = self.meshes[str(geometry.mesh), geometry.scale]
        elif kind == "box":
            attributes["size"] = words(edge / 2.0 for edge in size)
        elif kind in ("cylinder", "capsule"):
            attributes["size"] = words([size[0], size[1] / 2.0])
        else:
            attributes["size"] = words(size)
        if geometry.color:
            attributes["rgba"] = words(rgba(geometry.color))
        self.text.empty("geom", **attributes)

    def _actuator(self, one: Actuator) -> None:
        """A motor, or a <general> with its law, bounds and activation."""
        common = {"name": one.name, "joint": one.joint}
        bounds = {"ctrlrange": one.control, "forcerange": one.force, "actrange": one.active}
        law, time = (one.bias, -one.stiffness, -one.damping), one.time
        if not (any(law) or one.activation) and one.force == UNBOUNDED:
            self.text.empty("motor", **common, gear=words([one.gear]), **_ranges(bounds))
            return
        gain, dynamics = one.gear, {}
        if one.activation == "lag":
            dynamics = {"dyntype": "filter", "dynprm": words([time])}
        elif one.activation:  # MuJoCo's integral has no time constant
            gain, dynamics = gain / time, {"dyntype": "integrator"}
            bounds["actrange"] = (one.active[0] * time, one.active[1] * time)
        bias = {"biastype": "affine", "biasprm": words(law)} if any(law) else {}
        self.text.empty("general", **common, gainprm=words([gain]), **bias, **dynamics,
                        **_ranges(bounds))  # fmt: skip

    def _equalities(self) -> None:
        if not self.loops and not self.model.couplings:
            return
        self.text.open("equality")
        for joint in self.loops:
            leave_out_forces(joint, self.remarks)
            self._loop(joint)
        for coupling in self.model.couplings:
            self.text.empty("joint", joint1=coupling.joint, joint2=coupling.other,
                            polycoef=words(
                                coupling.curve or (coupling.offset, coupling.ratio, 0, 0, 0)
                            ))  # fmt: skip
        self.text.close("equality")

    def _loop(self, joint: Joint) -> None:
        """A loop: <connect> holds points together, <weld> bodies; a hinge has two points."""
        one, other, frame = joint.parent, joint.child, joint.in_parent
        if one == WORLD:  # body1 is no world
            one, other, frame = joint.child, joint.parent, joint.in_child
        ends = {"body1": one} | ({"body2": other} if other != WORLD else {})
        if joint.kind == "fixed":
            in_other = joint.in_child if one == joint.parent else joint.in_parent
            pose = frame @ in_other.inverse()
            self.text.empty("weld", name=joint.name, **ends,
                            relpose=words([*pose.r, *quaternion(pose.A)]))  # fmt: skip
            return
        if joint.kind not in ("ball", "revolute"):
            raise FormatError(f"joint {joint.name} closes a loop; MJCF has no equality for a "
                              f"{joint.kind} joint")  # fmt: skip
        self.text.empty("connect", name=joint.name, **ends, anchor=words(frame.r))
        if joint.kind == "revolute":
            text = f"joint {joint.name} closes a loop as two points on its axis"
            self.remarks.translate(NOWHERE, text)
            further = frame.r + frame.A @ joint.axes[0]
            self.text.empty("connect", name=f"{joint.name}_2", **ends, anchor=words(further))


def _ranges(bounds: dict[str, tuple[float, float]]) -> dict[str, str]:
    """Bounds as attributes; an infinite one is a large number beside one that is finite."""
    return {
        key: words(min(max(x, -UNLIMITED), UNLIMITED) for x in pair)
        for key, pair in bounds.items()
        if isfinite(pair[0]) or isfinite(pair[1])
    }
