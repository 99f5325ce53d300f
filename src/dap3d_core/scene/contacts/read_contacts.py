"""Reads the contacts of a scene: materials, points that may touch, and shapes that collide.

Materials say what surfaces do where they touch, each alone and in pairs; a contact has the fields
of its materials, and one instance for each point. Of shapes that collide is read which ones meet.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations, combinations_with_replacement
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.contacts.contact import HIDDEN, LAWS, MATERIAL, SMOOTH, TOUCHES
from dap3d_core.interface.contacts.resistance import RESISTED, resisting_type
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.interface.formats.frames import from_quaternion
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.registry.loading import examined
from dap3d_core.scene.contacts.collision_shapes import KINDS, CollisionShapes
from dap3d_core.scene.contacts.tables import OF_PAIRS, Collisions, Material, Materials
from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.files.read_mesh import read_mesh
from dap3d_core.scene.tables import Element
from dap3d_core.scene.validate.coerce_values import READERS, Fault, bounded, number_of, word_of
from dap3d_core.scene.validate.elements import read_elements
from dap3d_core.scene.validate.geometry import Geometry, missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.shapes import Shape, height_field, mesh_file
from dap3d_core.scene.validate.types import Types
from dap3d_core.scene.validate.validated_scene import Instance

#: Contacts of bodies of that mass, kg, or more measure forces in newtons; the least mass by which
#: one measures them, as a part of the largest of the scene.
ORDINARY_MASS, LIGHTEST_PART = 0.1, 1e-6


def read_collisions(
    report: Collector, shapes: Sequence[Shape], index: Mapping[str, int], joints: list[Instance],
    materials: Materials,
) -> CollisionShapes | None:  # fmt: skip
    """The shapes that collide; None where there are none, mistakes are reported.

    index: name of a body -> its index, ground 0.
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
            report.add((*key, "material"), name, *missing_words(report, "material", name, known))
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


#: Coefficients of materials, and the largest value of each.
LARGEST: Mapping[str, float | None] = {
    "mu": None, "mu_s": None, "mu_roll": None, "mu_spin": None, "e": 1.0,
}  # fmt: skip


def read_materials(report: Collector) -> Materials:
    """All materials of a scene, used or not; mistakes are reported."""
    materials = report.scene.materials
    by_name = {name: _material(report, material) for name, material in materials.items()}
    pairs: dict[tuple[str, ...], dict[str, float]] = {}
    for name, material in materials.items():
        key, tables = ("materials", name, "with"), material.with_ or {}
        if not isinstance(tables, Mapping):
            report.add(key, tables, "should be tables by name of the other material")
            continue
        for other, table in tables.items():
            pair = pairs.setdefault(tuple(sorted((name, other))), {})
            _read_pair(report, (*key, other), table, pair)
    return Materials(by_name, pairs)


def _material(report: Collector, material: Material) -> Material:
    """A material with numbers and words."""
    key: Key = ("materials", material.name)
    given = {name: getattr(material, name) for name in LARGEST}
    found: dict[str, Any] = {n: _coefficient(report, (*key, n), x) for n, x in given.items()}
    if _sticks_less(report, key, found["mu_s"], found["mu"] or 0.0):
        found["mu_s"] = None
    if material.law is not None:
        law = report.read((*key, "law"), material.law, lambda word: word_of(word, LAWS))
        found["law"] = None if isinstance(law, Fault) else law
    return Material(material.name, **found)


def _sticks_less(report: Collector, key: Key, mu_s: float | None, mu: float) -> bool:
    """True, and a mistake, where sticking friction is less than that of sliding."""
    if mu_s is None or mu_s >= mu:
        return False
    what = f"is less than mu = {mu:g}; what slides would stick more than rest"
    report.add((*key, "mu_s"), mu_s, what)
    return True


def _read_pair(report: Collector, key: Key, table: Any, pair: dict[str, float]) -> None:
    """Add a table [materials.NAME.with.OTHER] to what the pair has, as one or the other gave it."""
    name, other = str(key[1]), str(key[3])
    if not isinstance(table, Mapping):
        report.add(key, table, "should be a table of the pair, such as {mu = 0.3}")
        return
    if other not in report.scene.materials:
        report.add(key, table, *missing_words(report, "material", other, report.scene.materials))
    report.add_unknown_keys(key, dict(table), OF_PAIRS)
    for word in OF_PAIRS:
        value = _coefficient(report, (*key, word), table.get(word))
        if value is not None and pair.setdefault(word, value) != value:
            what = f"is {pair[word]:g} in [materials.{other}.with.{name}]: a pair has one of each"
            report.add((*key, word), value, what, remedy="take one of the two out")


def _coefficient(report: Collector, key: Key, value: Any) -> float | None:
    """A coefficient; None where it is not given, or a mistake is reported."""
    if value is None:
        return None
    most = LARGEST[str(key[-1])]
    read = report.read(key, value, lambda x: bounded(number_of(x), minimum=0.0, maximum=most))
    return None if isinstance(read, Fault) else read


def read_contacts(
    report: Collector, geometry: Geometry, types: Types, functions: Sequence[Instance],
    elements: Mapping[str, Element], materials: Materials,
) -> list[Instance]:  # fmt: skip
    """The contacts of a scene; of one with several points ``NAME#1``, ``NAME#2``, ...

    elements: those of the scene, and limits of joints; materials: of the scene.
    """
    for name in elements.keys() & report.scene.joints.keys():
        what = "is the name of a joint as well; results know both by their names"
        report.add(("contacts", name), MISSING, what, remedy="rename one of them")
    elements = {name: _with_material(report, types, e, materials) for name, e in elements.items()}
    found = []
    for one in read_elements(report, geometry, "contacts", types, functions, elements):
        count: int = one.type_info.type.points  # type: ignore[attr-defined]
        smooth = one.type_info.type.is_smooth  # type: ignore[attr-defined]
        unread = dict.fromkeys(("mu", "mu_s", "mu_roll", "mu_spin"), 0.0)
        given = unread | one.values | (SMOOTH if smooth else {}) | HIDDEN
        if given["touch"] and count > 1:
            what = f"cannot be: a {one.type_info.type.keyword} may touch at {count} points"
            remedy = "place its bodies so that they touch, or add a contact of the point that does"
            report.add(("contacts", one.name, "touch"), True, what, remedy=remedy)
        for k in range(count):
            name = one.name if count == 1 else f"{one.name}#{k + 1}"
            values = given | {"part": float(k)}
            if values["touch"]:
                values["mode_0"] = TOUCHES  # its gap is a row as the scene is assembled
            _sticks_less(report, ("contacts", one.name), values["mu_s"], values["mu"])
            found.append(attrs.evolve(one, name=name, values=values))
    return [*found, *_resisting(report, found)]


def _resisting(report: Collector, contacts: Sequence[Instance]) -> list[Instance]:
    """What resists rolling and spinning at contacts, as contacts of their own behind them."""
    found = []
    for one in contacts:
        type_: Any = one.type_info.type
        for how, (field, what) in RESISTED.items():
            if not one.values.get(field) and type_.resist is None:
                continue
            name, _, point = one.name.partition("#")
            if f"{name}_{how}" in report.scene.contacts.keys() | report.scene.joints.keys():
                words = f"is the name of what resists {what} at {name}"
                report.add(("contacts", f"{name}_{how}"), MISSING, words, remedy="rename it")
            values = one.values | SMOOTH | {"e": 0.0, "mode_0": 0.0, "joint": one.name}
            name = f"{name}_{how}#{point}" if point else f"{name}_{how}"
            type_info = examined(resisting_type(type_, how))
            found.append(attrs.evolve(one, name=name, type_info=type_info, values=values))
    return found


def limits_of(report: Collector, joints: Sequence[Instance]) -> dict[str, Element]:
    """The contacts NAME_lower and NAME_upper that limit joints."""
    found: dict[str, Element] = {}
    for joint in joints:
        type_: Any = joint.type_info.type
        fields = report.scene.joints[joint.name].fields
        spec = FieldSpec("number", None, unit="rad" if type_.coordinate == "angle" else "m")
        bounds = {}
        for side in ("lower", "upper"):
            if side in fields:
                key = ("joints", joint.name, side)
                bounds[side] = report.read(key, fields[side], partial(READERS["number"], spec))
        if not bounds:
            what = "is of limits, and neither lower nor upper is given"
            report.add(("joints", joint.name, "e"), fields["e"], what)
        numbers = [bound for bound in bounds.values() if isinstance(bound, float)]
        if len(numbers) == 2 and numbers[0] >= numbers[1]:
            what = f"is not above lower = {numbers[0]:g}"
            report.add(("joints", joint.name, "upper"), fields["upper"], what)
        for side, bound in bounds.items():
            name = f"{joint.name}_{side}"
            if name in report.scene.contacts:
                what = f"is the name of the {side} limit of joint {joint.name}"
                report.add(("contacts", name), MISSING, what, remedy="rename one of them")
            given = {"joint": joint.name, "bound": bound, "side": side}
            given |= {"e": fields["e"]} if "e" in fields else {}
            if isinstance(bound, float):
                found[name] = Element(name, type_.limit, given)
    return found


def read_rigid(report: Collector, types: Types, stops: Sequence[Instance]) -> list[Instance]:
    """Stops that are contacts, as no stiffness is given."""
    scene, found = report.scene, []
    for stop in stops:
        if stop.name in scene.joints or stop.name in scene.contacts:
            table = "joints" if stop.name in scene.joints else "contacts"
            what = f"is rigid, as a contact is, and its name is one of [{table}] as well"
            report.add(("forces", stop.name), MISSING, what, remedy="rename one of them")
        element = scene.forces[stop.name]
        soft = types.known("force", element.type)
        assert soft is not None
        own = specs_of(stop.type_info.type)
        for field in specs_of(soft.type).keys() & element.fields.keys() - own.keys():
            what = "is of the spring that carries the stop, which is rigid without k"
            report.add(("forces", stop.name, field), element.fields[field], what,
                       remedy="give k, or leave it out")  # fmt: skip
        found.append(attrs.evolve(stop, values={"e": 0.0} | stop.values | SMOOTH | HIDDEN))
    return found


def read_friction(
    report: Collector, joints: Mapping[str, Instance], forces: Sequence[Instance]
) -> list[Instance]:
    """Friction of joints that sticks, as contacts; joints: those of the scene, by name."""
    found = []
    for force in forces:
        joint = joints[force.values[force.type_info.friction_joint]]
        given, key = force.values, ("forces", force.name)
        _sticks_less(report, key, given.get("mu_s"), given["mu"])
        grips = [examined(grip) for grip in joint.type_info.type.grips]  # type: ignore[attr-defined]
        for k, grip in enumerate(grips):
            name = force.name if len(grips) == 1 else f"{force.name}#{k + 1}"
            values = SMOOTH | joint.values | HIDDEN | {"e": 0.0, "part": float(k)}
            values |= {n: given.get(n) for n in ("mu", "mu_s")} | {"joint": joint.name}
            values["shared"] = given.get("shared")
            if "radius" in grip.layout.numbers and "radius" not in joint.values:
                values["radius"] = given.get("radius") or 1.0
                if given.get("radius") is None and k + 1 == len(grips):
                    what = f"is missing, which friction in {joint.type_info.type.keyword} needs"
                    report.add((*key, "radius"), MISSING, what)
            found.append(Instance(name, grip, joint.bodies, (), values))
    return found


def with_unit_mass(contacts: Sequence[Instance], mass: Floats) -> list[Instance]:
    """Contacts with the mass that their forces are measured by, that of the lighter body.

    It is a power of ten, and 1 kg of ordinary ones. What is far lighter than the scene may carry
    the rest of it, with forces of that rounding.
    """
    found, least = [], LIGHTEST_PART * float(np.max(mass, initial=0.0))
    for one in contacts:
        masses = [float(mass[k - 1]) for k in one.bodies if k > 0]
        lighter = max(least, min(masses, default=1.0))
        is_light = 0.0 < lighter < ORDINARY_MASS  # masses that are mistakes are none
        unit = float(10.0 ** np.round(np.log10(lighter))) if is_light else 1.0
        found.append(attrs.evolve(one, values=one.values | {"unit_mass": unit}))
    return found


def _with_material(
    report: Collector, types: Types, element: Element, materials: Materials
) -> Element:
    """A contact with the fields that its material gives, and it does not."""
    fields: dict[str, Any] = dict(element.fields)
    if "material" not in fields:
        return element
    name = fields.pop("material")
    material = materials.by_name.get(name) if isinstance(name, str) else None
    if material is None:
        what, near, remedy = missing_words(report, "material", name, materials.by_name)
        report.add(("contacts", element.name, "material"), name, what, near, remedy)
        return attrs.evolve(element, fields=fields)
    known = types.known("contact", element.type)
    own = specs_of(known.type) if known else {}  # of another law of friction perhaps without mu
    taken = [field for field in MATERIAL if field not in own or own[field].given]
    given = {field: getattr(material, field) for field in taken}
    given = {field: value for field, value in given.items() if value is not None}
    return attrs.evolve(element, fields=given | fields)
