"""What elements have of joints: fields of one which they name, and the forces that joints bring."""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

import attrs

from dap3d_core.interface.codegen.reactions import joint_fields
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.scene.tables import ACTIVE, BREAKS_AT, GROUND, LIMITS, RELEASES, Element
from dap3d_core.scene.validate.geometry import Geometry, missing_words
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Instance


def keys_beside_fields(type_: Any) -> tuple[str, ...]:
    """Keys that a type takes besides its own fields: limits and releases of joints."""
    limits = LIMITS if getattr(type_, "limit", "") else ()
    return limits + (RELEASES if type_.kind == "joint" else ())


def with_joint_fields(
    report: Collector,
    geometry: Geometry,
    table: str,
    element: Element,
    references: Mapping[str, FieldSpec],
    lists: Collection[str],
    known: Callable[[str, Any], TypeInfo | None],
) -> Element | None:
    """The element with the fields of the joints that it names; None where a mistake is reported.

    Args:
        report: takes mistakes; its scene has the joints.
        geometry: resolves points and vectors to bodies.
        table: of the element.
        element: as written.
        references: fields that name joints, as of ``joint_fields``.
        lists: fields of the element that take something of each of several joints.
        known: the type of a kind and keyword, if there is one.
    """
    fields, good = dict(element.fields), True

    def refuse(field: str, what: str, nearest: str = "", remedy: str = "") -> None:
        nonlocal good
        report.add((table, element.name, field), element.fields[field], what, nearest, remedy)
        good = False

    for field, spec in references.items():
        given, gives = element.fields.get(field), spec.gives
        names = given if isinstance(given, tuple) else () if given is None else (given,)
        found = []
        for name in names:
            joint = report.scene.joints.get(name) if isinstance(name, str) else None
            if joint is None or joint is element:
                refuse(field, *missing_words(report, "joint", name, report.scene.joints))
            else:
                found.append(joint)
        for joint in found if spec.acts_in else ():
            if _coordinate(known("joint", joint.type)) not in ("", spec.acts_in):
                has_no = f"is of type {joint.type}, which has no {spec.acts_in}"
                refuse(field, f"{has_no} that this could act in")
        for own, other in gives.items() if found else ():
            values = [_of_moving(report, geometry, joint, other) for joint in found]
            if own in element.fields:
                refuse(own, f"give {field} or {own}, not both")
            elif None in values:
                joint = found[values.index(None)]
                what = f"is of type {joint.type}, which has no {other} to be taken for {own}"
                refuse(field, what, remedy=f"leave {field} out, and give {', '.join(gives)}")
                break
            else:
                fields[own] = tuple(values) if own in lists else values[0]
        for name in spec.facts if found else ():
            type_info = known("joint", found[0].type)
            if fact := getattr(type_info and type_info.type, name, ""):
                fields.setdefault(name, fact)
    return attrs.evolve(element, fields=fields) if good else None


def _coordinate(type_info: TypeInfo | None) -> str:
    """What a joint of a type moves by, "angle" or "length"; "" where it does not say."""
    return str(getattr(type_info and type_info.type, "coordinate", ""))


def _of_moving(report: Collector, geometry: Geometry, joint: Element, name: str) -> Any:
    """A field of a joint; of a name without slot that of the body that moves."""
    if not slot_of(name):
        is_held = _field(report, geometry, joint, "body_i") == GROUND
        name = f"{name}_{'j' if is_held else 'i'}"
    return _field(report, geometry, joint, name)


def _field(report: Collector, geometry: Geometry, joint: Element, name: str) -> Any:
    """A field of a joint as written; a body also by a point or vector that is fixed in it."""
    value = joint.fields.get(name)
    if value is None and name in ("P_i", "P_j"):
        named = (report.scene.vectors2.get(v) for v in joint.fields.values() if isinstance(v, str))
        value = next((getattr(vector2, name) for vector2 in named if vector2), None)
    if value is not None or not name.startswith("body_"):
        return value
    slot, names = name[-1], (GROUND, *geometry.bodies.body_names)
    for located in (
        geometry.point(_field(report, geometry, joint, f"P_{slot}")),
        geometry.vector(joint.fields.get(f"a_{slot}")),
    ):
        if located is not None:
            return names[located[0]]
    return None


def brought_forces(
    report: Collector,
    joints: Iterable[Instance],
    known: Callable[[str, Any], TypeInfo | None],
    *,
    left: bool,
) -> dict[str, Element]:
    """The forces that joints bring, by names that hold a dot, as those of a scene do not.

    Args:
        report: takes notes; its scene has the joints as written.
        joints: the joints.
        known: the type of a kind and keyword, if there is one.
        left: they are left out with a note: modes of contacts do not know forces on reactions.
    """
    forces: dict[str, Element] = {}
    for joint in joints:
        brings: tuple[str, ...] = joint.type_info.type.brings  # type: ignore[attr-defined]
        if not brings or not joint.values[brings[0]]:
            continue
        field, keyword, place = brings
        if left:
            report.note(f"joints.{joint.name}.{field} is left out beside contacts: it loads "
                        "bearings, and moves nothing where joints carry it")  # fmt: skip
            continue
        force = known("force", keyword)
        own = specs_of(force.type) if force else {}
        written = report.scene.joints[joint.name].fields
        fields = {name: value for name, value in written.items() if name in own}
        name = f"{joint.name}.{field}"
        forces[name] = Element(name, keyword, fields | {place: joint.name})
    return forces


def read_releases(
    report: Collector, joints: Iterable[Instance], forces: Collection[Instance]
) -> None:
    """Give joints the force at which they break, and what they are active by.

    forces: all of the scene.
    """
    for joint in joints:
        fields = report.scene.joints[joint.name].fields
        if what := _unreleasable(report, joint, forces):
            key = next(key for key in RELEASES if key in fields)
            report.add(("joints", joint.name, key), fields[key], what, remedy=f"leave {key} out")
            continue
        value = fields.get(BREAKS_AT, float("inf"))
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
            what = "should be a positive force in N, inf of a joint that scripts alone release"
            report.add(("joints", joint.name, BREAKS_AT), value, what)
            continue
        joint.breaks_at = float(value)
        if ACTIVE in fields:
            from dap3d_core.scene.expressions.outputs import read_condition

            joint.active = read_condition(report, ("joints", joint.name, ACTIVE), fields[ACTIVE])


def _unreleasable(report: Collector, joint: Instance, forces: Iterable[Instance]) -> str:
    """Why a joint cannot end, "" where it can: what it does besides its rows would go on."""
    type_info = joint.type_info
    own = {"switch", "impulse", "reset"} & set(type_info.kernels)
    if own or type_info.layout.states or type_info.layout.unknowns:
        has = ", ".join(sorted(own)) or "states or unknowns"
        return f"cannot be: a {type_info.type.keyword} has {has} of its own, which go on"
    if limits := report.scene.joints[joint.name].fields.keys() & set(LIMITS):
        return f"cannot be beside {', '.join(sorted(limits))}, which go on"
    for force in forces:
        fields = (force.type_info.friction_joint, *joint_fields(force.type_info.type))
        if any(force.values.get(field) == joint.name for field in fields):
            return f"cannot be: the force {force.name} acts on its reaction"
    return ""
