"""Reads the shapes that collide, and which of them meet."""

from collections.abc import Mapping, Sequence
from itertools import combinations, combinations_with_replacement
from typing import Any

import numpy as np

from dap3d_core.interface.formats.frames import from_quaternion
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.scene.contacts.collision_shapes import KINDS, CollisionShapes
from dap3d_core.scene.contacts.tables import OF_PAIRS, Collisions, Materials
from dap3d_core.scene.errors import Key
from dap3d_core.scene.files.read_mesh import read_mesh
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.geometry import missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.shapes import Shape, height_field, mesh_file
from dap3d_core.scene.validate.validated_scene import Instance


def read_collisions(
    report: Collector, shapes: Sequence[Shape], index: Mapping[str, int], joints: list[Instance],
    materials: Materials,
) -> CollisionShapes | None:  # fmt: skip
    """The shapes that collide; None where there are none, mistakes are reported.

    Args:
        report: takes the mistakes; its scene is read.
        shapes: of the scene.
        index: name of a body -> its index, ground 0.
        joints: bodies of one joint do not meet, but ground.
        materials: of the scene.
    """
    given = report.scene.collisions or Collisions()
    chosen = _bodies(report, given.bodies, index)
    meeting = [s for s in shapes if s.values.get("collides") and s.body in chosen]
    if not meeting:
        what = "no shape of these bodies collides; give shapes collides = true"
        if report.scene.collisions is not None:
            report.note(f"collisions: {what}")
        return None
    jointed = [sorted({*joint.bodies} - {0}) for joint in joints]
    apart = {pair for bodies in jointed for pair in combinations(bodies, 2)}
    apart |= _excluded(report, given.exclude, index)
    parts = [(s, part) for s in meeting for part in _parts(report, s)]
    meeting = [s for s, _ in parts]
    material, coefficients = _materials(report, meeting, given.material, materials)
    width = len(index)
    keys = sorted(i * width + j for i, j in apart)
    at, p, size = (np.array([part[k] for _, part in parts], dtype=float) for k in range(3))
    hulls = [part[3] for _, part in parts]
    counts = np.array([len(hull) for hull in hulls])
    return CollisionShapes(
        names=tuple(s.name for s in meeting),
        kind=np.array([KINDS[s.type] for s in meeting]), body=np.array([s.body for s in meeting]),
        at=at, p=p, size=size, corners=np.column_stack([np.cumsum(counts) - counts, counts]),
        vertices=np.concatenate(hulls), material=material,
        bits=np.array([[s.values["group"], s.values["meets"]] for s in meeting]),
        apart=np.array(keys, dtype=np.int64), **coefficients,
    )  # fmt: skip


def _bodies(report: Collector, names: Any, index: Mapping[str, int]) -> set[int]:
    if names == "all":
        return set(index.values())
    if not isinstance(names, tuple):
        report.add(("collisions", "bodies"), names, 'should be "all" or a list of names of bodies')
        return set()
    found = (
        _body(report, ("collisions", "bodies", k), name, index) for k, name in enumerate(names)
    )
    return {i for i in found if i is not None}


def _body(report: Collector, key: Key, name: Any, index: Mapping[str, int]) -> int | None:
    if isinstance(name, str) and name in index:
        return index[name]
    report.add(key, name, *missing_words(report, "body", name, index))
    return None


def _excluded(report: Collector, pairs: Any, index: Mapping[str, int]) -> set[tuple[int, int]]:
    found = set()
    for k, pair in enumerate(pairs if isinstance(pairs, tuple) else (pairs,)):
        key: Key = ("collisions", "exclude", k)
        if not isinstance(pair, tuple) or len(pair) != 2:
            report.add(key, pair, 'should be a list of pairs of bodies: [["a", "b"]]')
            continue
        i, j = (_body(report, key, name, index) for name in pair)
        if i is not None and j is not None:
            found.add((min(i, j), max(i, j)))
    return found


def _materials(
    report: Collector, shapes: Sequence[Shape], usual: Any, materials: Materials
) -> tuple[Integers, dict[str, Floats]]:
    """Index of the material of each shape, and coefficients of all pairs of materials, by name."""
    known = materials.by_name
    used: dict[str, int] = {}
    index = []
    for shape in shapes:
        own = shape.values["material"]
        name = own or usual or ""
        if name and name not in known and (own or name not in used):
            key = ("shapes", shape.name) if own else ("collisions",)
            words = missing_words(report, "material", name, known)
            report.add((*key, "material"), name, *words)
        index.append(used.setdefault(name, len(used)))
    for name in used.keys() & known.keys():
        if (mu_s := known[name].mu_s) is not None and mu_s != known[name].mu:
            report.note(f"materials.{name}.mu_s is of declared contacts alone: shapes that collide "
                        "stick and slide by mu")  # fmt: skip
    tables = np.zeros((len(OF_PAIRS), len(used), len(used)))
    for a, b in combinations_with_replacement(used, 2):
        i, j = used[a], used[b]
        tables[:, i, j] = tables[:, j, i] = materials.pair(a, b)
    found = zip(OF_PAIRS, tables, strict=True)
    return np.array(index), {n: table for n, table in found if n in ("mu", "e") or table.any()}


def _parts(report: Collector, shape: Shape) -> list[tuple[Any, Any, Any, Floats]]:
    """Centre, Euler parameters, size and vertices of all parts, as ``CollisionShapes`` has them."""
    v = shape.values
    if shape.type == "mesh":
        return [_about_middle(v, _hull(report, shape))]
    if shape.type == "height_field":
        vertices, triangles = height_field(v)
        tops = vertices[triangles]
        low, high = tops.min(axis=1, keepdims=True), tops.max(axis=1, keepdims=True)
        deep = low[:, :, 2:] - (high - low)[:, :, :2].max(axis=2, keepdims=True)  # prisms, as wide
        below = np.concatenate([tops[:, :, :2], np.repeat(deep, 3, axis=1)], axis=2)
        return [_about_middle(v, hull) for hull in np.concatenate([tops, below], axis=1)]
    axis = v.get("axis", v.get("normal"))
    p = v.get("p", (1.0, 0.0, 0.0, 0.0)) if axis is None else _turned_to(axis)
    size = (v.get("radius", 0.0), 0.5 * v.get("length", 0.0), 0.0)
    size = tuple(0.5 * x for x in v["size"]) if "size" in v else size
    return [(v["at"], p, size, np.zeros((0, 3)))]


def _about_middle(v: Mapping[str, Any], hull: Floats) -> tuple[Any, Any, Any, Floats]:
    middle = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
    at = v["at"] + from_quaternion(v["p"]) @ middle
    return at, v["p"], np.abs(hull - middle).max(axis=0), hull - middle


def _hull(report: Collector, shape: Shape) -> Floats:
    """Vertices of the convex hull of a mesh, m; one point where a mistake is reported."""
    from scipy.spatial import ConvexHull, QhullError

    name = shape.values["file"]
    path = report.scene.files.get(name) or mesh_file(report.scene.folder, name)
    found = path.what if isinstance(path, Fault) else read_mesh(path, name)
    if not isinstance(found, str):
        try:
            return found[0][ConvexHull(found[0]).vertices] * shape.values["scale"]
        except QhullError:
            found = f"{name} is flat: it has no convex hull"
    remedy = "a mesh that collides is read with the scene: load that from its folder"
    report.add(("shapes", shape.name, "file"), name, found, remedy=remedy)
    return np.zeros((1, 3))


def _turned_to(axis: Any) -> Floats:
    """Euler parameters that turn z to the direction of a vector."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    p = np.array([1.0 + z, -y, x, 0.0] if z > -0.5 else [-y, 1.0 - z, 0.0, x])
    return p / np.linalg.norm(p)
