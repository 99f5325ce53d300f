"""Shapes of the scene as marks, lines and meshes."""

from collections.abc import Sequence
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.kinematics import to_global
from dap3d_core.scene.collector import Collector
from dap3d_core.scene.description import Scene
from dap3d_core.scene.shapes import Shape, mesh_file, read_shapes
from dap3d_core.scene.values import Fault
from dap3d_core.view.colors import color
from dap3d_core.view.marks import Mark, packed, plain, turned_to

#: Meshes of more triangles are not put into a page.
MOST_TRIANGLES = 300_000
#: Nor are further ones, once it holds so many triangles.
MOST_IN_ALL = 1_000_000
#: Nor are larger files read, bytes: that many triangles as text.
LARGEST_MESH = 100 * 2**20
#: Ground's shapes where they name no colour.
GROUND_COLOR = "#9aa3ad"


@attrs.define
class Drawn:
    """The shapes of a scene as the page draws them.

    Attributes:
        marks: solids.
        lines: ``body``, ``points`` (k, 3), ``color``, ``owner``.
        meshes: the same with ``at``, ``q``, ``scale``, ``count`` of triangles, packed ``vertices``
            and ``triangles``.
        corners: (body, place) pairs that the shapes reach to, for the camera.
        bodies: indices of the bodies that have a shape.
        notes: meshes that could not be had, and why.
    """

    marks: list[Mark] = attrs.Factory(list)
    lines: list[dict[str, Any]] = attrs.Factory(list)
    meshes: list[dict[str, Any]] = attrs.Factory(list)
    corners: list[tuple[int, tuple[float, ...]]] = attrs.Factory(list)
    bodies: set[int] = attrs.Factory(set)
    notes: list[str] = attrs.Factory(list)


def drawn(scene: Scene, names: Sequence[str], colors: Sequence[str]) -> Drawn:
    """The shapes of a scene.

    Args:
        scene: checked when it was run; its folder, where it is known, holds its meshes.
        names, colors: of the bodies, without ground.
    """
    index = {"ground": 0} | {name: k for k, name in enumerate(names, 1)}
    found = Drawn()
    for shape in read_shapes(Collector(scene), index):
        usual = colors[shape.body - 1] if shape.body else GROUND_COLOR
        _add(found, shape, color(shape.values["color"], usual), scene.folder)
    return found


def _add(found: Drawn, shape: Shape, hue: str, folder: Path | None) -> None:
    values, about = shape.values, {"color": hue, "owner": shape.name}
    if shape.type == "mesh":
        full = sum(mesh["count"] for mesh in found.meshes) >= MOST_IN_ALL
        words = f"the page holds {MOST_IN_ALL} triangles already, or more"
        mesh = words if full else _mesh(folder, values["file"])
        if isinstance(mesh, str):
            found.notes.append(f"shape {shape.name} is not drawn: {mesh}")
            return
        vertices, triangles = mesh
        placed = {"body": shape.body, "at": values["at"], "q": values["p"]}
        found.meshes.append(
            {**placed, **about, "scale": values["scale"], "count": len(triangles),
             "vertices": packed(vertices), "triangles": packed(triangles, "<u4")}
        )  # fmt: skip
        reached = values["scale"] * np.array([vertices.min(axis=0), vertices.max(axis=0)])
        found.corners += _corners(shape.body, values["at"], values["p"], reached)
    elif shape.type == "line":
        found.lines.append({"body": shape.body, "points": values["points"], **about})
        found.corners += [(shape.body, point) for point in values["points"]]
    else:
        mark = _solid(shape, hue)
        found.marks.append(mark)
        half = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 1.0, 0.5)}.get(mark.kind, (1.0,) * 3)
        high = np.multiply(half, mark.size)
        low = high * (-1.0, -1.0, 0.0 if mark.kind == "cone" else -1.0)
        found.corners += _corners(shape.body, mark.at, mark.q, np.array([low, high]))
    found.bodies.add(shape.body)


def _corners(
    body: int, at: tuple[float, ...], q: tuple[float, ...], reached: Floats
) -> list[tuple[int, tuple[float, ...]]]:
    """The corners of a box (2, 3) least and largest coordinates, placed in a body."""
    corners = np.array(list(product(*reached.T)))
    return [(body, plain(corner)) for corner in np.asarray(at) + to_global(q, corners)]


def _solid(shape: Shape, hue: str) -> Mark:
    v = shape.values
    radius = v.get("radius", 0.0)
    thickness = 0.02 * radius if shape.type == "disk" else v.get("length", radius)
    kind = {"disk": "cylinder"}.get(shape.type, shape.type)
    size = v["size"] if kind == "box" else (radius, radius, thickness)
    q = turned_to(v["axis"]) if "axis" in v else v.get("p", (1.0, 0.0, 0.0, 0.0))
    return Mark("shapes", kind, shape.body, v["at"], size, q, hue, shape.name)


def _mesh(folder: Path | None, name: str) -> tuple[Floats, Any] | str:
    """Vertices (k, 3) and triangles (m, 3) of a mesh file, or why they cannot be had."""
    if folder is None:
        return f"where {name} lies is not known; name the model (--model, model=)"
    path = mesh_file(folder, name)
    if isinstance(path, Fault):
        return path.what
    try:
        import trimesh
    except ImportError:
        return "reading meshes needs trimesh: pip install 'dap3d[mesh]'"
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_MESH + 1)
        if len(data) > LARGEST_MESH:
            return f"{name} has more than {LARGEST_MESH >> 20} MiB; save fewer triangles, or binary"
        kind = path.suffix[1:].lower()
        # from memory: materials, which are other files, are not read
        mesh: Any = trimesh.load(BytesIO(data), file_type=kind, force="mesh", skip_materials=True)
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # a broken file makes a reader fail in any way
        return f"{name} cannot be read: {error or type(error).__name__}"
    if not len(triangles) or not np.all(np.isfinite(vertices)):
        return f"{name} holds no triangles" if not len(triangles) else f"{name} holds no numbers"
    if len(triangles) > MOST_TRIANGLES:
        return f"{name} has {len(triangles)} triangles; at most {MOST_TRIANGLES} are drawn"
    return vertices, triangles
