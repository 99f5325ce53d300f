"""Reads links, frames, nested and included models of SDF."""

import re
from itertools import chain, combinations
from math import inf
from typing import Any

from dap3d_core.interface.formats import (
    WORLD,
    Articulation,
    Contact,
    FormatError,
    Frame,
    Geometry,
    Inertial,
    Joint,
    Link,
    Place,
    Remarks,
    Source,
    XmlElement,
    inertia_moved,
    inertia_of_mesh,
    inertia_of_solid,
    rpy,
    total_inertia,
)
from dap3d_formats.axes import along, turn
from dap3d_formats.element_table import note_elements
from dap3d_formats.sdf.elements import CONTACTS, FURTHER, SDF
from dap3d_formats.sdf.frames import FrameGraph
from dap3d_formats.sdf.versions import update, version_of
from dap3d_formats.shapes import SIZES, add_shapes, hexadecimal

#: Speed below which nothing bounces from which on nothing ever does, m/s: the default is 1e5.
FAST = 1e3
#: Kinds of solids, and names of their sizes.
SOLIDS = SIZES | {"ellipsoid": {"radii": 3}, "cone": {"radius": 1, "length": 1}}
#: Words of a boolean, in any case of their letters.
BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
#: Value of rotation_format -> count of the numbers of a pose.
POSES = {"euler_rpy": 6, "quat_xyzw": 7}
#: Density of collisions of which none is given, kg/m^3.
WATER = 1000.0
#: The address of a model on Gazebo's server; its name.
SERVED = re.compile(r"https?://fuel\.[^/]+/[^/]+/[^/]+/models/([^/]+)(?:/\w+)?")
#: What a link may hold.
CONTENTS = ("inertial", "visual", "collision")


class MergedScope(str):
    """The scope of a model that is merged into the one around it, of its own frame alone."""

    frame: str


class SdfReader:
    """Reads the models of one file into one articulation."""

    def __init__(self, source: Source, root: XmlElement) -> None:
        self.source, self.root, self.remarks = source, root, source.remarks
        self.frames = FrameGraph()
        self.model = Articulation(source.path.stem, gravity=(0.0, 0.0, -9.8), fixed_base=False,
                                  coefficient_of_pair=min, place=root.place)  # fmt: skip
        self.elements: list[tuple[XmlElement, str]] = []
        self.self_collide: set[str] = set()
        self.static: list[str] = []  # what names of links in static models begin with

    def read_links(self) -> None:
        """Read links and frames; joints are gathered in ``elements``."""
        self._prepare(self.root)
        self.frames.add(WORLD, "", Frame(), self.root.place)
        world = self.root.first("world")
        holder = self.root if world is None else world
        gravity = None if world is None else world.first("gravity")
        if gravity is not None:
            x, y, z = gravity.content(3)
            self.model.gravity = (x, y, z)
        models, includes = holder.all("model"), holder.all("include")
        joints = [] if world is None else world.all("joint")
        frames = [] if world is None else world.all("frame")
        alone = len(models) + len(includes) == 1 and not (joints or frames)
        if alone and models:
            self.model.name = models[0].get("name") or self.model.name
        for element in models:
            self._model(element, None, "" if alone else element.require("name"))
        for element in includes:
            self._include(element, None, "" if alone else None)
        for element in frames:
            self._frame(element, "", WORLD)
        for element in joints:
            self._joint_frame(element, "")
        for name, link in self.model.links.items():
            if any(name.startswith(scope) for scope in self.static):
                pose = self.frames.in_world(name, link.place)
                self.model.joints[name] = Joint(name, "fixed", WORLD, name, pose, place=link.place)

    def _prepare(self, root: XmlElement) -> None:
        """Bring a file to the newest version, and remark what of it is left out."""
        update(root, self.remarks)
        table = CONTACTS if self.source.contacts else SDF
        note_elements(root, table, self.remarks, FURTHER)

    def finish(self) -> Articulation:
        """The model; links that no joint places are where the file has them."""
        if not self.model.links:
            raise FormatError("holds no <link>", self.root.place)
        for name, link in self.model.links.items():
            self.model.base_poses[name] = self.frames.in_world(name, link.place)
        return self.model

    def _include(self, element: XmlElement, outer: str | None, scope: str | None) -> None:
        """A model of another file; its name and pose may be given here."""
        name = text_of(element, "uri")
        if not name:
            raise FormatError("<include> has no <uri>; it is required", element.place)
        file = self._file_of(name.rstrip("/"), element.place)
        root = self.source.include(file, element.place)
        self._prepare(root)
        inner = root.first("model")
        if inner is None and (root.first("light") or root.first("actor")):
            return  # remarked
        if inner is None:
            raise FormatError(f"{name} holds no <model>", element.place)
        given = element.first("name")
        called = given.text.strip() if given is not None else inner.require("name")
        for tag in ("pose", "static", "placement_frame"):
            child = element.first(tag)
            if child is not None:
                inner.children = [c for c in inner.children if c.name != tag] + [child]
        scope = scoped(outer or "", called) if scope is None else scope
        if outer is not None and boolean(element, "merge"):
            scope = MergedScope(outer)
            scope.frame = f"_merged__{called}__model__"
        with self.source.including(file):
            self._model(inner, outer, scope)

    def _file_of(self, uri: str, place: Place) -> str:
        """The file of a model that is named by its file, its folder, or its name alone.

        A name is that of a folder which is found as packages are; so is a model of Gazebo's server.
        """
        served = SERVED.fullmatch(uri)
        name = served[1] if served else uri.removeprefix("file://")
        folders = [] if served else [uri]
        if "://" not in name:
            folders.append(f"model://{name}")
        for folder in folders:
            if self.source.has(folder):
                return folder
            if self.source.has(config := f"{folder}/model.config"):
                named = self.source.include(config, place).all("sdf")
                if named:
                    return f"{folder}/{max(named, key=version_of).text.strip()}"
            if self.source.has(file := f"{folder}/model.sdf"):
                return file
        return folders[0] if folders[0].endswith((".sdf", ".world")) else f"{folders[0]}/model.sdf"

    def _model(self, element: XmlElement, outer: str | None, scope: str) -> None:
        """A model, whose names begin with its scope; outer: that of the model around, if any."""
        pose, relative = self.pose(element)
        parent = relative or (WORLD if outer is None else "__model__")
        parent = scoped(outer or "", parent)
        inner = scoped(scope, "__model__")
        placement = element.get("placement_frame") or text_of(element, "placement_frame")
        self.frames.add(inner, parent, pose, element.place,
                        placement=scoped(scope, placement) if placement else "")  # fmt: skip
        merged = isinstance(scope, MergedScope)
        if scope and not merged:  # the name of a model is that of its frame
            self.frames.add(scope, inner, Frame(), element.place)
            self.frames.attached[scope] = inner
        links = [link.get("name", "") for link in element.all("link")] if merged else []
        if canonical := element.get("canonical_link") or next(iter(links), ""):
            self.frames.attached[inner] = scoped(scope, canonical)
        before = len(self.model.links)
        for child in element.all("link"):
            self._link(child, scope)
        for child in element.all("model"):
            self._model(child, scope, scoped(scope, child.require("name")))
        for child in element.all("include"):
            self._include(child, scope, None)
        for child in element.all("frame"):
            self._frame(child, scope)
        for child in element.all("joint"):
            self._joint_frame(child, scope)
        if outer is None and not is_true(element, "self_collide"):
            alone = [n for n in list(self.model.links)[before:] if n not in self.self_collide]
            self.model.excluded += combinations(alone, 2)
        if is_true(element, "static") and not merged:
            self.remarks.translate(element.place, "a static model is a part of ground")
            self.static.append(scoped(scope, ""))

    def _frame(self, element: XmlElement, scope: str, holder: str = "__model__") -> None:
        pose, relative = self.pose(element)
        attached = element.get("attached_to") or holder
        name = scoped(scope, element.require("name"))
        self.frames.add(name, scoped(scope, relative or attached), pose, element.place)
        self.frames.attached[name] = scoped(scope, attached)

    def _joint_frame(self, element: XmlElement, scope: str) -> None:
        pose, relative = self.pose(element)
        child = text_of(element, "child")
        if not child:
            raise FormatError("<joint> has no <child>; it is required", element.place)
        name = scoped(scope, element.require("name"))
        self.frames.add(name, scoped(scope, relative or child), pose, element.place)
        self.frames.attached[name] = scoped(scope, child)
        self.elements.append((element, scope))

    def _link(self, element: XmlElement, scope: str) -> None:
        name = scoped(scope, element.require("name"))
        if name in self.model.links:
            raise FormatError(f"there are two links {name}", element.place)
        if name == WORLD and not any(element.all(tag) for tag in CONTENTS):
            text = "an empty link named world is the world itself"
            self.remarks.translate(element.place, text, motion=True)
            return
        pose, relative = self.pose(element)
        self.frames.add(name, scoped(scope, relative or "__model__"), pose, element.place)
        link = Link(name, place=element.place)
        link.inertial = self._inertial(element)
        link.gravcomp = 0.0 if is_true(element, "gravity", usual=True) else 1.0
        if is_true(element, "self_collide"):
            self.self_collide.add(name)
        add_shapes(link, element, self.source, self._geometry)
        self.model.links[name] = link

    def _inertial(self, link: XmlElement) -> Inertial:
        """The inertial of a link, by default 1 kg and 1 kg m^2."""
        element = link.first("inertial")
        if element is None:
            self.remarks.translate(link.place, "a link without <inertial> has 1 kg and 1 kg m^2")
            return Inertial(1.0, inertia=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        if boolean(element, "auto"):
            return self._computed_inertial(link, element)
        inertia = element.first("inertia")
        pose, _ = self.pose(element)
        usual = {"ixx": 1.0, "iyy": 1.0, "izz": 1.0, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
        v = usual | values_of(inertia, *usual)
        rows = [[v["ixx"], v["ixy"], v["ixz"]], [v["ixy"], v["iyy"], v["iyz"]],
                [v["ixz"], v["iyz"], v["izz"]]]  # fmt: skip
        return Inertial(numbers(element, "mass", 1, (1.0,), least=0.0)[0], pose.r,
                        pose.A @ rows @ pose.A.T)  # fmt: skip

    def _computed_inertial(self, link: XmlElement, element: XmlElement) -> Inertial:
        """The inertial of the volumes of a link's collisions, with its mass where that is given."""
        usual, parts = numbers(element, "density", 1, (WATER,), least=0.0), []
        for collision in link.all("collision"):
            shape = next(iter(collision.first("geometry") or ()), None)
            if shape is None:
                continue
            com: Any = (0.0, 0.0, 0.0)
            if shape.name in SOLIDS:
                sizes = _sizes(shape)
                volume, unit_inertia = inertia_of_solid(shape.name, sizes)
                if shape.name == "cone":  # its middle is that of its height, its tip along z
                    com = (0.0, 0.0, -0.25 * sizes[1])
            elif shape.name == "mesh":
                path = self.source.locate(text_of(shape, "uri"), shape.place, required=True)
                assert path is not None
                vertices, triangles = self.source.mesh(path, shape.place)
                scale = numbers(shape, "scale", 3, (1.0, 1.0, 1.0))
                volume, com, unit_inertia = inertia_of_mesh(vertices * scale, triangles)
            else:
                what = f"the mass of a <{shape.name}> is not computed"
                raise FormatError(what, shape.place, "give mass and inertia to its link")
            mass = abs(volume) * numbers(collision, "density", 1, usual, least=0.0)[0]
            part = Inertial(mass, com, mass * unit_inertia)
            parts.append(inertia_moved(part, self.pose(collision)[0]))
        total = total_inertia(parts) if parts else Inertial(0.0)
        if not total.mass > 0.0:
            raise FormatError('<inertial auto="true"> of a link without a volume', element.place)
        ratio = numbers(element, "mass", 1, (total.mass,), least=0.0)[0] / total.mass
        return Inertial(ratio * total.mass, total.com, ratio * total.inertia)

    def _geometry(
        self, element: XmlElement, shape: XmlElement | None, collision: bool
    ) -> Geometry | None:
        if shape is None:
            return None
        pose, _ = self.pose(element)
        common: dict[str, Any] = {"pose": pose, "collision": collision, "place": shape.place}
        common["color"] = _color(element.first("material"))
        if collision and self.source.contacts:
            common["contact"] = _contact(element, self.remarks)
        if shape.name in SOLIDS:
            return Geometry(shape.name, _sizes(shape), **common)
        if shape.name == "mesh":
            path = self.source.locate(text_of(shape, "uri"), shape.place)
            scale = numbers(shape, "scale", 3, (1.0, 1.0, 1.0))
            return None if path is None else Geometry("mesh", mesh=path, scale=scale, **common)
        if shape.name == "plane" and "contact" in common:
            x, y, z = numbers(shape, "normal", 3, (0.0, 0.0, 1.0))
            turned = Frame((0.0, 0.0, 0.0), along((x, y, z)))
            return Geometry("plane", **common | {"pose": pose @ turned})
        return None  # a plane, a height map, ...: remarked by their elements

    def pose(self, element: XmlElement) -> tuple[Frame, str]:
        """The pose of an element, and the name of the frame that it is given in, or ""."""
        pose = element.first("pose")
        if pose is None:
            return Frame(), ""
        relative, in_degrees = pose.get("relative_to") or "", boolean(pose, "degrees")
        rotation_format = pose.get("rotation_format") or "euler_rpy"
        if rotation_format not in POSES or (in_degrees and rotation_format == "quat_xyzw"):
            what = f"rotation_format of <pose> = {rotation_format!r} should be euler_rpy, or "
            what += 'quat_xyzw without degrees="true"'
            raise FormatError(what, pose.place)
        if not pose.text.strip():
            return Frame(), relative
        x, y, z, *angles = pose.content(POSES[rotation_format])
        if rotation_format == "quat_xyzw":
            qx, qy, qz, qw = angles
            return Frame((x, y, z), turn((qw, qx, qy, qz), pose)), relative
        if in_degrees:
            angles = [angle * 3.141592653589793 / 180.0 for angle in angles]
        return Frame((x, y, z), rpy(angles)), relative


def scoped(scope: str, name: str) -> str:
    """A name within a model."""
    if name == "__model__":
        name = getattr(scope, "frame", name)
    return name if name == WORLD or not scope else f"{scope}::{name}"


def text_of(element: XmlElement, name: str) -> str:
    """The text of a child, "" where there is none."""
    child = element.first(name)
    return "" if child is None else child.text.strip()


def is_true(element: XmlElement, name: str, *, usual: bool = False) -> bool:
    """The boolean in a child.

    Raises:
        FormatError: it is none.
    """
    child = element.first(name)
    return usual if child is None else _boolean(child.text, f"<{name}>", child.place)


def boolean(element: XmlElement, key: str) -> bool:
    """A boolean attribute, by default False.

    Raises:
        FormatError: it is none.
    """
    return _boolean(element.get(key, "false"), f"{key} of <{element.name}>", element.place)


def _boolean(text: str | None, label: str, place: Place) -> bool:
    word = (text or "").strip()
    if word.lower() not in BOOLEANS:
        raise FormatError(f"{label} = {word!r} should be true, false, 1 or 0", place)
    return BOOLEANS[word.lower()]


def values_of(
    element: XmlElement | None, *names: str, unbounded: bool = False, least: float = -inf
) -> dict[str, float]:
    """The numbers in children of some names, as far as they are there."""
    children = [element.first(name) for name in names] if element is not None else []
    return {child.name: child.content(1, unbounded=unbounded, least=least)[0]
            for child in children if child is not None}  # fmt: skip


def numbers(
    element: XmlElement, name: str, count: int, default: tuple[float, ...] = (), *,
    least: float = -inf,
) -> tuple[float, ...]:  # fmt: skip
    """The numbers in a child.

    Raises:
        FormatError: it is missing without a default, or holds something else.
    """
    child = element.first(name)
    if child is None:
        if default:
            return default
        raise FormatError(f"<{element.name}> has no <{name}>; it is required", element.place)
    return child.content(count, least=least)


def _sizes(shape: XmlElement) -> tuple[float, ...]:
    return tuple(chain(*(numbers(shape, *one) for one in SOLIDS[shape.name].items())))


def _contact(collision: XmlElement, remarks: Remarks) -> Contact:
    """How a collision meets others: its coefficients of friction, 1 by default, and restitution."""
    mu = _below(collision, "surface", "friction", "ode", "mu")
    e = _below(collision, "surface", "bounce", "restitution_coefficient")
    threshold = _below(collision, "surface", "bounce", "threshold")
    coefficient = 0.0
    if e is not None and threshold is not None and threshold.content(1)[0] < FAST:
        coefficient = e.content(1)[0]
        if threshold.content(1)[0] > 0.0:
            text = "threshold of <bounce>: it bounces below that speed, too"
            remarks.translate(threshold.place, text, motion=True)
    return Contact(1.0 if mu is None else mu.content(1)[0], e=coefficient)


def _below(element: XmlElement, *names: str) -> XmlElement | None:
    """The element at the end of a chain of children, or None."""
    found: XmlElement | None = element
    for name in names:
        found = None if found is None else found.first(name)
    return found


def _color(material: XmlElement | None) -> str:
    diffuse = None if material is None else material.first("diffuse")
    if diffuse is None:
        return ""
    r, g, b, *_ = diffuse.content(3 if len(diffuse.text.split()) < 4 else 4)
    return hexadecimal((r, g, b))
