"""The importer of models of the MATLAB program DAP3D."""

import re
from pathlib import Path

import attrs

from dap3d_core.interface.formats import FolderImporter, Place
from dap3d_core.registry import Registry
from dap3d_core.scene import Mistake, Scene, SceneError, check
from dap3d_matlab.files.model_folder import Model, read_folder
from dap3d_matlab.files.report import ImportReport, remark
from dap3d_matlab.translate.bodies import add_animation, add_bodies, add_geometry
from dap3d_matlab.translate.elements import add_forces, add_functions, add_joints
from dap3d_matlab.translate.fields import NAMES, Fields, name_of
from dap3d_matlab.translate.user_force import KEYWORD, add_user_forces

#: Note of the check on bodies that only a user's force may act on.
_LEFT_ALONE = "no joint and no force acts on it"


class MatlabImporter(FolderImporter):
    """A folder with inBodies.m and the other files of a model."""

    keyword, title, marker = "matlab", "MATLAB", "inBodies.m"

    def read_folder(self, folder: Path, registry: Registry) -> tuple[Scene, ImportReport]:
        """Read a model of the MATLAB program DAP3D; no code of it is run.

        Args:
            folder: with inBodies.m and the other files of a model (manual, "Describing A Model").
            registry: the installed types.

        Returns:
            The scene, checked but for the user's force, and a report of what was read, defaulted,
            changed and left out.

        Raises:
            SceneError: holds every mistake, with file and line; or the packages of the extra
                "matlab" are not installed.
        """
        scene, fields = translate(folder)
        if fields.model.mistakes:
            raise SceneError(_in_order(fields.model.mistakes))
        _check(scene, fields, registry)
        return scene, fields.report


def translate(path: Path) -> tuple[Scene, Fields]:
    """The scene of a folder before its check, and the reader with report and mistakes.

    Raises:
        SceneError: there is no model to read.
    """
    model = read_folder(path)
    report = ImportReport(str(path), files=model.files, unused=model.unused)
    fields = Fields(model, report)
    name = path.resolve().name
    scene = Scene(name=name, description=f"From the MATLAB model {name} of DAP3D.")
    add_bodies(scene, fields)
    add_geometry(scene, fields)
    add_functions(scene, fields)
    add_joints(scene, fields)
    add_forces(scene, fields)
    add_user_forces(scene, fields)
    add_animation(scene, fields)
    _report_names(model, report)
    return scene, fields


def _report_names(model: Model, report: ImportReport) -> None:
    """Report names, given by the index in the array, and variables with another number."""
    for array in NAMES:
        for k, struct in enumerate(model.arrays.get(array) or [], 1):
            name = name_of(array, k)
            report.names[name] = f"{array}({k}) ({struct.variable})"
            number = re.search(r"\d+$", struct.variable)
            if number and int(number[0]) != k:
                text = f"{struct.variable} is number {k} of {array}: {name} in the scene"
                report.changed.append(remark(struct.place, text))


def _in_order(mistakes: list[Mistake]) -> list[Mistake]:
    """Mistakes by file, in the order of reading, and by line."""
    files = {m.file: place for place, m in reversed(list(enumerate(mistakes)))}
    return sorted(mistakes, key=lambda m: (files[m.file], m.line or 0))


def _check(scene: Scene, fields: Fields, registry: Registry) -> None:
    """Check the scene but for the user's forces, which have no type yet."""
    forces = {n: f for n, f in scene.forces.items() if f.type != KEYWORD}
    try:
        checked = check(attrs.evolve(scene, forces=forces), registry)
    except SceneError as error:
        raise SceneError(_in_order([_relocated(m, fields) for m in error.mistakes])) from None
    has_own = len(forces) < len(scene.forces)
    fields.report.notes += [n for n in checked.notes if not (has_own and _LEFT_ALONE in n)]


def _relocated(mistake: Mistake, fields: Fields) -> Mistake:
    """A mistake of the scene, located in its MATLAB file."""
    key = mistake.key
    while key and key not in fields.places:
        key = key.rpartition(".")[0]
    place = fields.places.get(key, Place(fields.report.folder))
    return attrs.evolve(mistake, file=place.file, line=place.line)
