"""Shapes of a scene as marks, lines and meshes; marks and meshes as triangles."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import attrs
import numpy as np

from dap3d_core.interface.errors import where_is
from dap3d_core.interface.shapes import RESERVED
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import to_global
from dap3d_core.scene.files.read_mesh import read_mesh
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.shapes import SHAPES, Shape, height_field, mesh_file, read_shapes
from dap3d_core.view.scene3d.colors import color
from dap3d_core.view.scene3d.primitives import Located, Mark, Triangles, floats_of, solid, turned_to

#: Meshes of more triangles are not put into a page.
MOST_TRIANGLES = 300_000
#: Nor are further ones, once it holds so many triangles.
MOST_IN_ALL = 1_000_000
#: A shape that reaches farther from the origin of its body is not drawn, m: graphics hardware
#: computes lengths in single precision, in which larger ones overflow.
FARTHEST = 1e15
#: The colour of ground's marks, and of its shapes where they name none.
GROUND_COLOR = "#9aa3ad"


@attrs.frozen(eq=False)
class Mesh:
    """Triangles fixed in a body.

    Attributes:
        body: index, ground 0.
        at, q: origin (3,), m, and Euler parameters (4,) of the axes of the file in the body.
        scale: m for one unit of the file, along its axes.
        vertices: (k, 3) in units of the file.
        triangles: (m, 3) indices of vertices.
        color, owner: as of a mark.
    """

    body: int
    at: tuple[float, ...]
    q: tuple[float, ...]
    scale: tuple[float, ...]
    vertices: Floats
    triangles: Integers
    color: str
    owner: str


@attrs.frozen
class Line:
    """A line through points (k, 3), m, of a body."""

    layer: ClassVar[str] = "shapes"
    body: int
    points: tuple[tuple[float, ...], ...]
    color: str
    owner: str

    @property
    def vertices(self) -> Floats:
        """(k, 3) in the axes of the body, m."""
        return np.array(self.points)


@attrs.frozen(eq=False)
class Part:
    """A mark or a mesh as triangles in the axes at, q of a body, enlarged by ``size`` (3,).

    Parts with the same triangles have equal keys.
    """

    key: object
    form: Triangles
    body: int
    at: tuple[float, ...]
    q: tuple[float, ...]
    size: tuple[float, ...]
    color: str
    layer: str
    owner: str

    @property
    def vertices(self) -> Floats:
        """(k, 3) in the axes of the body, m."""
        return np.asarray(np.asarray(self.at) + to_global(self.q, self.form.vertices * self.size))


def parts_of(marks: Sequence[Mark], meshes: Sequence[Mesh]) -> list[Part]:
    """Marks, then meshes, as triangles."""
    parts = [
        Part(m.kind, solid(m.kind), m.body, m.at, m.q, m.size, m.color, m.layer, m.owner)
        for m in marks
    ]
    for k, mesh in enumerate(meshes):
        mirrored = bool(np.prod(np.sign(mesh.scale)) < 0.0)
        form = Triangles(mesh.vertices, mesh.triangles[:, ::-1] if mirrored else mesh.triangles)
        parts.append(
            Part(k, form, mesh.body, mesh.at, mesh.q, mesh.scale, mesh.color, "shapes", mesh.owner)
        )
    return parts


@attrs.define
class SceneShapes:
    """The shapes of a scene.

    Attributes:
        marks, lines, meshes: solids, lines and triangles.
        corners: points that bound the shapes, for the camera.
        bodies: indices of the bodies that have a shape.
        touching: those without, drawn by what contacts touch with.
        notes: shapes that are not drawn, and why.
    """

    marks: list[Mark] = attrs.Factory(list)
    lines: list[Line] = attrs.Factory(list)
    meshes: list[Mesh] = attrs.Factory(list)
    corners: list[Located] = attrs.Factory(list)
    bodies: set[int] = attrs.Factory(set)
    touching: set[int] = attrs.Factory(set)
    notes: list[str] = attrs.Factory(list)


def scene_shapes(
    scene: Scene, names: Sequence[str], colors: Sequence[str], surfaces: Sequence[Shape] = ()
) -> SceneShapes:
    """The shapes of a scene.

    Args:
        scene: a valid one; its folder, where known, holds its meshes.
        names, colors: of the bodies, without ground.
        surfaces: those of contacts, drawn of bodies without shapes of their own.
    """
    index = {"ground": 0} | {name: k for k, name in enumerate(names, 1)}
    shapes = SceneShapes()
    for shape in read_shapes(Collector(scene), index):
        usual = colors[shape.body - 1] if shape.body else GROUND_COLOR
        with np.errstate(over="ignore", invalid="ignore"):  # a fault where too large
            fault = _add(shapes, shape, color(shape.values["color"], usual), scene.folder)
        if fault:
            shapes.notes.append(f"shape {shape.name} is not drawn: {fault}")
    own = set(shapes.bodies)
    for shape in surfaces:
        if shape.body not in own:
            _add(shapes, shape, colors[shape.body - 1] if shape.body else GROUND_COLOR, None)
    shapes.bodies, shapes.touching = own, shapes.bodies - own
    return shapes


def _add(shapes: SceneShapes, shape: Shape, hue: str, folder: Path | None) -> str:
    """Add a shape; returns "", or why it is not drawn."""
    values = shape.values
    about: dict[str, Any] = {"body": shape.body, "color": hue, "owner": shape.name}
    piece: Mark | Line | Mesh
    if shape.type in ("mesh", "height_field") or shape.type not in SHAPES:
        if sum(len(mesh.triangles) for mesh in shapes.meshes) >= MOST_IN_ALL:
            return f"the picture holds {MOST_IN_ALL} triangles already, or more"
        if shape.type == "height_field":
            mesh: Any = height_field(values)
        else:
            mesh = _mesh(folder, values["file"]) if shape.type == "mesh" else _own_mesh(shape)
        if isinstance(mesh, str):
            return mesh
        piece = Mesh(at=values["at"], q=values["p"], scale=values.get("scale", (1.0,) * 3),
                     vertices=mesh[0], triangles=mesh[1], **about)  # fmt: skip
        box = np.array(piece.scale) * np.array([mesh[0].min(axis=0), mesh[0].max(axis=0)])
        corners = _corners(shape.body, piece.at, piece.q, box)
    elif shape.type == "line":
        piece = Line(points=values["points"], **about)
        corners = [(shape.body, point) for point in piece.points]
    elif shape.type == "capsule":
        return "".join(_add(shapes, part, hue, folder) for part in _capsule(shape))
    else:
        piece = _solid(shape, hue)
        half = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 1.0, 0.5)}.get(piece.kind, (1.0,) * 3)
        high = np.multiply(half, piece.size)
        low = high * (-1.0, -1.0, 0.0 if piece.kind == "cone" else -1.0)
        corners = _corners(shape.body, piece.at, piece.q, np.array([low, high]))
    farthest = float(np.nan_to_num(np.abs([point for _, point in corners]), nan=np.inf).max())
    if farthest > FARTHEST:
        return f"it reaches {farthest:.3g} m from the origin of its body, more than {FARTHEST:g} m"
    kinds: dict[type, list[Any]] = {Mark: shapes.marks, Line: shapes.lines, Mesh: shapes.meshes}
    kinds[type(piece)].append(piece)
    shapes.corners += corners
    shapes.bodies.add(shape.body)
    return ""


def _corners(body: int, at: tuple[float, ...], q: tuple[float, ...], box: Floats) -> list[Located]:
    """The corners of a box (2, 3) least and largest coordinates, placed in a body."""
    corners = np.array(list(product(*box.T)))
    return [(body, floats_of(corner)) for corner in np.asarray(at) + to_global(q, corners)]


def _capsule(shape: Shape) -> list[Shape]:
    """A capsule as a cylinder and two spheres."""
    v, axis = shape.values, np.array(shape.values["axis"])
    half = 0.5 * v["length"] * axis / np.linalg.norm(axis)
    ends = [floats_of(np.add(v["at"], side * half)) for side in (-1.0, 1.0)]
    return [
        attrs.evolve(shape, type="cylinder"),
        *(
            attrs.evolve(shape, type="sphere", values={"radius": v["radius"], "at": at})
            for at in ends
        ),
    ]


def _solid(shape: Shape, hue: str) -> Mark:
    v = shape.values
    if shape.type == "plane":
        normal, extent = np.array(v["normal"]), v["extent"]
        at = floats_of(v["at"] - 0.005 * extent * normal / np.linalg.norm(normal))
        edges = (extent, extent, 0.01 * extent)
        return Mark("shapes", "box", shape.body, at, edges, turned_to(normal), hue, shape.name)
    radius = v.get("radius", 0.0)
    thickness = 0.02 * radius if shape.type == "disk" else v.get("length", radius)
    kind = {"disk": "cylinder", "ellipsoid": "sphere"}.get(shape.type, shape.type)
    edges = v.get("size", (radius, radius, thickness))
    size = floats_of(0.5 * np.array(edges)) if shape.type == "ellipsoid" else edges
    q = turned_to(v["axis"]) if "axis" in v else v.get("p", (1.0, 0.0, 0.0, 0.0))
    return Mark("shapes", kind, shape.body, v["at"], size, q, hue, shape.name)


def _mesh(folder: Path | None, name: str) -> tuple[Floats, Any] | str:
    """Vertices (k, 3) and triangles (m, 3) of a mesh file, or why there are none."""
    if folder is None:
        return f"where {name} lies is not known; name the model (--model, model=)"
    path = mesh_file(folder, name)
    if isinstance(path, Fault):
        return path.what
    mesh = read_mesh(path, name)
    if isinstance(mesh, str):
        return mesh
    vertices, triangles = mesh
    if len(triangles) > MOST_TRIANGLES:
        return f"{name} has {len(triangles)} triangles; at most {MOST_TRIANGLES} are drawn"
    return vertices, triangles


def _own_mesh(shape: Shape) -> tuple[Floats, Any] | str:
    """The triangles of a kind that a package brings, or why there are none."""
    from dap3d_core.registry.extensions import extensions

    kind = extensions("shape").load(shape.type)
    fields = {name: v for name, v in shape.values.items() if name not in RESERVED}
    try:
        places, corners = kind(**fields).mesh()
        vertices: Floats = np.array(places, dtype=np.float64)
        triangles: Integers = np.array(corners, dtype=np.int64)
    except ValueError as error:
        return str(error)
    except Exception as error:  # code of others
        return f"{where_is(kind)}.mesh failed: {type(error).__name__}: {error}"
    if len(triangles) > MOST_TRIANGLES:
        return f"it has {len(triangles)} triangles; at most {MOST_TRIANGLES} are drawn"
    rows_of_three = all(x.ndim == 2 and x.shape[1] == 3 and len(x) for x in (vertices, triangles))
    if not rows_of_three or not np.all(np.isfinite(vertices)):
        return f"{where_is(kind)}.mesh should return finite vertices (k, 3) and triangles (m, 3)"
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        return f"{where_is(kind)}.mesh returns a triangle of a vertex that is not there"
    return vertices, triangles
