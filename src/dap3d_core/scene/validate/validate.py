"""The check of a whole scene: every mistake is found and reported at once, with file and line."""

from typing import TYPE_CHECKING

from dap3d_core.registry import Registry
from dap3d_core.scene.errors import dotted
from dap3d_core.scene.scene import NAMED, Scene, fault_of_name
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Checked, Instance

if TYPE_CHECKING:
    from dap3d_core.scene.validate.bodies import Bodies


def check(scene: Scene, registry: Registry, *, allow_code: bool = False) -> Checked:
    """Check a scene and return what the model is made from.

    Args:
        scene: what the user described.
        registry: the installed types; only those that the scene names are loaded.
        allow_code: whether the ``plugin.py`` beside the scene may be run. It is run only where a
            type is not installed.

    Raises:
        SceneError: holds all mistakes, each with file, line, key, value, what is wrong, the nearest
            right spelling and a remedy.
    """
    # numpy is imported here: a command that checks nothing does not wait for it.
    from dap3d_core.scene.validate.bodies import read_bodies
    from dap3d_core.scene.validate.elements import read_elements, report_twins
    from dap3d_core.scene.validate.geometry import read_geometry
    from dap3d_core.scene.validate.settings import header_mistakes, notes_of, simulation_mistakes
    from dap3d_core.scene.validate.types import Types

    report = Collector(scene)
    _check_names(report)
    bodies = read_bodies(report)
    geometry = read_geometry(report, bodies)
    types = Types(report, registry, allow_code=allow_code)
    functions = read_elements(report, geometry, "functions", types.of("functions"))
    joints = read_elements(report, geometry, "joints", types.of("joints"))
    forces = read_elements(report, geometry, "forces", types.of("forces"))
    report_twins(report, "joints", joints)
    report_twins(report, "forces", forces)
    _check_shapes(report, bodies)
    report.extend(header_mistakes(scene))
    report.extend(simulation_mistakes(scene.simulation, bodies.names, ("simulation",)))
    report.raise_mistakes()

    types.note_unused_file()
    _note_loose_bodies(report, bodies, [*joints, *forces])
    _note_unused_functions(report, [*joints, *forces])
    notes = [*report.notes(), *notes_of(scene.simulation), *types.registry.notes]
    return Checked(
        scene=scene,
        registry=types.registry,
        body_names=bodies.names,
        body_index=bodies.index,
        mass=bodies.mass,
        Jp=bodies.Jp,
        r=bodies.r,
        p=bodies.p,
        r_dot=bodies.r_dot,
        w=bodies.w,
        point_names=geometry.point_names,
        point_body=geometry.point_body,
        point_local=geometry.point_local,
        animation_count=geometry.animation_count,
        joints=joints,
        forces=forces,
        functions=functions,
        notes=notes,
    )


def _check_names(report: Collector) -> None:
    for table in NAMED:
        names = getattr(report.scene, table)
        for name in names:
            if type(name) is str and name.isidentifier() and name.lower() != "ground":
                continue  # what nearly all names are
            if fault := fault_of_name(name):
                key = (table, str(name))
                report.add(key, name, f"not a name for one of the {table}: {fault}")


def _check_shapes(report: Collector, bodies: "Bodies") -> None:
    if report.scene.shapes:
        from dap3d_core.scene.validate.shapes import read_shapes

        read_shapes(report, bodies.index)


def _note_loose_bodies(report: Collector, bodies: "Bodies", elements: list[Instance]) -> None:
    """Bodies that nothing holds or pushes: allowed, and worth a word."""
    used = {body for e in elements for body in e.bodies}
    if any(getattr(e.examined.type, "each_body", False) for e in elements):
        return
    loose = [name for k, name in enumerate(bodies.names, 1) if k not in used]
    for name in loose:
        report.note(f"bodies.{name}: no joint and no force acts on it", "bodies left alone")


def _note_unused_functions(report: Collector, elements: list[Instance]) -> None:
    used = {place for e in elements for place in e.functions}
    called = {e.values[field] for e in elements for field in e.examined.argument_functions}
    for place, name in enumerate(report.scene.functions, 1):
        if place not in used and name not in called:
            key = dotted(("functions", name))
            report.note(f"{key}: no joint and no force uses it", "functions left unused")
