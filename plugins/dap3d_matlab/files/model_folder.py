"""Reads the files of a MATLAB model into arrays of structures."""

from pathlib import Path
from typing import Any

import attrs

from dap3d_core.interface.formats import Place
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.scene.errors import file_error
from dap3d_matlab.files.report import FileFacts, Remark, remark
from dap3d_matlab.language.interpreter import Workspace, follow
from dap3d_matlab.language.parse import Grammar, SourceFile, m_files, read_source, syntax_mistakes
from dap3d_matlab.language.structures import (
    DISKS,
    FILES,
    LIMITS,
    REQUIRED_FILE,
    USER_FORCE_FILE,
    ModelFile,
)
from dap3d_matlab.language.values import Broken, Struct, as_array, kind_of

#: Number of other files that are listed by name.
OTHERS = 50
JOINTS_FILE, ANIMATION_FILE = "inJoints.m", "inAnimate.m"


@attrs.define
class Model:
    """Content of the files of a folder.

    Attributes:
        folder: of the model.
        arrays: structures by the first name of their array; None where a mistake was reported.
        absent: names of arrays without a file.
        limits: limits of the drawing by name, with their places.
        user_force: the file of the user's force, or None.
        mistakes: mistakes in the files.
        files, unused: as in the report.
    """

    folder: Path
    arrays: dict[str, list[Struct] | None] = attrs.field(factory=dict)
    absent: set[str] = attrs.field(factory=set)
    limits: dict[str, tuple[Any, Place]] = attrs.field(factory=dict)
    user_force: SourceFile | None = None
    mistakes: list[Mistake] = attrs.field(factory=list)
    files: list[FileFacts] = attrs.field(factory=list)
    unused: list[Remark] = attrs.field(factory=list)


def read_folder(folder: Path) -> Model:
    """Read the files of a model; ``Model.mistakes`` collects the mistakes in them.

    Raises:
        SceneError: there is no such folder, it holds no model, or the grammar is not installed.
    """
    names = m_files(folder)
    if not any(f.name in names for f in FILES):
        what = f"holds no MATLAB model: there is no {REQUIRED_FILE}"
        remedy = f"it holds {', '.join(names[:5])}" if names else "it holds no .m file"
        raise file_error(folder, what, remedy=remedy)
    model = Model(folder)
    grammar = Grammar()
    for file in FILES:
        if file.name not in names:
            _absent(model, file, names)
            continue
        workspace = _workspace(model, folder / file.name, grammar)
        model.arrays[file.arrays[0]] = _array(model, file, workspace)
        if workspace is not None:
            _further_variables(model, file, workspace)
    if USER_FORCE_FILE in names:
        try:
            model.user_force = read_source(folder / USER_FORCE_FILE)
        except SceneError as error:
            model.mistakes += error.mistakes
        model.files.append(FileFacts(USER_FORCE_FILE, "shown", "a force of your own"))
    _others(model, names)
    return model


def _absent(model: Model, file: ModelFile, names: list[str]) -> None:
    """Record a missing file: an empty array, or a misspelt name."""
    model.arrays[file.arrays[0]], nothing = [], f"no {_plural(file.noun)}"
    model.absent.add(file.arrays[0])
    known = {f.name for f in FILES}
    others = [n for n in names if n not in known and n != USER_FORCE_FILE]
    near = nearest(file.name, [n for n in others if n.lower().startswith("in")])
    if near:
        what = f"is no file of a model; {file.name} is one, and is not there"
        path = str(model.folder / near)
        model.mistakes.append(
            Mistake("", MISSING, what, "", f"rename it to {file.name}", file=path)
        )
        model.arrays[file.arrays[0]] = None
    elif file.name == REQUIRED_FILE:
        what = f"there is no {REQUIRED_FILE}, which every model needs"
        model.mistakes.append(Mistake("", MISSING, what, file=str(model.folder)))
        model.arrays[file.arrays[0]] = None
    model.files.append(FileFacts(file.name, "absent", nothing))


def _workspace(model: Model, path: Path, grammar: Grammar) -> Workspace | None:
    """The variables of a file; None where it cannot be read."""
    try:
        source = read_source(path)
        root = grammar.tree(source)
    except SceneError as error:
        model.mistakes += error.mistakes
        return None
    faults = syntax_mistakes(source, root)
    if faults:
        model.mistakes += faults
        return None
    workspace = follow(source, root)
    model.mistakes += workspace.mistakes
    return workspace


def _array(model: Model, file: ModelFile, workspace: Workspace | None) -> list[Struct] | None:
    """The array of a file; None where a mistake is reported."""
    if workspace is None:
        model.files.append(FileFacts(file.name, "not read", "mistakes"))
        return None
    path = str(model.folder / file.name)
    names = [n for n in file.arrays if n in workspace.variables]
    if len(names) != 1:
        wanted = " or ".join(file.arrays)
        what = f"does not make the array {wanted}"
        if names:
            what = f"makes both {' and '.join(names)}; one of them is the array"
        remedy = f"end it with {file.arrays[0]} = [...]; ({file.arrays[0]} = []; where it is empty)"
        model.mistakes.append(Mistake("", MISSING, what, "", remedy, file=path))
        model.files.append(FileFacts(file.name, "not read", "mistakes"))
        return None
    array = _structs(model, names[0], file.kind, workspace, path)
    if array is not None:
        _report_unused(model, array, file.kind, names[0], workspace)
    holds = "mistakes" if array is None else _count(len(array), file.noun)
    model.files.append(FileFacts(file.name, "not read" if array is None else "read", holds))
    return array


def _structs(
    model: Model, name: str, kind: str, workspace: Workspace, path: str
) -> list[Struct] | None:
    """The structures in a variable; None where it holds anything else, which is reported."""
    value = as_array(workspace.variables[name])
    line = workspace.places[name].line if name in workspace.places else None
    if isinstance(value, Broken) or (
        isinstance(value, list) and any(isinstance(v, Broken) for v in value)
    ):
        return None
    if not isinstance(value, list) or {v.structure.kind for v in value} - {kind}:
        holds = kind_of(value)
        if isinstance(value, list):
            holds = f"an array of {value[0].structure.kind}_struct"
        what = f"should be an array of {kind}_struct, not {holds}"
        model.mistakes.append(Mistake(name, MISSING, what, file=path, line=line))
        return None
    return list(value)


def _report_unused(
    model: Model, array: list[Struct], kind: str, name: str, workspace: Workspace
) -> None:
    """Report structures that are not in the array, or were changed after it was made."""
    members = {v.variable: v for v in array}
    for variable, value in workspace.variables.items():
        if not isinstance(value, Struct) or value.structure.kind != kind or variable == name:
            continue
        if variable not in members:
            if value.given:
                model.unused.append(remark(value.place, f"{variable} is not in {name}: left out"))
        elif members[variable].given != value.given:
            words = f"{variable} was changed after {name} was made: without effect, as in MATLAB"
            model.unused.append(remark(value.place, words))


def _further_variables(model: Model, file: ModelFile, workspace: Workspace) -> None:
    """Read the disks of the joints file, and the limits of the drawing of the animation file."""
    if file.name == JOINTS_FILE and DISKS in workspace.variables:
        path = str(model.folder / file.name)
        model.arrays[DISKS] = _structs(model, DISKS, "Disk", workspace, path)
    if file.name == ANIMATION_FILE:
        for name in (n for pair in LIMITS for n in pair):
            if name in workspace.variables:
                place = workspace.places.get(name, Place(str(model.folder / file.name)))
                model.limits[name] = (workspace.variables[name], place)


def _others(model: Model, names: list[str]) -> None:
    known = {f.name for f in FILES} | {USER_FORCE_FILE}
    others = [name for name in names if name not in known]
    for name in others[:OTHERS]:
        model.files.append(FileFacts(name, "not read", "no file of a model"))
    if len(others) > OTHERS:
        more = f"{len(others) - OTHERS} more"
        model.files.append(FileFacts(more, "not read", "no files of a model"))


def _plural(noun: str) -> str:
    plurals = {"body": "bodies", "vector of type 2": "vectors of type 2"}
    return plurals.get(noun, f"{noun}s")


def _count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun if number == 1 else _plural(noun)}"
