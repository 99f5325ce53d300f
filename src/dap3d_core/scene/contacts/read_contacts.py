"""Reads contacts, with fields of their materials: one instance for each point that may touch."""

from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any

import attrs

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.contacts.contact import HIDDEN, MATERIAL, SMOOTH, TOUCHES
from dap3d_core.interface.examine.examine import examine
from dap3d_core.interface.fields import FieldSpec, specs_of
from dap3d_core.scene.contacts.tables import Materials
from dap3d_core.scene.errors import MISSING
from dap3d_core.scene.tables import Element
from dap3d_core.scene.validate.coerce_values import READERS
from dap3d_core.scene.validate.elements import read_elements
from dap3d_core.scene.validate.geometry import Geometry, missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.types import Types
from dap3d_core.scene.validate.validated_scene import Instance

#: Stands for fields of a type that is not known.
_ANY = FieldSpec("number", None)


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
        given = {"mu": 0.0, "mu_s": 0.0} | one.values | (SMOOTH if smooth else {}) | HIDDEN
        if given["touch"] and count > 1:
            what = f"cannot be: a {one.type_info.type.keyword} may touch at {count} points"
            remedy = "place its bodies so that they touch, or add a contact of the point that does"
            report.add(("contacts", one.name, "touch"), True, what, remedy=remedy)
        for k in range(count):
            name = one.name if count == 1 else f"{one.name}#{k + 1}"
            values = given | {"part": float(k)}
            if values["touch"]:
                values["mode_0"] = TOUCHES  # its gap is a row as the scene is assembled
            if values["mu_s"] is not None and values["mu_s"] < values["mu"]:
                what = f"is less than mu = {values['mu']:g}; what slides would stick more than rest"
                report.add(("contacts", one.name, "mu_s"), values["mu_s"], what)
            found.append(attrs.evolve(one, name=name, values=values))
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
        if given.get("mu_s") is not None and given["mu_s"] < given["mu"]:
            what = f"is less than mu = {given['mu']:g}; what slides would stick more than rest"
            report.add((*key, "mu_s"), given["mu_s"], what)
        grips = grips_of(joint.type_info)
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


def grips_of(joint: TypeInfo) -> tuple[TypeInfo, ...]:
    """The friction that sticks of a type of joint."""
    type_: Any = joint.type
    return tuple(map(_examined, type_.grips))


@cache
def _examined(grip: Any) -> TypeInfo:
    return examine(grip)


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
    given = {field: getattr(material, field) for field in MATERIAL if own.get(field, _ANY).given}
    given = {field: value for field, value in given.items() if value is not None}
    return attrs.evolve(element, fields=given | fields)
