"""Shapes of links as shapes of a scene."""

from pathlib import Path
from typing import Any

import attrs

from dap3d_core.formats.import_scene.names import usable
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.interface.formats.articulation import Geometry, Link
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.scene.validate.shapes import MESHES

#: Folder of the meshes next to a scene.
FOLDER = "meshes"


@attrs.define(eq=False)
class MeshFiles:
    """Meshes that the shapes of a scene name, by path: each is copied below the scene's folder.

    Attributes:
        names: (path of the file, factors along its axes) -> name in the scene.
    """

    names: dict[tuple[Path, tuple[float, ...]], str] = attrs.Factory(dict)

    def name(self, path: Path, scale: tuple[float, ...]) -> str:
        """The name of a mesh in the scene."""
        key = (path, scale)
        if key not in self.names:
            taken, number = set(self.names.values()), 1
            name = f"{FOLDER}/{_plain(path.stem)}{path.suffix.lower()}"
            while name in taken:
                number += 1
                name = f"{FOLDER}/{_plain(path.stem)}_{number}{path.suffix.lower()}"
            self.names[key] = name
        return self.names[key]


def _plain(stem: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in stem)


def add_shapes(builder: SceneBuilder, link: Link, meshes: MeshFiles) -> None:
    """Add the shapes of a link: those that are seen, or of contacts where it has no others."""
    seen = [shape for shape in link.geometries if not shape.collision]
    for shape in seen or link.geometries:
        body, at = builder.attached(link.name, shape.pose)
        for keyword, fields in _shapes(builder, shape, at, meshes):
            name = builder.names.free("shapes", f"{usable(link.name)}_{keyword}")
            builder.scene.add_shape(keyword, name, body=body, color=shape.color or None, **fields)


def _shapes(
    builder: SceneBuilder, shape: Geometry, frame: Frame, meshes: MeshFiles
) -> list[tuple[str, dict[str, Any]]]:
    """Keyword and fields of the shapes that draw a geometry."""
    at, z = float_tuple(frame.r), frame.A[:, 2]
    if shape.size and min(shape.size) <= 0.0:
        builder.remarks.leave_out(shape.place, "a shape of size 0 is not drawn")
        return []
    if shape.kind == "box":
        return [("box", {"size": shape.size, "at": at, "p": quaternion(frame.A)})]
    if shape.kind == "sphere":
        return [("sphere", {"radius": shape.size[0], "at": at})]
    if shape.kind in ("cylinder", "capsule"):
        radius, length = shape.size
        tube = {"radius": radius, "length": length, "at": at, "axis": float_tuple(z)}
        caps = [
            ("sphere", {"radius": radius, "at": float_tuple(frame.r + side * z * length / 2.0)})
            for side in (1.0, -1.0)
        ]
        return [("cylinder", tube), *(caps if shape.kind == "capsule" else [])]
    if shape.kind == "mesh" and shape.mesh is not None:
        return _mesh(builder, shape, frame, meshes)
    if shape.kind != "mesh":
        builder.remarks.leave_out(shape.place, f"a shape {shape.kind} is not drawn")
    return []


def _mesh(
    builder: SceneBuilder, shape: Geometry, frame: Frame, meshes: MeshFiles
) -> list[tuple[str, dict[str, Any]]]:
    if shape.mesh.suffix.lower() not in MESHES:
        text = f"meshes other than {', '.join(MESHES)} are not drawn"
        builder.remarks.leave_out(shape.place, text)
        return []
    uniform = len(set(shape.scale)) == 1 and shape.scale[0] > 0.0
    if not uniform:
        text = "meshes with different or negative factors along their axes are not drawn"
        builder.remarks.leave_out(shape.place, text)
        return []
    name = meshes.name(shape.mesh, (1.0, 1.0, 1.0))
    factor = shape.scale[0]
    fields = {"file": name, "at": float_tuple(frame.r), "p": quaternion(frame.A)}
    return [("mesh", fields | ({} if factor == 1.0 else {"scale": factor}))]
