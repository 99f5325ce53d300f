"""Geoms of MJCF: shapes, and the mass that they give to bodies."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats import (
    Contact,
    FormatError,
    Frame,
    Geometry,
    Inertial,
    Remarks,
    XmlElement,
    inertia_moved,
    inertia_of_mesh,
    inertia_of_solid,
)
from dap3d_formats.axes import along, turn
from dap3d_formats.element_table import NO_CONTACTS
from dap3d_formats.mjcf.document import Document
from dap3d_formats.shapes import hexadecimal

#: Friction of sliding, spinning and rolling.
FRICTION = (1.0, 0.005, 0.0001)
#: Geoms without a volume.
FLAT = ("plane", "hfield", "sdf")
#: Density of geoms, kg/m^3.
WATER = 1000.0
#: Angle by which a quarter turn may be off, rad: meshes in files have fewer digits.
SKEW = 1e-7
#: Group from which geoms are hidden at first, as those of contacts are.
HIDDEN = 3


@attrs.define(eq=False)
class Geoms:
    """Reads the geoms of a document.

    Attributes:
        document: the document.
        assets: meshes by name.
        fields: height fields by name.
        colors: materials by name.
        paired: names of the geoms of pairs, which meet also without bits.
    """

    document: Document
    assets: dict[str, XmlElement] = attrs.Factory(dict)
    fields: dict[str, XmlElement] = attrs.Factory(dict)
    colors: dict[str, str] = attrs.Factory(dict)
    paired: set[str] = attrs.Factory(set)

    @property
    def remarks(self) -> Remarks:
        """Remarks on the file."""
        return self.document.source.remarks

    @classmethod
    def of(cls, document: Document) -> "Geoms":
        """The reader, with the assets of the document."""
        pairs = document.section("contact", "pair")
        geoms = cls(document, paired={p.get(k) or "" for p in pairs for k in ("geom1", "geom2")})
        for asset in document.root.all("asset"):
            for mesh in asset.all("mesh"):
                geoms.assets[mesh.get("name") or ""] = document.settled(mesh, "main")
            geoms.fields |= {one.get("name") or "": one for one in asset.all("hfield")}
            for material in asset.all("material"):
                settled = document.settled(material, "main")
                if "rgba" in settled.attributes:
                    geoms.colors[material.require("name")] = hexadecimal(
                        settled.numbers("rgba")[:3]
                    )
        return geoms

    def geometry(self, geom: XmlElement, frame: Frame) -> Geometry | None:
        """The shape of a geom with the attributes of its class, or None for what is not drawn.

        Args:
            geom: the geom.
            frame: the frame that it is given in, in its link.
        """
        kind = self.kind(geom)
        color = hexadecimal(geom.numbers("rgba")[:3]) if "rgba" in geom.attributes else ""
        color = color or self.colors.get(geom.get("material") or "", "")
        hidden = geom.number("group", 0.0) >= HIDDEN
        common: dict[str, Any] = {"color": color, "collision": hidden, "place": geom.place}
        common |= {"contact": self._contact(geom), "name": geom.get("name") or ""}
        if kind == "mesh":
            return self._mesh_shape(geom, frame, common)
        if kind == "plane" and common["contact"] is not None:
            return Geometry(kind, pose=frame @ self.document.frame(geom), **common)
        if kind == "hfield":
            return self._height_field(geom, frame, common)
        if kind in FLAT:
            meets = common["contact"] is not None
            text = f"a geom {kind} is not drawn{', and meets no others' if meets else ''}"
            self.remarks.leave_out(geom.place, text, motion=meets)
            return None
        size, pose = self.solid(geom, kind)
        return Geometry(kind, size, frame @ pose, **common)

    def _contact(self, geom: XmlElement) -> Contact | None:
        """How a geom meets others; None where contacts are not asked for, or it meets none."""
        bits = [int(geom.number(name, 1.0)) % 2**32 for name in ("contype", "conaffinity")]
        name = geom.get("name") or ""
        surface = name if name in self.paired else ""
        if not (any(bits) or surface) or self.document.disables("contact", "constraint"):
            return None
        if not self.document.source.contacts:
            self.remarks.translate(geom.place, NO_CONTACTS, motion=True)
            return None
        given = geom.numbers("friction", None, FRICTION)
        mu, spin, roll = given + FRICTION[len(given) :]
        directions, priority = int(geom.number("condim", 3.0)), int(geom.number("priority", 0.0))
        return Contact(mu, spin, roll, directions, bits[0], bits[1], priority, surface=surface)

    def _mesh_shape(self, geom: XmlElement, frame: Frame, common: Any) -> Geometry | None:
        asset, meets = self._asset(geom), common["contact"] is not None
        if "file" not in asset.attributes:
            text = f"meshes without a file are not drawn{', and meet no others' if meets else ''}"
            self.remarks.leave_out(geom.place, text, motion=meets)
            return None
        path = self.document.locate(asset)
        if path is None:
            return None
        inner, scale = _reference(asset).inverse(), asset.numbers("scale", 3, (1.0, 1.0, 1.0))
        inner = Frame(np.array(scale) * inner.r, inner.A)
        along_axes = np.abs(inner.A).argmax(axis=0)
        skew = np.abs(np.abs(inner.A) - np.eye(3)[:, along_axes]).max()
        if len(set(scale)) > 1 and skew > SKEW:
            text = "refquat of <mesh> that is no quarter turn, with a scale of unlike factors: "
            text += f"not drawn{', and meets no others' if meets else ''}"
            self.remarks.leave_out(geom.place, text, motion=meets)
            return None
        scale = tuple(scale[k] for k in along_axes)  # it is scaled before it is turned
        pose = frame @ self.document.frame(geom) @ inner
        return Geometry("mesh", mesh=path, scale=scale, pose=pose, **common)

    def _height_field(self, geom: XmlElement, frame: Frame, common: Any) -> Geometry | None:
        """A height field, whose least number is 0 and whose greatest the height of its size."""
        name, heights = geom.require("hfield"), np.zeros((2, 2))
        field = self.fields.get(name)
        if field is None:
            raise FormatError(f"there is no hfield {name!r} in <asset>", geom.place)
        if "file" in field.attributes:
            path = self.document.locate(field)
            if path is None:
                return None
            heights = self.document.source.image(path, field.place)
        elif "elevation" in field.attributes:
            shape = int(field.number("nrow")), int(field.number("ncol"))
            heights = np.array(field.numbers("elevation", None)[: shape[0] * shape[1]])
            if heights.size != shape[0] * shape[1]:
                raise FormatError("elevation should be nrow times ncol numbers", field.place)
            heights = heights.reshape(shape)[::-1]
        if min(heights.shape) < 2:
            raise FormatError("a height field should have two rows and columns", field.place)
        x, y, high, _ = field.numbers("size", 4)
        heights = heights - heights.min()
        heights = heights * (high / (heights.max() or 1.0))
        return Geometry(
            "height_field", (2.0 * x, 2.0 * y), frame @ self.document.frame(geom),
            heights=tuple(map(tuple, heights.T.tolist())), **common,
        )  # fmt: skip

    def inertial(self, geom: XmlElement, frame: Frame) -> Inertial | None:
        """Mass and inertia of a geom in the axes of its link, or None for none.

        Raises:
            FormatError: a mesh cannot be read, or encloses nothing; mass or density is negative.
        """
        kind = self.kind(geom)
        mass = geom.number("mass", -1.0)
        density = geom.number("density", WATER)
        for key, value in (("mass", mass), ("density", density)):
            if value < 0.0 and key in geom.attributes:
                raise FormatError(f"{key} of <geom> = {value:g} should be 0 or more", geom.place)
        if kind in FLAT or mass == 0.0 or (mass < 0.0 and density == 0.0):
            return None
        if geom.get("shellinertia") == "true":
            raise FormatError("a geom with shellinertia: give the body an <inertial>", geom.place)
        if kind == "mesh":
            volume, com, unit_inertia = self._mesh_inertia(geom)
            pose = frame @ self.document.frame(geom)
        else:
            size, pose = self.solid(geom, kind)
            volume, unit_inertia = inertia_of_solid(kind, size)
            com, pose = np.zeros(3), frame @ pose
        mass = mass if mass > 0.0 else density * abs(volume)
        return inertia_moved(Inertial(mass, com, mass * unit_inertia), pose)

    def kind(self, geom: XmlElement) -> str:
        """The type of a geom."""
        return geom.get("type") or ("mesh" if "mesh" in geom.attributes else "sphere")

    def solid(self, geom: XmlElement, kind: str) -> tuple[tuple[float, ...], Frame]:
        """Sizes, as of ``Geometry``, and frame of a solid.

        Raises:
            FormatError: the type is unknown, or sizes are missing.
        """
        counts = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
        if kind not in counts:
            raise FormatError(f"a geom of type {kind!r} is unknown", geom.place)
        if "mesh" in geom.attributes:
            raise FormatError("a primitive geom fitted to a mesh: give its size", geom.place)
        size, count = geom.numbers("size", None, (0.0,)), counts[kind]
        pose = self.document.frame(geom)
        if "fromto" in geom.attributes and kind != "sphere":
            ends = np.array(geom.numbers("fromto", 6)).reshape(2, 3)
            half = float(np.linalg.norm(ends[1] - ends[0])) / 2.0
            if not half > 0.0:
                raise FormatError("the two ends of fromto are the same point", geom.place)
            axis = (ends[0] - ends[1]) / (2.0 * half)
            pose = Frame(ends.mean(axis=0), along(tuple(axis.tolist())))
            size = (size[0], half) if count == 2 else (size[0], size[0], half)
        if len(size) < count or min(size[:count]) <= 0.0:
            raise FormatError(f"size of a {kind} should be {count} numbers greater than 0",
                              geom.place)  # fmt: skip
        size = size[:count]
        if kind in ("capsule", "cylinder"):
            return (size[0], 2.0 * size[1]), pose
        return (tuple(2.0 * edge for edge in size) if kind == "box" else size), pose

    def _asset(self, geom: XmlElement) -> XmlElement:
        name = geom.require("mesh")
        if name not in self.assets:
            raise FormatError(f"there is no mesh {name!r} in <asset>", geom.place)
        return self.assets[name]

    def _mesh_inertia(self, geom: XmlElement) -> tuple[float, Any, Any]:
        """Volume, mass centre, and inertia about it for a mass of 1, of a mesh asset."""
        asset, rule = self._asset(geom), self._asset(geom).get("inertia", "legacy")
        given = {"file", "vertex"} & asset.attributes.keys()
        if not given or "builtin" in asset.attributes or rule not in ("legacy", "exact"):
            what = f"the inertia of mesh {asset.get('name')} is not computed here"
            raise FormatError(what, geom.place, "give its body an <inertial>")
        if "file" in given:
            path = self.document.locate(asset, required=True)
            assert path is not None
            vertices, triangles = self.document.source.mesh(path, asset.place)
        else:
            vertices, triangles = _inline(asset)
        reference = _reference(asset).inverse()
        vertices = vertices @ reference.A.T + reference.r
        vertices = vertices * np.array(asset.numbers("scale", 3, (1.0, 1.0, 1.0)))
        try:
            return inertia_of_mesh(vertices, triangles, all_positive=rule == "legacy")
        except ValueError as error:
            raise FormatError(f"mesh {geom.get('mesh')}: {error}", geom.place) from None


def _inline(asset: XmlElement) -> tuple[Any, Any]:
    """Vertices and triangles of a mesh without a file; those of its hull where it has no faces."""
    triples = {}
    for key in ("vertex", "face"):
        numbers = asset.numbers(key, None, ())
        if len(numbers) % 3:
            what = f"{key} of <mesh> should be triples; it has {len(numbers)} numbers"
            raise FormatError(what, asset.place)
        triples[key] = np.array(numbers, dtype=float).reshape(-1, 3)
    vertices, triangles = triples["vertex"], triples["face"].astype(np.int64)
    if not len(triangles):
        return vertices, _hull(vertices, asset)
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise FormatError(f"face of <mesh> names other than {len(vertices)} vertices", asset.place)
    return vertices, triangles


def _hull(vertices: Any, asset: XmlElement) -> Any:
    """The triangles of the convex hull of points, with their normals outwards."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        what = f"mesh {asset.get('name')}: its vertices span no volume"
        raise FormatError(what, asset.place) from None
    a, b, c = (vertices[hull.simplices[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles = hull.simplices.copy()
    triangles[inwards] = triangles[inwards][:, ::-1]
    return triangles


def _reference(asset: XmlElement) -> Frame:
    """The frame of a mesh in its file, before it is scaled."""
    q = asset.numbers("refquat", 4, (1.0, 0.0, 0.0, 0.0))
    return Frame(asset.numbers("refpos", 3, (0.0, 0.0, 0.0)), turn(q, asset))
