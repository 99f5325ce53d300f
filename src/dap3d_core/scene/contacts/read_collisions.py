"""Reads the shapes that collide, and which of them meet."""

from collections.abc import Mapping, Sequence
from itertools import combinations, combinations_with_replacement
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.scene.contacts.collision_shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    KINDS,
    CollisionShapes,
)
from dap3d_core.scene.contacts.tables import Collisions, Material
from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.validate.coerce_values import Fault, bounded, number_of
from dap3d_core.scene.validate.geometry import missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.shapes import Shape
from dap3d_core.scene.validate.validated_scene import Instance

#: Kinds that do not meet cylinders yet.
NOT_CYLINDERS = (CAPSULE, CYLINDER, BOX)
COEFFICIENTS = {"mu": None, "e": 1.0}


def read_collisions(
    report: Collector, shapes: Sequence[Shape], index: Mapping[str, int], joints: list[Instance]
) -> CollisionShapes | None:
    """The shapes that collide; None where there are none, mistakes are reported.

    Args:
        report: takes the mistakes; its scene is read.
        shapes: of the scene.
        index: name of a body -> its index, ground 0.
        joints: bodies of one joint do not meet, but ground.
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
    kind = np.array([KINDS[s.type] for s in meeting])
    body = np.array([s.body for s in meeting])
    material, mu, e = _materials(report, meeting, given.material)
    _refuse_cylinders(report, meeting, apart)
    width = len(index)
    keys = sorted(i * width + j for i, j in apart)
    at, p, size = (np.array(x, dtype=float) for x in zip(*map(_placed, meeting), strict=True))
    return CollisionShapes(
        tuple(s.name for s in meeting), kind, body, at, p, size, material, mu, e,
        np.array(keys, dtype=np.int64),
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
    report: Collector, shapes: Sequence[Shape], usual: Any
) -> tuple[Integers, Floats, Floats]:
    """Index of the material of each shape, and mu and e of all pairs of materials."""
    materials = report.scene.materials
    used: dict[str, int] = {}
    index = []
    for shape in shapes:
        own = shape.values["material"]
        name = own or usual or ""
        if name and name not in materials and (own or name not in used):
            key = ("shapes", shape.name) if own else ("collisions",)
            words = missing_words(report, "material", name, materials)
            report.add((*key, "material"), name, *words)
        index.append(used.setdefault(name, len(used)))
    tables = np.zeros((2, len(used), len(used)))
    for a, b in combinations_with_replacement(used, 2):
        pair = _pair(report, materials.get(a, Material(a)), materials.get(b, Material(b)))
        i, j = used[a], used[b]
        tables[:, i, j] = tables[:, j, i] = pair
    return np.array(index), tables[0], tables[1]


def _pair(report: Collector, a: Material, b: Material) -> list[float]:
    """Mu and e of a pair of materials: as declared, or else their geometric means."""
    declared: dict[str, Any] = {}
    for one, other in ((a, b), (b, a)):
        tables, key = one.with_ or {}, ("materials", one.name, "with")
        if not isinstance(tables, Mapping) or not isinstance(tables.get(other.name, {}), Mapping):
            report.add(key, tables, "should be tables by name of the other material")
            continue
        declared = declared or dict(tables.get(other.name, {}))
        report.add_unknown_keys((*key, other.name), declared, tuple(COEFFICIENTS))
    found = []
    for name, most in COEFFICIENTS.items():
        values = [declared.get(name, getattr(m, name)) or 0.0 for m in (a, b)]
        for m, value in zip((a, b), values, strict=True):
            read = bounded(number_of(value), minimum=0.0, maximum=most)
            if isinstance(read, Fault):
                report.add(("materials", m.name, name), value, read.what)
                values = [0.0, 0.0]
        found.append(values[0] if values[0] == values[1] else (values[0] * values[1]) ** 0.5)
    return found


def _refuse_cylinders(
    report: Collector, shapes: Sequence[Shape], apart: set[tuple[int, int]]
) -> None:
    """Report the first pair of shapes that no kernel knows."""
    cylinders = [s for s in shapes if s.type == "cylinder"]
    for a in cylinders:
        for b in shapes:
            pair = min(a.body, b.body), max(a.body, b.body)
            if a.body != b.body and pair not in apart and KINDS[b.type] in NOT_CYLINDERS:
                what = f"a cylinder may meet spheres and planes, and {b.name} is a {b.type}"
                remedy = "take a capsule or a box, or exclude the pair in [collisions]"
                report.add(("shapes", a.name), MISSING, what, remedy=remedy)
                return


def _placed(shape: Shape) -> tuple[Any, Any, Any]:
    """Centre, Euler parameters and size of a shape, as ``CollisionShapes`` has them."""
    v = shape.values
    axis = v.get("axis", v.get("normal"))
    p = v.get("p", (1.0, 0.0, 0.0, 0.0)) if axis is None else _turned_to(axis)
    size = (v.get("radius", 0.0), 0.5 * v.get("length", 0.0), 0.0)
    return v["at"], p, tuple(0.5 * x for x in v["size"]) if "size" in v else size


def _turned_to(axis: Any) -> Floats:
    """Euler parameters that turn z to the direction of a vector."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    p = np.array([1.0 + z, -y, x, 0.0] if z > -0.5 else [-y, 1.0 - z, 0.0, x])
    found: Floats = p / np.linalg.norm(p)
    return found
