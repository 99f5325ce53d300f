"""Reads bodies, joints and geoms of MJCF."""

from collections.abc import Iterator
from math import inf, pi
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    LEAST,
    UNBOUNDED,
    WORLD,
    Articulation,
    FormatError,
    Frame,
    Geometry,
    Inertial,
    Joint,
    JointInertia,
    Limits,
    Link,
    Remarks,
    XmlElement,
    balanced_inertia,
    quaternion,
    total_inertia,
)
from dap3d_formats.axes import unit
from dap3d_formats.mjcf.document import Document
from dap3d_formats.mjcf.geoms import Geoms

#: Type -> kind of a joint.
KINDS = {"hinge": "revolute", "slide": "prismatic", "ball": "ball", "free": "free"}

#: Kinds with one coordinate.
SCALAR = ("revolute", "prismatic")


@attrs.define(eq=False)
class MjcfReader:
    """Reads the bodies of one document.

    Attributes:
        document: the document.
        model: the model so far.
        geoms: reader of geoms.
        sites: name of a site -> its link and frame.
        given: names of bodies and joints in the file, which those without a name do not take.
        joints: joints that have been read -> scope of their elements.
        springdampers: joint -> time constant and damping ratio that give its spring and damper.
        force_ranges: joint -> bounds of the force of its actuators.
        mocap: bodies that a user would move -> scope of their elements.
        ground: the link of the geoms of the world.
    """

    document: Document
    model: Articulation = attrs.field(init=False)
    geoms: Geoms = attrs.field(init=False)
    sites: dict[str, tuple[str, Frame]] = attrs.Factory(dict)
    given: set[str] = attrs.Factory(set)
    joints: dict[str, str] = attrs.Factory(dict)
    springdampers: dict[str, tuple[float, ...]] = attrs.Factory(dict)
    force_ranges: dict[str, tuple[float, float]] = attrs.Factory(dict)
    mocap: dict[str, str] = attrs.Factory(dict)
    ground: str = ""

    def __attrs_post_init__(self) -> None:
        root = self.document.root
        name = root.get("model") or self.document.source.path.stem
        self.model = Articulation(name, fixed_base=True, base_meets=True, place=root.place)
        self.geoms = Geoms.of(self.document)
        self.given = set(_names(root))

    @property
    def remarks(self) -> Remarks:
        """Remarks on the file."""
        return self.document.source.remarks

    def read_bodies(self) -> None:
        """Read bodies and their joints.

        Raises:
            FormatError: there are none.
        """
        document, model = self.document, self.model
        for option in document.root.all("option"):
            x, y, z = option.numbers("gravity", 3, tuple(model.gravity))
            model.gravity = (x, y, z)
        if document.disables("gravity"):
            model.gravity = (0.0, 0.0, 0.0)
        for world in document.root.all("worldbody"):
            self._contents(world, WORLD, Frame(), "main")
        if not model.links:
            raise FormatError("holds no <body>", document.root.place)
        for world in document.root.all("worldbody"):
            self.ground = self._world_shapes(world)

    def _world_shapes(self, world: XmlElement) -> str:
        """The geoms of the world, as a link that is fixed to it; its name."""
        link = Link(self._free_link("world_shapes"), place=world.place)
        link.geometries += self._shapes(self._gathered(world, ("geom",), Frame(), "main"))
        if link.geometries:
            self._fix(link, WORLD)
        return link.name

    def _fix(self, link: Link, parent: str, in_parent: Frame | None = None) -> None:
        """Add a link that is fixed to another."""
        name = self._free(f"{link.name}_fixed")
        self.model.links[link.name] = link
        self.model.joints[name] = Joint(
            name, "fixed", parent, link.name, in_parent or Frame(), place=link.place
        )

    def _shapes(self, geoms: list[tuple[XmlElement, Frame]]) -> list[Geometry]:
        shapes = [self.geoms.geometry(geom, frame) for geom, frame in geoms]
        return [shape for shape in shapes if shape is not None]

    def _contents(self, holder: XmlElement, link: str, frame: Frame, childclass: str) -> None:
        """Bodies and sites in a body or frame."""
        for child in holder:
            if child.name == "body":
                self._body(child, link, frame, childclass)
            elif child.name == "frame":
                inner = child.get("childclass") or childclass
                self._contents(child, link, frame @ self.document.frame(child), inner)
            elif child.name == "site":
                site = self.document.settled(child, childclass)
                if child.get("name"):
                    self.sites[child.require("name")] = (link, frame @ self._site(site))

    def site(self, element: XmlElement, key: str) -> tuple[str, Frame]:
        """The link of a site that an element names, and its frame there.

        Raises:
            FormatError: it is not there.
        """
        name = element.require(key)
        if name not in self.sites:
            what = f"{key} of <{element.name}>: there is no site {name!r}"
            raise FormatError(what, element.place)
        return self.sites[name]

    def solid(self, element: XmlElement) -> tuple[str, Geometry]:
        """The link of a sphere or cylinder that an element names, and its shape.

        Raises:
            FormatError: it is not there.
        """
        name = element.require("geom")
        for link in self.model.links.values():
            for shape in link.geometries:
                if shape.name == name and shape.kind in ("sphere", "cylinder"):
                    return link.name, shape
        raise FormatError(f"there is no sphere or cylinder {name!r}", element.place)

    def _site(self, site: XmlElement) -> Frame:
        if "fromto" in site.attributes:
            return Frame(np.array(site.numbers("fromto", 6)).reshape(2, 3).mean(axis=0))
        return self.document.frame(site)

    def _body(self, element: XmlElement, parent: str, frame: Frame, outer: str) -> None:
        document, model = self.document, self.model
        name = element.get("name") or self._free_link(f"body{len(model.links) + 1}")
        if name == WORLD:
            raise FormatError("a body named world is the one that does not move", element.place)
        childclass = element.get("childclass") or outer
        if element.get("mocap") == "true":
            self.mocap[name] = element.scope
        link = Link(name, place=element.place, gravcomp=element.number("gravcomp", 0.0))
        here = frame @ document.frame(element)
        joints = self._gathered(element, ("joint", "freejoint"), Frame(), childclass)
        geoms = self._gathered(element, ("geom",), Frame(), childclass)
        link.geometries += self._shapes(geoms)
        link.inertial = self._inertial(element, geoms)
        self._join(element, link, parent, here, joints)
        self._contents(element, name, Frame(), childclass)

    def _gathered(
        self, holder: XmlElement, tags: tuple[str, ...], frame: Frame, childclass: str
    ) -> list[tuple[XmlElement, Frame]]:
        """Elements of a body and of frames in it, with the attributes of their classes."""
        gathered = []
        for child in holder:
            if child.name in tags:
                gathered.append((self.document.settled(child, childclass), frame))
            elif child.name == "frame":
                inner = child.get("childclass") or childclass
                gathered += self._gathered(child, tags, frame @ self.document.frame(child), inner)
        return gathered

    def _inertial(self, body: XmlElement, geoms: list[tuple[XmlElement, Frame]]) -> Inertial | None:
        """Mass and inertia of a body: given, or of its geoms."""
        compiler, element = self.document.compiler(body), body.first("inertial")
        rule = compiler.get("inertiafromgeom", "auto")
        inertial = self._given(element) if element is not None else None
        if rule == "true" or (rule == "auto" and inertial is None):
            low, high = compiler.numbers("inertiagrouprange", 2, (0.0, 5.0))
            counted = [(g, f) for g, f in geoms if low <= g.number("group", 0.0) <= high]
            parts = [part for g, f in counted if (part := self.geoms.inertial(g, f)) is not None]
            inertial = total_inertia(parts) if parts else inertial
        return _bounded(inertial, compiler)

    def _given(self, element: XmlElement) -> Inertial:
        frame = self.document.frame(element)
        if "fullinertia" in element.attributes:
            xx, yy, zz, xy, xz, yz = element.numbers("fullinertia", 6)
            J: Any = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            J = np.diag(element.numbers("diaginertia", 3, (0.0, 0.0, 0.0), least=0.0))
        return Inertial(element.number("mass", least=0.0), frame.r, frame.A @ J @ frame.A.T)

    def _join(
        self, body: XmlElement, link: Link, parent: str, here: Frame,
        joints: list[tuple[XmlElement, Frame]],
    ) -> None:  # fmt: skip
        """The joints of a body, in their order, with links without mass between them."""
        model, place = self.model, body.place
        if not joints:
            self._fix(link, parent, here)
            return
        start, last = here, parent
        made = [self._joint(element, frame) for element, frame in joints]
        if not any(joint.name in self.springdampers for joint in made):
            made = _compound(made)
        for k, joint in enumerate(made):
            is_last = k == len(made) - 1
            below = link.name if is_last else self._free_link(f"{link.name}_{joint.name}")
            model.links[below] = link if is_last else Link(below, place=joint.place)
            joint.parent, joint.child = last, below
            if joint.kind == "free":
                joint.in_parent = joint.in_child = Frame()
                joint.position = (*start.r.tolist(), *quaternion(start.A))
            else:
                joint.in_parent = start @ joint.in_child
            model.joints[joint.name] = joint
            start, last = Frame(), below
        if len(made) > 1:
            text = "several joints of a body are joints in a row, with links between them"
            self.remarks.translate(place, text)

    def _free(self, name: str) -> str:
        while name in self.model.joints or name in self.joints or name in self.given:
            name += "_"
        return name

    def free_joint(self, name: str) -> str:
        """The name of a joint that closes a loop: one that no joint has."""
        return name if name not in self.model.joints else self._free(name)

    def _free_link(self, name: str) -> str:
        while name in self.model.links or name in self.given:
            name += "_"
        return name

    def _joint(self, element: XmlElement, frame: Frame) -> Joint:
        """A joint; its frame in the child is set, its ends are not."""
        type_ = "free" if element.name == "freejoint" else element.get("type") or "hinge"
        if type_ not in KINDS:
            raise FormatError(f"a joint of type {type_!r} is unknown; one of {', '.join(KINDS)}",
                              element.place)  # fmt: skip
        name = element.get("name") or self._free(f"joint{len(self.model.joints) + 1}")
        self.joints[name] = element.scope
        anchor = frame @ Frame(element.numbers("pos", 3, (0.0, 0.0, 0.0)))
        if KINDS[type_] == "ball":  # its coordinates are in the axes of the body
            anchor = Frame(anchor.r)
        joint = Joint(name, KINDS[type_], "", "", in_child=anchor, place=element.place)
        if element.name == "freejoint":  # it takes nothing from default classes
            return joint
        if joint.kind not in ("ball", "free"):
            joint.axes = (unit(element.numbers("axis", 3, (0.0, 0.0, 1.0)), element),)
        self._dynamics(joint, element)
        return joint

    def _dynamics(self, joint: Joint, element: XmlElement) -> None:
        """Limits, damping, friction, springs and armature of a joint."""

        def turned(value: float) -> float:
            return self.document.angle(value, element) if joint.kind == "revolute" else value

        joint.reference = reference = turned(element.number("ref", 0.0))
        for key, attribute in (("damping", "damping"), ("stiffness", "stiffness"),
                               ("friction", "frictionloss"), ("armature", "armature")):  # fmt: skip
            first, *others = element.numbers(attribute, None, (0.0,))
            setattr(joint, key, (first,))
            if any(others):
                text = f"{attribute} of a joint: higher coefficients of its polynomial"
                self.remarks.leave_out(element.place, text, motion=True)
        if self.document.disables("frictionloss", "constraint"):
            joint.friction = (0.0,)
        joint.rest = (turned(element.number("springref", 0.0)) - reference,)
        both = element.numbers("springdamper", 2, (0.0, 0.0))
        if min(both) > 0.0:
            self.springdampers[joint.name] = both
        elif any(both):
            raise FormatError("both numbers of springdamper are above 0", element.place)
        keys = ("actuatorfrcrange", "actuatorfrclimited")
        self.force_ranges[joint.name] = self.document.bounds(element, *keys)
        if joint.kind == "free":  # has no limits, whatever its class says
            return
        low, high = self.document.bounds(element, "range", "limited")
        if (low, high) != UNBOUNDED and not self.document.disables("limit", "constraint"):
            limited = element.get("limited", "auto")
            if joint.kind == "ball":
                greatest = self.document.angle(max(low, high), element)
                joint.limits = (Limits(0.0, greatest) if greatest < pi else Limits(),)
            elif low != high or limited == "true":  # of equal ones MuJoCo makes no limit
                joint.limits = (Limits.between(turned(low) - reference, turned(high) - reference,
                                               joint.name, element.place),)  # fmt: skip
        if not any((joint.damping[0], joint.stiffness[0])):
            joint.limits = joint.limits or (Limits(-inf, inf),)

    def add_armatures(self) -> None:
        """Put the armature of free joints into links of their own.

        It is mass and inertia at the frame of a body, without weight.
        """
        free = [joint for joint in self.model.joints.values() if joint.kind == "free"]
        for joint in (one for one in free if one.armature[0]):
            size, joint.armature = joint.armature[0], (0.0,)
            name = self._free_link(f"{joint.child}_armature")
            own = Inertial(size, inertia=size * np.eye(3))
            self._fix(Link(name, own, place=joint.place, gravcomp=1.0), joint.child)
            text = "armature of a free joint is mass and inertia of its body, without weight"
            self.remarks.translate(joint.place, text)

    def inertia(self) -> JointInertia:
        """Inertias of the joints at zero coordinates, by which the compiler scales springs."""
        links, joints = dict(self.model.links), self.model.joints.values()
        return JointInertia(links, {joint.child: joint for joint in joints}, list(links))

    def scale_springs(self, inertia: JointInertia) -> None:
        """Set the springs and dampers of joints that are given by their time constants."""
        for name, (time, ratio) in self.springdampers.items():
            joint, moved = self.model.joints[name], inertia.of(name)
            if moved is None:
                text = "springdamper: links without mass, or too many, for a mass matrix"
                self.remarks.leave_out(joint.place, text, motion=True)
                continue
            joint.stiffness = (moved / max(LEAST, (time * ratio) ** 2),)
            joint.damping = (2.0 * moved / max(LEAST, time),)

    def scale_masses(self) -> None:
        """Scale all masses to the total that the compiler says."""
        wanted = self.document.compiler(self.document.root).number("settotalmass", -1.0)
        inertials = [link.inertial for link in self.model.links.values() if link.inertial]
        found = sum(one.mass for one in inertials)
        if wanted > 0.0 and found > 0.0:
            for link in self.model.links.values():
                if link.inertial:
                    f, one = wanted / found, link.inertial
                    link.inertial = Inertial(f * one.mass, one.com, f * one.inertia)


def _names(root: XmlElement) -> Iterator[str]:
    """The names of all bodies and joints below an element."""
    for child in root:
        if child.name in ("body", "joint", "freejoint") and "name" in child.attributes:
            yield child.attributes["name"]
        yield from _names(child)


def _bounded(inertial: Inertial | None, compiler: XmlElement) -> Inertial | None:
    """The inertial, not below the least that the compiler allows; balanced where it says so."""
    mass, moment = compiler.number("boundmass", 0.0), compiler.number("boundinertia", 0.0)
    if inertial is None and not (mass or moment):
        return None
    inertial = inertial or Inertial(0.0)
    moments, axes = np.linalg.eigh(inertial.inertia)
    J = inertial.inertia
    if moment > moments[0]:
        moments = np.maximum(moments, moment)
        J = axes @ np.diag(moments) @ axes.T
    if compiler.get("balanceinertia") == "true":
        J = balanced_inertia(J)
    return Inertial(max(inertial.mass, mass), inertial.com, J)


def _compound(joints: list[Joint]) -> list[Joint]:
    """The joints of a body; two that an export wrote for one are that one again.

    They have no dynamics, and names J and J_2: hinges at a point with axes across each other are a
    universal joint, a slide and a hinge along it a cylindrical one.
    """
    if len(joints) != 2 or joints[1].name != f"{joints[0].name}_2":
        return joints
    one, other = joints
    passive = all(
        not any((j.damping[0], j.stiffness[0], j.friction[0], j.armature[0]))
        and j.limits == (Limits(),) for j in joints
    )  # fmt: skip
    if not passive or not np.array_equal(one.in_child.r, other.in_child.r):
        return joints
    kinds, along = (one.kind, other.kind), np.dot(one.axes[0], other.axes[0])
    if kinds == ("revolute", "revolute") and abs(along) < 1e-12:
        return [attrs.evolve(one, kind="universal", axes=(one.axes[0], other.axes[0]))]
    if kinds == ("prismatic", "revolute") and one.axes == other.axes:
        return [attrs.evolve(one, kind="cylindrical")]
    return joints
