"""Shapes of links as shapes of a scene."""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.formats.import_scene.scene_builder import SceneBuilder, float_tuple, usable
from dap3d_core.interface.formats.articulation import (
    FRICTION_DIRECTIONS,
    WORLD,
    Articulation,
    Contact,
    Geometry,
    Link,
)
from dap3d_core.interface.formats.frames import Frame, quaternion
from dap3d_core.scene.validate.shapes import MESHES

#: (link, group, meets) in the file -> (group, meets) in the scene.
Bits = Mapping[tuple[str, int, int], tuple[int, int]]
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


def add_shapes(builder: SceneBuilder, link: Link, meshes: MeshFiles, bits: Bits) -> None:
    """Add the shapes of a link: those that are seen, or of contacts where it has no others.

    And those that meet others; bits: of ``bits_of_shapes``.
    """
    seen = [shape for shape in link.geometries if not shape.collision] or link.geometries
    for shape in link.geometries:
        if shape not in seen and shape.contact is None:
            continue
        body, at = builder.attached(link.name, shape.pose)
        for keyword, fields in _shapes(builder, shape, at, meshes):
            name = builder.names.free("shapes", f"{usable(link.name)}_{keyword}")
            given = fields | _meeting(builder, link.name, shape.contact, bits)
            builder.scene.add_shape(keyword, name, body=body, color=shape.color or None, **given)


def _meeting(
    builder: SceneBuilder, link: str, contact: Contact | None, bits: Bits
) -> dict[str, Any]:
    """Fields of a shape that meets others."""
    if contact is None:
        return {}
    key = attrs.evolve(contact, group=1, meets=1)
    name = builder.surfaces.setdefault(key, f"surface{len(builder.surfaces) + 1}")
    group, meets = bits[link, contact.group, contact.meets]
    given = {"group": group, "meets": meets}
    return {"collides": True, "material": name} | {n: x for n, x in given.items() if x != 1}


def bits_of_shapes(builder: SceneBuilder, model: Articulation) -> Bits:
    """(group, meets) of shapes, by link and by those in the file: pairs of links may stay apart.

    ``exclude`` of bodies would keep all that is fixed to one from all that is fixed to the other,
    as a floor of ground. A link that stays apart from a part of a body, or of ground, has bits of
    its own, and what it meets has them, too.
    """
    shapes = dict.fromkeys(
        (name, shape.contact.group, shape.contact.meets)
        for name, link in model.links.items()
        for shape in link.geometries
        if shape.contact is not None
    )
    apart, special = _apart(builder, model)
    free = iter(k for k in range(32) if not any((g | m) >> k & 1 for _, g, m in shapes))
    own: dict[Any, int] = {}
    for link, *bits in shapes:
        kind = (frozenset(apart.get(link, ())), *bits)
        if link not in special or kind in own:
            continue
        if (bit := next(free, None)) is not None:
            own[kind] = 1 << bit
        else:
            text = "that a link stays apart from a part of a body: bits for 32 groups are taken"
            builder.remarks.leave_out(model.links[link].place, text, motion=True)
    found = {}
    for link, group, meets in shapes:
        more = sum(bit for (others, g, m), bit in own.items()
                   if link not in others and g & meets | group & m)  # fmt: skip
        bit = own.get((frozenset(apart.get(link, ())), group, meets)) if link in special else None
        found[link, group, meets] = (bit, more) if bit else (group, meets | more)
    return found


def _apart(builder: SceneBuilder, model: Articulation) -> tuple[dict[str, set[str]], set[str]]:
    """Links that stay apart from others, and those of them that ``exclude`` does not keep so."""
    apart: dict[str, set[str]] = {}
    special, whole = set(), bodies_apart(builder, model)
    joined = () if model.base_meets else _joined(model)
    for pair in (*model.excluded, *joined):
        groups = tuple(builder.member[link][0] for link in pair)
        if groups[0] == groups[1] or (WORLD not in groups and pair not in model.excluded):
            continue
        for link, other in (pair, pair[::-1]):
            apart.setdefault(link, set()).add(other)
        if tuple(sorted(groups)) not in whole:
            special.add(pair[groups[0] != WORLD])
    return apart, special


def bodies_apart(builder: SceneBuilder, model: Articulation) -> dict[tuple[str, ...], None]:
    """Pairs of groups that move, of which all links that have shapes stay apart."""
    pairs = {frozenset(pair) for pair in (*model.excluded, *_beyond_rows(model))}
    meeting: dict[str, list[str]] = {}
    for name, link in model.links.items():
        if any(shape.contact for shape in link.geometries):
            meeting.setdefault(builder.member[name][0], []).append(name)
    groups = (sorted(builder.member[link][0] for link in pair) for pair in pairs)
    return {
        (one, other): None
        for one, other in sorted(groups)
        if one != other and WORLD not in (one, other)
        and all({a, b} in pairs for a, b in product(meeting.get(one, ()), meeting.get(other, ())))
    }  # fmt: skip


def _joined(model: Articulation) -> Iterator[tuple[str, str]]:
    """Pairs of links that a joint holds together, through links that are fixed to one of them."""
    held = _held_together(model)
    for joint in model.joints.values():
        if joint.kind not in ("fixed", "free") and WORLD not in (joint.parent, joint.child):
            yield from product(held[joint.parent], held[joint.child])


def _held_together(model: Articulation) -> dict[str, set[str]]:
    """The links that are fixed to each link, directly or through others, itself included."""
    held: dict[str, set[str]] = {name: {name} for name in model.links}
    for joint in model.joints.values():
        if joint.kind == "fixed" and WORLD not in (joint.parent, joint.child):
            together = held[joint.parent] | held[joint.child]
            for name in together:
                held[name] = together
    return held


def add_collisions(builder: SceneBuilder, model: Articulation) -> None:
    """Add the materials of the shapes that meet, and pairs of bodies that do not."""
    surfaces = list(builder.surfaces.items())
    for k, (one, name) in enumerate(surfaces):
        pairs = {other: _coefficients(model, one, two) for two, other in surfaces[k + 1 :]}
        given: dict[str, Any] = {"with_": pairs} if pairs else {}
        builder.scene.add_material(name, **_coefficients(model, one, one), **given)
    pairs_apart = bodies_apart(builder, model)
    builder.scene.add_collisions(
        exclude=tuple(tuple(sorted(builder.bodies[one] for one in pair)) for pair in pairs_apart)
    )


def _coefficients(model: Articulation, one: Contact, other: Contact) -> dict[str, float]:
    """Coefficients of a pair: its own, or of the one that has priority, if one has."""
    own = model.friction.get(frozenset((one.surface, other.surface)))
    if one.priority != other.priority:
        one = other = max(one, other, key=lambda contact: contact.priority)
    found = {name: model.coefficient_of_pair(getattr(one, name), getattr(other, name))
             for name in ("mu", "e", "mu_spin", "mu_roll")}  # fmt: skip
    directions = max(one.directions, other.directions)
    found |= {name: 0.0 for name, least in FRICTION_DIRECTIONS.items() if directions < least}
    found |= own or {}
    always = {"mu", *(own or ())}
    return {name: value for name, value in found.items() if value or name in always}


def _beyond_rows(model: Articulation) -> Iterator[tuple[str, str]]:
    """Links that joints in a row, with links between them that have nothing, hold together.

    And what is fixed to them.
    """
    held = _held_together(model)
    above = {joint.child: joint.parent for joint in model.joints.values() if not joint.closes}
    for name, link in model.links.items():
        parent = above.get(name, WORLD) if link.geometries else WORLD
        while parent != WORLD and not model.links[parent].geometries:
            if model.links[parent].inertial is not None:
                break
            parent = above.get(parent, WORLD)
            if parent != WORLD and parent not in held[name]:
                yield from product(held[name], held[parent])


def _shapes(
    builder: SceneBuilder, shape: Geometry, frame: Frame, meshes: MeshFiles
) -> list[tuple[str, dict[str, Any]]]:
    """Keyword and fields of the shapes that draw a geometry."""
    at, z = float_tuple(frame.r), frame.A[:, 2]
    if shape.size and min(shape.size) <= 0.0:
        _leave_out(builder, shape, "a shape of size 0 or less")
        return []
    if shape.kind == "plane":
        return [("plane", {"at": at, "normal": float_tuple(z)})]
    if shape.kind == "height_field":
        field = {"heights": shape.heights, "size": shape.size}
        return [("height_field", field | {"at": at, "p": quaternion(frame.A)})]
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
    if 0.0 in shape.scale:
        _leave_out(builder, shape, "a mesh with a factor of 0")
        return []
    name = meshes.name(shape.mesh, (1.0, 1.0, 1.0))
    builder.scene.files[name] = shape.mesh
    factor = shape.scale[0] if len(set(shape.scale)) == 1 and shape.scale[0] > 0.0 else shape.scale
    fields = {"file": name, "at": float_tuple(frame.r), "p": quaternion(frame.A)}
    return [("mesh", fields | ({} if factor == 1.0 else {"scale": factor}))]
