"""Check of a whole scene: all mistakes are reported at once, with file and line."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import attrs

from dap3d_core.interface.types import acts_on_all
from dap3d_core.registry import Registry
from dap3d_core.scene.contacts.tables import Materials
from dap3d_core.scene.errors import MISSING, dotted
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import LIMITS, NAMED, RELEASES, fault_of_name
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Bodies, Instance, ValidatedScene, combines

if TYPE_CHECKING:
    from dap3d_core.scene.contacts.collision_shapes import CollisionShapes
    from dap3d_core.scene.validate.geometry import Geometry
    from dap3d_core.scene.validate.shapes import Shape
    from dap3d_core.scene.validate.types import Types


def check(scene: Scene, registry: Registry, *, allow_code: bool = False) -> ValidatedScene:
    """Check a scene and return the arrays and instances that the model is built from.

    Args:
        scene: the scene as described.
        registry: the installed types; only those that the scene names are loaded.
        allow_code: allow the scene's own ``plugin.py`` to run; it is run only where a type is not
            installed.

    Raises:
        SceneError: all mistakes, located, with the nearest right spelling and the remedy.
    """
    # numpy is imported here: a command that checks nothing does not wait for it.
    from dap3d_core.scene.validate.bodies import read_bodies
    from dap3d_core.scene.validate.elements import read_elements
    from dap3d_core.scene.validate.geometry import read_geometry
    from dap3d_core.scene.validate.settings import check_header, check_settings, notes_of
    from dap3d_core.scene.validate.types import Types

    scene = scene.copy() if scene.parameters else scene
    report = _collector(scene)
    _check_names(report)
    bodies = read_bodies(report)
    geometry = read_geometry(report, bodies)
    types = Types(report, registry, allow_code=allow_code, to_install=_check_requires(report))
    inputs, functions = _read_signals(report, geometry, types)
    joints = read_elements(report, geometry, "joints", types, functions)
    forces = read_elements(report, geometry, "forces", types, functions)
    _check_together(report, joints, forces)
    materials, others = _read_materials(report), (joints, forces)
    contacts = _read_contacts(report, bodies, geometry, types, functions, others, materials)
    collisions = _check_shapes_and_outputs(report, bodies, joints, materials)
    forces = _acting_forces(report, geometry, types, others, left=bool(contacts or collisions))
    check_header(report)
    check_settings(report, scene.simulation, bodies.body_names, ("simulation",))
    report.raise_mistakes()

    types.note_unused_file()
    acting = [*joints, *forces, *contacts]
    _note_loose_bodies(report, bodies, acting, collisions)
    _note_unused_signals(report, acting, functions)
    notes = [*report.notes(), *notes_of(scene.simulation), *types.registry.notes]
    return ValidatedScene(
        scene=scene,
        registry=types.registry,
        **attrs.asdict(bodies, recurse=False),
        point_names=geometry.point_names,
        point_body=geometry.point_body,
        point_local=geometry.point_local,
        animation_count=geometry.animation_count,
        joints=joints,
        contacts=contacts,
        collisions=collisions,
        forces=forces,
        functions=functions,
        inputs=inputs,
        notes=notes,
    )


def _collector(scene: Scene) -> Collector:
    """The collector of a scene, in which numbers are put in place of expressions of parameters."""
    report = Collector(scene)
    if scene.parameters:
        from dap3d_core.scene.expressions.parameters import put_numbers

        put_numbers(report)
    return report


def _check_names(report: Collector) -> None:
    for table in NAMED:
        for name in getattr(report.scene, table):
            if type(name) is str and name.isidentifier() and name.lower() != "ground":
                continue  # nearly all names
            if fault := fault_of_name(name):
                report.add((table, str(name)), name, f"not a name for one of the {table}: {fault}")


def _read_signals(
    report: Collector, geometry: "Geometry", types: "Types"
) -> tuple[dict[str, float], list[Instance]]:
    """Inputs, and functions with those that they combine."""
    from dap3d_core.scene.validate.elements import read_elements

    inputs = {}
    if report.scene.inputs:
        from dap3d_core.scene.signals import read_inputs

        inputs = read_inputs(report)
    functions = read_elements(report, geometry, "functions", types)
    if any(combines(function.type_info) for function in functions):
        from dap3d_core.scene.signals import combine_functions

        functions = combine_functions(report, functions)
    return inputs, functions


def _acting_forces(
    report: Collector, geometry: "Geometry", types: "Types",
    others: tuple[list[Instance], list[Instance]], *, left: bool,
) -> list[Instance]:  # fmt: skip
    """Forces that are no contacts, and those that joints bring; others: joints and forces.

    left: those that joints bring are left out, with a note, beside contacts.
    """
    joints, forces = others
    forces = [force for force in forces
              if not (force.type_info.type.is_contact or _sticks(force, joints))]  # fmt: skip
    if not any(joint.type_info.type.brings for joint in joints):  # type: ignore[attr-defined]
        return forces
    from dap3d_core.scene.validate.elements import read_elements
    from dap3d_core.scene.validate.joint_fields import brought_forces

    if brought := brought_forces(report, joints, types.known, left=left):
        forces += read_elements(report, geometry, "forces", types, elements=brought)
    return forces


def _read_materials(report: Collector) -> Materials:
    """The materials of a scene, those as well that nothing uses."""
    if not report.scene.materials:
        return Materials()
    from dap3d_core.scene.contacts.read_contacts import read_materials

    return read_materials(report)


def _read_contacts(
    report: Collector, bodies: Bodies, geometry: "Geometry", types: "Types",
    functions: list[Instance], others: tuple[list[Instance], list[Instance]], materials: Materials,
) -> list[Instance]:  # fmt: skip
    """Contacts, limits of joints, and stops that are rigid; others: joints and forces."""
    joints, forces = others
    limited = [j for j in joints if j.type_info.type.limit]  # type: ignore[attr-defined]
    limited = [
        j for j in limited if any(key in report.scene.joints[j.name].fields for key in LIMITS)
    ]
    rigid = [force for force in forces if force.type_info.type.is_contact]
    rubbing = [force for force in forces if _sticks(force, joints)]
    if not (report.scene.contacts or limited or rigid or rubbing):
        return []
    from dap3d_core.scene.contacts.read_contacts import (
        limits_of,
        read_contacts,
        read_friction,
        read_rigid,
        with_unit_mass,
    )

    elements = report.scene.contacts | limits_of(report, limited)
    contacts = (
        read_contacts(report, geometry, types, functions, elements, materials) if elements else []
    )
    sticking = read_friction(report, {joint.name: joint for joint in joints}, rubbing)
    contacts += [*read_rigid(report, types, rigid), *sticking]
    return with_unit_mass(contacts, bodies.mass)


def _sticks(force: Instance, joints: list[Instance]) -> bool:
    """True of friction of a joint that sticks: no velocity is given below which it fades."""
    field = force.type_info.friction_joint
    if not field or force.values.get("v_tol") is not None:
        return False
    joint = next((j for j in joints if j.name == force.values.get(field)), None)
    return joint is not None and bool(joint.type_info.type.grips)  # type: ignore[attr-defined]


def _check_together(report: Collector, joints: list[Instance], forces: list[Instance]) -> None:
    """Report twins; read when joints end and hold, where a scene has any that do not throughout."""
    _report_twins(report, joints=joints, forces=forces)
    ending = [j for j in joints if report.scene.joints[j.name].fields.keys() & set(RELEASES)]
    if ending:
        from dap3d_core.scene.validate.joint_fields import read_releases

        read_releases(report, ending, forces)


def _check_requires(report: Collector) -> str:
    """Check the distributions that the scene requires; the command that installs what lacks."""
    if not report.scene.requires:
        return ""
    from dap3d_core.scene.requirements import read_requirements

    return read_requirements(report)


def _check_shapes_and_outputs(
    report: Collector, bodies: Bodies, joints: list[Instance], materials: Materials
) -> "CollisionShapes | None":
    """Check shapes and outputs; the shapes that collide, or None."""
    shapes: list[Shape] = []
    if report.scene.shapes:
        from dap3d_core.scene.validate.shapes import read_shapes

        shapes = read_shapes(report, bodies.body_index)
    if report.scene.outputs:
        from dap3d_core.scene.expressions.outputs import read_outputs, report_unknown

        outputs = read_outputs(report)
        if report.mistakes or report.scene.faults:  # else the model says what there is
            report_unknown(report, outputs)
    if report.scene.collisions is None and not any(s.values.get("collides") for s in shapes):
        return None
    from dap3d_core.scene.contacts.read_contacts import read_collisions

    return read_collisions(report, shapes, bodies.body_index, joints, materials)


def _note_loose_bodies(
    report: Collector, bodies: Bodies, elements: list[Instance],
    collisions: "CollisionShapes | None",
) -> None:  # fmt: skip
    """Note bodies without joints and forces, which meet no others."""
    if any(acts_on_all(e.type_info.type) for e in elements):
        return
    used = {body for e in elements for body in e.bodies}
    used |= set(collisions.body.tolist()) if collisions else set()
    for k, name in enumerate(bodies.body_names, 1):
        if k not in used:
            report.note(f"bodies.{name}: no joint and no force acts on it", "bodies left alone")


def _note_unused_signals(
    report: Collector, elements: list[Instance], functions: list[Instance]
) -> None:
    used = {index for e in elements for index in e.functions}
    called = {e.values[field] for e in elements for field in e.type_info.argument_functions}
    called |= {term.name for function in functions for term in function.terms}
    for index, name in enumerate(report.scene.functions, 1):
        if index not in used and name not in called:
            key = dotted(("functions", name))
            report.note(f"{key}: no joint and no force uses it", "functions left unused")
    if report.scene.inputs:
        from dap3d_core.scene.signals import note_unread_inputs

        note_unread_inputs(report, elements)


def _report_twins(report: Collector, **tables: Iterable[Instance]) -> None:
    """Equal joints are mistakes; equal forces, or joints with other numbers, are noted."""
    seen: dict[Any, Instance] = {}
    for table, instance in ((table, one) for table, some in tables.items() for one in some):
        references = tuple(
            v for v in instance.values.values() if not isinstance(v, (float, type(None)))
        )
        twin = seen.setdefault((id(instance.type_info), instance.bodies, references), instance)
        if twin is instance:
            continue
        same = twin.values == instance.values
        if table == "joints" and same:
            what = f"is the same as {twin.name}: same type, same bodies, points and vectors"
            report.add((table, instance.name), MISSING, what, "", "take one of the two out")
        elif table == "joints" or same:
            words = "is the same as" if same else "differs only in its numbers from"
            report.note(f"{table}.{instance.name} {words} {table}.{twin.name}")
