"""Check of a whole scene: all mistakes are reported at once, with file and line."""

import shlex
from collections.abc import Iterable, Sequence
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import attrs
from packaging.specifiers import InvalidSpecifier, SpecifierSet
from packaging.utils import InvalidName, canonicalize_name
from packaging.version import InvalidVersion

from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import acts_on_all
from dap3d_core.registry import Registry, load_registry
from dap3d_core.scene.errors import MISSING, Key, dotted
from dap3d_core.scene.expressions.outputs import fault_of_quantity
from dap3d_core.scene.scene import Scene
from dap3d_core.scene.tables import LIMITS, NAMED, RELEASES, fault_of_name
from dap3d_core.scene.validate.coerce_values import Fault, number_of, text_of
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import (
    Instance,
    ValidatedScene,
    arguments_of,
    combines,
)

if TYPE_CHECKING:
    from dap3d_core.scene.contacts.tables import CollisionShapes
    from dap3d_core.scene.validate.bodies import Bodies
    from dap3d_core.scene.validate.geometry import Geometry
    from dap3d_core.scene.validate.shapes import Shape
    from dap3d_core.scene.validate.types import Types

#: Any version.
ANY = "*"

#: Most functions in one combination, each counted as often as it occurs: all become one kernel.
MOST_TERMS = 200
#: First words of the quantities that every result has (result/quantities/catalogue.py).
SYSTEM_NAMES = ("t", "energy", "work", "constraint")


def check(scene: Scene, registry: Registry, *, allow_code: bool = False) -> ValidatedScene:
    """Check a scene and return the arrays and instances that the model is built from.

    Args:
        scene: the scene as described.
        registry: the installed types; only those that the scene names are loaded.
        allow_code: allow the scene's own ``plugin.py`` to run; it is run only where a type is not
            installed.

    Raises:
        SceneError: holds all mistakes, each with file, line, key, value, fault, nearest right
            spelling and remedy.
    """
    # numpy is imported here: a command that checks nothing does not wait for it.
    from dap3d_core.scene.validate.bodies import read_bodies
    from dap3d_core.scene.validate.elements import read_elements
    from dap3d_core.scene.validate.geometry import read_geometry
    from dap3d_core.scene.validate.settings import check_header, check_settings, notes_of
    from dap3d_core.scene.validate.types import Types

    scene = scene.resolved()
    report = Collector(scene)
    _check_names(report)
    bodies = read_bodies(report)
    geometry = read_geometry(report, bodies)
    types = Types(report, registry, allow_code=allow_code, to_install=_check_requires(report))
    inputs, functions = _read_signals(report, geometry, types)
    joints = read_elements(report, geometry, "joints", types, functions)
    forces = read_elements(report, geometry, "forces", types, functions)
    _check_together(report, joints, forces)
    contacts = _read_contacts(report, geometry, types, functions, (joints, forces))
    collisions = _check_shapes_and_outputs(report, bodies, joints)
    left = bool(contacts or collisions)
    forces = _acting_forces(report, geometry, types, (joints, forces), left=left)
    check_header(report)
    check_settings(report, scene.simulation, bodies.body_names, ("simulation",))
    report.raise_mistakes()

    types.note_unused_file()
    acting = [*joints, *forces, *contacts]
    _note_loose_bodies(report, bodies, acting)
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


def _check_names(report: Collector) -> None:
    for table in NAMED:
        names = getattr(report.scene, table)
        for name in names:
            if type(name) is str and name.isidentifier() and name.lower() != "ground":
                continue  # nearly all names
            if fault := fault_of_name(name):
                key = (table, str(name))
                report.add(key, name, f"not a name for one of the {table}: {fault}")


def _read_signals(
    report: Collector, geometry: "Geometry", types: "Types"
) -> tuple[dict[str, float], list[Instance]]:
    """Inputs, and functions with those that they combine."""
    from dap3d_core.scene.validate.elements import read_elements

    inputs = {}
    if report.scene.inputs:
        inputs = read_inputs(report)
    functions = read_elements(report, geometry, "functions", types)
    if any(combines(function.type_info) for function in functions):
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


def _read_contacts(
    report: Collector, geometry: "Geometry", types: "Types", functions: list[Instance],
    others: tuple[list[Instance], list[Instance]],
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
    )

    elements = report.scene.contacts | limits_of(report, limited)
    contacts = read_contacts(report, geometry, types, functions, elements) if elements else []
    by_name = {joint.name: joint for joint in joints}
    sticking = read_friction(report, by_name, rubbing)
    return [*contacts, *read_rigid(report, types, rigid), *sticking]


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

    return read_requirements(report)


def _check_shapes_and_outputs(
    report: Collector, bodies: "Bodies", joints: list[Instance]
) -> "CollisionShapes | None":
    """Check shapes and outputs; the shapes that collide, or None."""
    shapes: list[Shape] = []
    if report.scene.shapes:
        from dap3d_core.scene.validate.shapes import read_shapes

        shapes = read_shapes(report, bodies.body_index)
    if report.scene.outputs:
        from dap3d_core.scene.expressions.outputs import read_outputs

        read_outputs(report)
    if report.scene.collisions is None and not any(s.values.get("collides") for s in shapes):
        return None
    from dap3d_core.scene.contacts.read_contacts import read_collisions

    return read_collisions(report, shapes, bodies.body_index, joints)


def _note_loose_bodies(report: Collector, bodies: "Bodies", elements: list[Instance]) -> None:
    """Note bodies without joints and forces."""
    if any(acts_on_all(e.type_info.type) for e in elements):
        return
    used = {body for e in elements for body in e.bodies}
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
        note_unread_inputs(report, elements)


def _report_twins(report: Collector, **tables: Iterable[Instance]) -> None:
    """Equal joints are mistakes; equal forces, or joints with other numbers, are noted."""
    seen: dict[Any, Instance] = {}
    for table, instance in ((table, one) for table, some in tables.items() for one in some):
        references = tuple(
            v for v in instance.values.values() if not isinstance(v, (float, type(None)))
        )
        key = (id(instance.type_info), instance.bodies, references)
        twin = seen.setdefault(key, instance)
        if twin is instance:
            continue
        same = twin.values == instance.values
        if table == "joints" and same:
            what = f"is the same as {twin.name}: same type, same bodies, points and vectors"
            report.add((table, instance.name), MISSING, what, "", "take one of the two out")
        elif table == "joints" or same:
            words = "is the same as" if same else "differs only in its numbers from"
            report.note(f"{table}.{instance.name} {words} {table}.{twin.name}")


def read_requirements(report: Collector) -> str:
    """Check that each distribution is installed, in a version of its range.

    A distribution that lacks, or has another version, is a mistake with the command that installs
    it. Ranges are those of packaging (PEP 440), such as ``">=0.2, <1"``.

    Returns:
        The command that installs all that lack; "" if none does.
    """
    missing = []
    for name, given in report.scene.requires.items():
        key = ("requires", str(name))
        if not _is_name(name):
            what = "not the name of a distribution; it has letters, digits, and - _ . between them"
            report.add(key, given, what)
            continue
        versions = report.read(key, given, _range_of)
        if not isinstance(versions, Fault) and not _is_installed(report, key, name, versions):
            missing.append(_pip(f"{name}{versions}"))
    return f"pip install {' '.join(missing)}" if missing else ""


def _is_installed(report: Collector, key: Key, name: str, versions: SpecifierSet) -> bool:
    """True for a distribution of a version in a range; otherwise a mistake is reported."""
    given, remedy = report.scene.requires[name], f"pip install {_pip(f'{name}{versions}')}"
    try:
        installed = version(name)
    except PackageNotFoundError:
        brought = {s.distribution for each in load_registry().sources.values() for s in each}
        what = f"the distribution {name}, which the scene requires, is not installed"
        report.add(key, given, what, report.nearest(name, brought), remedy)
        return False
    try:
        is_suitable = versions.contains(installed, prereleases=True)
    except InvalidVersion:
        is_suitable = not versions
    if not is_suitable:
        what = f"{name} {installed} is installed, which is not of this range"
        report.add(key, given, what, remedy=remedy)
    return is_suitable


def _range_of(value: Any) -> Any:
    """The range of versions, or the fault."""
    text = text_of(value)
    if isinstance(text, Fault):
        return text
    try:
        return SpecifierSet("" if text.strip() == ANY else text)
    except InvalidSpecifier:
        return Fault('should be a range of versions, such as ">=0.2, <1", or "*" for any')


def _is_name(name: Any) -> bool:
    try:
        canonicalize_name(name, validate=True)
    except (InvalidName, TypeError):
        return False
    return True


def _pip(words: str) -> str:
    """A requirement in a command of a shell."""
    quoted = shlex.quote(words)
    return f'"{words}"' if quoted != words else words


def combine_functions(report: Collector, functions: list[Instance]) -> list[Instance]:
    """The functions with those that they combine; mistakes are reported.

    Args:
        report: takes mistakes: a function that names itself, one of two arguments, or too many
            terms.
        functions: without mistakes of their own, in file order.
    """
    known = {function.name: function for function in functions}
    arguments = arguments_of(functions)
    for function in functions:
        if of_two := [name for name in _terms(function) if arguments.get(name, 1) > 1]:
            what = f"combines functions of one argument; {of_two[0]} takes two"
            report.add(("functions", function.name), list(_terms(function)), what)
            return functions
    uses = {name: _terms(function) for name, function in known.items()}
    try:
        order = list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        cycle = error.args[1][::-1]  # each names the next
        what = f"functions combine one another in a circle: {' -> '.join(cycle)}"
        report.add(("functions", cycle[0]), list(uses[cycle[0]]), what)
        return functions
    sizes: dict[str, int] = {}
    for name in order:
        if name not in known or not set(uses[name]) <= sizes.keys():
            continue  # one of them has a mistake, which is reported
        sizes[name] = sum(sizes[term] for term in uses[name]) or 1
        if sizes[name] > MOST_TERMS:
            what = f"combines {sizes[name]} functions, counted as often as they occur"
            report.add(("functions", name), list(uses[name]), what, "", f"at most {MOST_TERMS}")
            return functions
        known[name] = attrs.evolve(known[name], terms=tuple(known[term] for term in uses[name]))
    return list(known.values())


def _terms(function: Instance) -> tuple[str, ...]:
    """Names of the functions that a function combines, in the order of its fields."""
    specs = specs_of(function.type_info.type)
    return tuple(
        name for field, spec in specs.items() if spec.kind == "functions"
        for name in function.values[field]
    )  # fmt: skip


def read_inputs(report: Collector) -> dict[str, float]:
    """The values of the inputs at the start of a run, by name; mistakes are reported."""
    inputs = {}
    for name, entry in report.scene.inputs.items():
        fault = fault_of_quantity(report.scene, name, but="inputs")
        if not fault and name in SYSTEM_NAMES:
            fault = "every result has a quantity of this name"
        if fault:
            report.add(("inputs", str(name)), name, f"not a name for an input: {fault}")
        inputs[name] = report.read(("inputs", str(name), "value"), entry.value, number_of)
    return inputs


def note_unread_inputs(report: Collector, elements: Sequence[Instance]) -> None:
    """Note inputs that no joint and no force reads."""
    behind = 1 + len(report.scene.functions)
    read = {index - behind for e in elements for index in e.functions}
    named = {name for e in elements if e.active for name in e.active.names}
    for index, name in enumerate(report.scene.inputs):
        if index not in read and name not in named:
            key = dotted(("inputs", name))
            report.note(f"{key}: no joint and no force reads it", "inputs left unread")
