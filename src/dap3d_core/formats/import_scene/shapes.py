"""Shapes of links as shapes of a scene."""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.formats.import_scene.names import usable
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple
from dap3d_core.interface.formats.articulation import (
    WORLD,
    Articulation,
    Contact,
    Geometry,
    Link,
)
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.scene.tables import GROUND
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


def add_shapes(
    builder: SceneBuilder, link: Link, meshes: MeshFiles, bits: Mapping[str, tuple[int, int]]
) -> None:
    """Add the shapes of a link: those that are seen, or of contacts where it has no others.

    And those that meet others; bits: ``bits_beside_ground``.
    """
    seen = [shape for shape in link.geometries if not shape.collision] or link.geometries
    for shape in link.geometries:
        if shape not in seen and shape.contact is None:
            continue
        body, at = builder.attached(link.name, shape.pose)
        for keyword, fields in _shapes(builder, shape, at, meshes):
            name = builder.names.free("shapes", f"{usable(link.name)}_{keyword}")
            given = fields | _meeting(builder, shape.contact, bits.get(link.name))
            builder.scene.add_shape(keyword, name, body=body, color=shape.color or None, **given)


def _meeting(
    builder: SceneBuilder, contact: Contact | None, bits: tuple[int, int] | None
) -> dict[str, Any]:
    """Fields of a shape that meets others; bits: in place of its own."""
    if contact is None:
        return {}
    key = (contact.mu, contact.smooth)
    name = builder.surfaces.setdefault(key, f"surface{len(builder.surfaces) + 1}")
    group, meets = bits or (contact.group, contact.meets)
    given = {"group": group, "meets": meets}
    return {"collides": True, "material": name} | {n: x for n, x in given.items() if x != 1}


def bits_beside_ground(builder: SceneBuilder, model: Articulation) -> dict[str, tuple[int, int]]:
    """(group, meets) of links that do not move and of those that stay apart from them.

    ``exclude`` of bodies would keep the latter from all of ground, a floor too. Each set of links
    that do not move has a bit of its own, 4 and on, and those that move and do not meet all of
    them have 2; so both meet what has the usual bits, 1 and 1.
    """
    if model.base_meets:
        return {}
    apart: dict[str, set[str]] = {}
    for pair in (*model.excluded, *_joined(model)):
        groups = [builder.member[link][0] for link in pair]
        for link, (own, other) in zip(pair, (groups, groups[::-1]), strict=True):
            if own == WORLD != other and link != WORLD:
                apart.setdefault(link, set()).add(other)
    kinds = list(dict.fromkeys(frozenset(others) for others in apart.values()))
    bits = {link: (4 << kinds.index(frozenset(others)), 1) for link, others in apart.items()}
    for link, (group, _) in builder.member.items():
        met = [k for k, others in enumerate(kinds) if group not in others]
        if group != WORLD and len(met) < len(kinds):
            bits[link] = (2, 3 + sum(4 << k for k in met))
    return bits


def _joined(model: Articulation) -> Iterator[tuple[str, str]]:
    """Pairs of links that a joint holds together, through links that are fixed to one of them."""
    held: dict[str, set[str]] = {name: {name} for name in model.links}
    for joint in model.joints.values():
        if joint.kind == "fixed" and WORLD not in (joint.parent, joint.child):
            together = held[joint.parent] | held[joint.child]
            for name in together:
                held[name] = together
    for joint in model.joints.values():
        if joint.kind not in ("fixed", "free") and WORLD not in (joint.parent, joint.child):
            yield from product(held[joint.parent], held[joint.child])


def add_collisions(builder: SceneBuilder, model: Articulation) -> None:
    """Add the materials of the shapes that meet, and pairs of bodies that do not."""
    surfaces = list(builder.surfaces.items())
    for k, ((mu, smooth), name) in enumerate(surfaces):
        pairs = {
            other: {"mu": 0.0 if smooth and and_smooth else model.friction_of_pair(mu, mu_other)}
            for (mu_other, and_smooth), other in surfaces[k + 1 :]
        }
        given: dict[str, Any] = {"with_": pairs} if pairs else {}
        builder.scene.add_material(name, mu=0.0 if smooth else mu, **given)
    bodies = [tuple(builder.bodies[builder.member[link][0]] for link in pair)
              for pair in (*model.excluded, *_beyond_rows(model))]  # fmt: skip
    if not model.base_meets:  # of those that do not move by bits
        bodies = [pair for pair in bodies if GROUND not in pair]
    apart = dict.fromkeys(tuple(sorted(pair)) for pair in bodies if pair[0] != pair[1])
    builder.scene.add_collisions(exclude=tuple(apart))


def _beyond_rows(model: Articulation) -> Iterator[tuple[str, str]]:
    """Links that joints in a row, with links between them that have nothing, hold together."""
    above = {joint.child: joint.parent for joint in model.joints.values() if not joint.closes}
    for name, link in model.links.items():
        parent = above.get(name, WORLD) if link.geometries else WORLD
        while parent != WORLD and not model.links[parent].geometries:
            if model.links[parent].inertial is not None:
                break
            parent = above.get(parent, WORLD)
            if parent != WORLD:
                yield name, parent


def _shapes(
    builder: SceneBuilder, shape: Geometry, frame: Frame, meshes: MeshFiles
) -> list[tuple[str, dict[str, Any]]]:
    """Keyword and fields of the shapes that draw a geometry."""
    at, z = float_tuple(frame.r), frame.A[:, 2]
    if shape.size and min(shape.size) <= 0.0:
        _leave_out(builder, shape, "a shape of size 0")
        return []
    if shape.kind == "plane":
        return [("plane", {"at": at, "normal": float_tuple(z)})]
    if shape.kind == "ellipsoid":
        size = tuple(2.0 * half for half in shape.size)
        return [("ellipsoid", {"size": size, "at": at, "p": quaternion(frame.A)})]
    if shape.kind == "box":
        return [("box", {"size": shape.size, "at": at, "p": quaternion(frame.A)})]
    if shape.kind == "sphere":
        return [("sphere", {"radius": shape.size[0], "at": at})]
    if shape.kind in ("cylinder", "capsule"):
        radius, length = shape.size
        tube = {"radius": radius, "length": length, "at": at, "axis": float_tuple(z)}
        if shape.contact is not None:
            return [(shape.kind, tube)]
        caps = [
            ("sphere", {"radius": radius, "at": float_tuple(frame.r + side * z * length / 2.0)})
            for side in (1.0, -1.0)
        ]
        return [("cylinder", tube), *(caps if shape.kind == "capsule" else [])]
    if shape.kind == "mesh" and shape.mesh is not None:
        return _mesh(builder, shape, frame, meshes)
    if shape.kind != "mesh":
        _leave_out(builder, shape, f"a shape {shape.kind}")
    return []


def _leave_out(builder: SceneBuilder, shape: Geometry, what: str) -> None:
    """Remark that a shape is left out."""
    if shape.contact is None:
        builder.remarks.leave_out(shape.place, f"{what} is not drawn")
    else:
        builder.remarks.leave_out(shape.place, f"{what} meets no others", motion=True)


def _mesh(
    builder: SceneBuilder, shape: Geometry, frame: Frame, meshes: MeshFiles
) -> list[tuple[str, dict[str, Any]]]:
    if shape.mesh.suffix.lower() not in MESHES:
        _leave_out(builder, shape, f"a mesh other than {', '.join(MESHES)}")
        return []
    uniform = len(set(shape.scale)) == 1 and shape.scale[0] > 0.0
    if not uniform:
        _leave_out(builder, shape, "a mesh with different or negative factors along its axes")
        return []
    name = meshes.name(shape.mesh, (1.0, 1.0, 1.0))
    builder.scene.files[name] = shape.mesh
    factor = shape.scale[0]
    fields = {"file": name, "at": float_tuple(frame.r), "p": quaternion(frame.A)}
    return [("mesh", fields | ({} if factor == 1.0 else {"scale": factor}))]
