"""Reads links and joints of URDF."""

from itertools import chain
from math import inf
from typing import Any

from dap3d_core.interface.formats import (
    WORLD,
    Articulation,
    Contact,
    Coupling,
    FormatError,
    Frame,
    Geometry,
    Inertial,
    Joint,
    Limits,
    Link,
    Source,
    XmlElement,
    balanced_inertia,
    rpy,
)
from dap3d_formats.axes import across, turn, unit
from dap3d_formats.element_table import note_elements
from dap3d_formats.shapes import SIZES, add_shapes, hexadecimal
from dap3d_formats.urdf.elements import FURTHER, URDF

#: Type of a joint -> kind of a joint.
KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
    "floating": "free", "planar": "planar",
}  # fmt: skip


class UrdfReader:
    """Reads the elements of one file."""

    def __init__(self, source: Source, root: XmlElement) -> None:
        self.source, self.root, self.remarks = source, root, source.remarks
        self.model = Articulation(root.get("name") or source.path.stem, place=root.place)
        self.colors: dict[str, str] = {}
        compilers = [one for holder in root.all("mujoco") for one in holder.all("compiler")]
        self.balances = any(one.get("balanceinertia") == "true" for one in compilers)

    def read(self) -> Articulation:
        note_elements(self.root, URDF, self.remarks, FURTHER)
        for element in self.root.all("material"):
            self._color(element)
        for element in self.root.all("link"):
            self._link(element)
        for element in self.root.all("joint"):
            self._joint(element)
        for element in self.root.all("constraint"):
            self._loop(element)
        if not self.model.links:
            raise FormatError("holds no <link>", self.root.place)
        self._join_world()
        return self.model

    def _join_world(self) -> None:
        """A root link named world is the world itself, whose name the joints have already."""
        world = self.model.links.pop(WORLD, None)
        if world is None:
            return
        if any(joint.child == WORLD for joint in self.model.joints.values()):
            raise FormatError("a link named world is the one that does not move", world.place)
        if world.inertial or world.geometries:
            self.remarks.leave_out(world.place, "mass and shapes of the link world")

    def _link(self, element: XmlElement) -> None:
        name = element.require("name")
        if name in self.model.links:
            raise FormatError(f"there are two links {name}", element.place)
        link = Link(name, place=element.place)
        inertial = element.first("inertial")
        if inertial is not None:
            link.inertial = self._inertial(inertial)
        add_shapes(link, element, self.source, self._geometry)
        self.model.links[name] = link

    def _inertial(self, element: XmlElement) -> Inertial | None:
        mass, inertia = element.first("mass"), element.first("inertia")
        if mass is None or inertia is None:
            missing = "mass" if mass is None else "inertia"
            raise FormatError(f"<inertial> has no <{missing}>; it is required", element.place)
        xx, yy, zz, xy, xz, yz = (
            inertia.number(key, 0.0) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        frame = self._origin(element)
        matrix = frame.A @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ frame.A.T
        if self.balances:
            matrix = balanced_inertia(matrix)
        return Inertial(mass.number("value", least=0.0), frame.r, matrix)

    def _origin(self, element: XmlElement, tag: str = "origin") -> Frame:
        origin = element.first(tag)
        if origin is None:
            return Frame()
        zero = (0.0, 0.0, 0.0)
        r, angles = origin.numbers("xyz", 3, zero), origin.numbers("rpy", 3, zero)
        if "quat_xyzw" not in origin.attributes:
            return Frame(r, rpy(angles))
        if self.root.get("version", "1.0") in ("1", "1.0") or "rpy" in origin.attributes:
            what = f"quat_xyzw of <{tag}> is of version 1.1 and later, and takes the place of rpy"
            raise FormatError(what, origin.place, '<robot version="1.1">, without rpy')
        x, y, z, w = origin.numbers("quat_xyzw", 4)
        return Frame(r, turn((w, x, y, z), origin))

    def _geometry(
        self, element: XmlElement, shape: XmlElement | None, collision: bool
    ) -> Geometry | None:
        if shape is None:
            self.remarks.leave_out(element.place, f"<{element.name}> without a geometry")
            return None
        place, pose = shape.place, self._origin(element)
        common: dict[str, Any] = {"pose": pose, "collision": collision, "place": place}
        common["color"] = self._color(element.first("material"))
        if collision and self.source.contacts:
            common["contact"] = Contact()
            text = "URDF knows no friction: mu = 1, as MuJoCo takes"
            self.remarks.translate(element.place, text, motion=True)
        if shape.name in SIZES:
            sizes = [shape.numbers(*one) for one in SIZES[shape.name].items()]
            return Geometry(shape.name, tuple(chain(*sizes)), **common)
        if shape.name == "mesh":
            path = self.source.locate(shape.require("filename"), place)
            scale = shape.numbers("scale", 3, (1.0, 1.0, 1.0))
            return None if path is None else Geometry("mesh", mesh=path, scale=scale, **common)
        self.remarks.leave_out(place, f"a shape <{shape.name}>")
        return None

    def _color(self, element: XmlElement | None) -> str:
        """The colour of a material as #rrggbb, by its name where it is given elsewhere."""
        if element is None:
            return ""
        color, name = element.first("color"), element.get("name", "")
        if element.first("texture") is not None:
            self.remarks.leave_out(element.place, "textures")
        if color is None:
            return self.colors.get(name or "", "")
        r, g, b, _ = color.numbers("rgba", 4)
        text = hexadecimal((r, g, b))
        if name:
            self.colors[name] = text
        return text

    def _ends(self, element: XmlElement) -> tuple[str, str]:
        ends = []
        for tag in ("parent", "child"):
            end = element.first(tag)
            if end is None:
                raise FormatError(f"<{element.name}> has no <{tag}>; it is required", element.place)
            ends.append(end.require("link"))
        return ends[0], ends[1]

    def _joint(self, element: XmlElement) -> None:
        name, type_ = element.require("name"), element.require("type")
        if type_ not in KINDS:
            what = f"joint {name}: type {type_!r} is unknown; one of {', '.join(KINDS)}"
            raise FormatError(what, element.place)
        if name in self.model.joints:
            raise FormatError(f"there are two joints {name}", element.place)
        parent, child = self._ends(element)
        joint = Joint(name, KINDS[type_], parent, child, self._origin(element), place=element.place)
        if joint.kind not in ("fixed", "free"):
            self._axis(joint, element)
            self._dynamics(joint, element, limited=type_ in ("revolute", "prismatic"))
        self.model.joints[name] = joint

    def _axis(self, joint: Joint, element: XmlElement) -> None:
        axis = element.first("axis")
        joint.axes = (unit((1.0, 0.0, 0.0) if axis is None else axis.numbers("xyz", 3), element),)
        if joint.kind == "planar":
            joint.axes = across(joint.axes[0])

    def _dynamics(self, joint: Joint, element: XmlElement, *, limited: bool) -> None:
        dynamics, limit = element.first("dynamics"), element.first("limit")
        if dynamics is not None:
            joint.damping = (dynamics.number("damping", 0.0, least=0.0),)
            joint.friction = (dynamics.number("friction", 0.0, least=0.0),)
        if limited and limit is None:
            raise FormatError(f"joint {joint.name} has no <limit>; it is required", joint.place)
        if limit is not None and limited:
            lower, upper = (limit.number(key, 0.0, unbounded=True) for key in ("lower", "upper"))
            if lower == upper == 0.0 and "lower" not in limit.attributes:
                lower, upper = -inf, inf
                text = "a <limit> without lower and upper is none, as in MuJoCo; by the format, 0"
                self.remarks.translate(limit.place, text, motion=True)
            joint.limits = (Limits.between(lower, upper, joint.name, limit.place),)
        mimic = element.first("mimic")
        if mimic is not None:
            ratio, offset = mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)
            coupling = Coupling("", joint.name, mimic.require("joint"), ratio, offset, mimic.place)
            self.model.couplings.append(coupling)

    def _loop(self, element: XmlElement) -> None:
        """A joint that closes a loop: ``<constraint>``, a proposed extension of URDF.

        It is a joint of the same types; ``<origin>`` is its frame in the parent, ``<child_origin>``
        that in the child.
        """
        name = element.get("name") or f"loop{len(self.model.joints) + 1}"
        type_ = element.get("type", "fixed")
        loops = {"fixed": "fixed", "weld": "fixed", "revolute": "revolute", "ball": "ball",
                 "spherical": "ball", "point": "ball", "continuous": "revolute",
                 "prismatic": "prismatic"}  # fmt: skip
        if type_ not in loops:
            what = f"constraint {name}: type {type_!r} is unknown; one of {', '.join(loops)}"
            raise FormatError(what, element.place)
        parent, child = self._ends(element)
        joint = Joint(name, loops[type_], parent, child, self._origin(element),
                      self._origin(element, "child_origin"), closes=True,
                      place=element.place)  # fmt: skip
        if joint.kind in ("revolute", "prismatic"):
            self._axis(joint, element)
        if name in self.model.joints:
            raise FormatError(f"there are two joints {name}", element.place)
        self.model.joints[name] = joint
