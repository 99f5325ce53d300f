"""Reads contacts, with fields of their materials: one instance for each point that may touch."""

from collections.abc import Sequence
from typing import Any

import attrs

from dap3d_core.interface.contacts.contact import HIDDEN, MATERIAL, TOUCHES
from dap3d_core.scene.errors import MISSING
from dap3d_core.scene.tables import Element
from dap3d_core.scene.validate.elements import read_elements
from dap3d_core.scene.validate.geometry import Geometry, missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.types import Types
from dap3d_core.scene.validate.validated_scene import Instance


def read_contacts(
    report: Collector, geometry: Geometry, types: Types, functions: Sequence[Instance]
) -> list[Instance]:
    """The contacts of a scene; of one with several points ``NAME#1``, ``NAME#2``, ..."""
    scene = report.scene
    for name in scene.contacts.keys() & scene.joints.keys():
        what = "is the name of a joint as well; results know both by their names"
        report.add(("contacts", name), MISSING, what, remedy="rename one of them")
    elements = {name: _with_material(report, e) for name, e in scene.contacts.items()}
    found = []
    for one in read_elements(report, geometry, "contacts", types, functions, elements):
        count: int = one.type_info.type.points  # type: ignore[attr-defined]
        if one.values["touch"] and count > 1:
            what = f"cannot be: a {one.type_info.type.keyword} may touch at {count} points"
            remedy = "place its bodies so that they touch, or add a contact of the point that does"
            report.add(("contacts", one.name, "touch"), True, what, remedy=remedy)
        for k in range(count):
            name = one.name if count == 1 else f"{one.name}#{k + 1}"
            values = one.values | HIDDEN | {"part": float(k)}
            if values["touch"]:
                values["mode_0"] = TOUCHES  # its gap is a row as the scene is assembled
            if values["mu_s"] is not None and values["mu_s"] < values["mu"]:
                what = f"is less than mu = {values['mu']:g}; what slides would stick more than rest"
                report.add(("contacts", one.name, "mu_s"), values["mu_s"], what)
            found.append(attrs.evolve(one, name=name, values=values))
    return found


def _with_material(report: Collector, element: Element) -> Element:
    """A contact with the fields that its material gives, and it does not."""
    fields: dict[str, Any] = dict(element.fields)
    if "material" not in fields:
        return element
    name, materials = fields.pop("material"), report.scene.materials
    material = materials.get(name) if isinstance(name, str) else None
    if material is None:
        what, near, remedy = missing_words(report, "material", name, materials)
        report.add(("contacts", element.name, "material"), name, what, near, remedy)
        return attrs.evolve(element, fields=fields)
    given = {field: getattr(material, field) for field in MATERIAL}
    given = {field: value for field, value in given.items() if value is not None}
    return attrs.evolve(element, fields=given | fields)
