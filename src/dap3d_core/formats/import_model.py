"""``import_model``: the scene of a model of another program."""

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.formats.import_scene.scene_builder import Names
from dap3d_core.formats.import_scene.scene_of_model import ImportOptions, scene_of
from dap3d_core.formats.import_scene.shapes import MeshFiles
from dap3d_core.formats.import_scene.source_files import SourceFiles
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.formats import Articulation, FolderImporter, FormatError, Importer, Remark
from dap3d_core.interface.formats.articulation import KINDS
from dap3d_core.registry import Registry, load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.extensions import extensions
from dap3d_core.registry.suggestions import did_you_mean, some
from dap3d_core.scene import Scene, SceneError, check
from dap3d_core.scene.errors import MISSING, Mistake

#: Endings of files that a message names where a folder is given.
SUFFIXES = (".urdf", ".xacro", ".sdf", ".xml", ".mjcf")


@attrs.frozen
class ImportReport:
    """The report of an import.

    Attributes:
        file: the file.
        format: the importer's keyword.
        taken: number of links, joints, couplings and actuators in the file.
        translated: contents that the scene says in another way, with the difference.
        left_out: contents without a counterpart.
        notes: notes of the check of the scene.
        meshes: mesh file -> its name in the scene, below the scene's folder.
    """

    file: str
    format: str
    taken: dict[str, int]
    translated: tuple[Remark, ...]
    left_out: tuple[Remark, ...]
    notes: tuple[str, ...]
    meshes: dict[Path, str]

    def save(self, scene: Scene, folder: str | os.PathLike[str], force: bool = False) -> Path:
        """Write the scene into a folder, with its meshes below; returns the scene file.

        Args:
            scene: the scene.
            folder: the folder; it is made where there is none.
            force: True to overwrite an existing scene file.

        Raises:
            SceneError: the scene cannot be written, or exists and ``force`` is off.
            OSError: a mesh cannot be copied.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        saved = scene.save(target, force)
        for source, name in self.meshes.items():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target / name)
        return saved


@checked
def import_model(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    packages: Mapping[str, str | os.PathLike[str]] | None = None,
    root: str | os.PathLike[str] | None = None,
    free_base: bool = False,
    keep_fixed: bool = False,
    balance_inertia: bool = False,
    limits: str = "soft",
    contacts: bool = False,
    shapes: bool = True,
    strict: bool = False,
    allow_code: bool = False,
    arguments: Mapping[str, Any] | None = None,
    key: str | None = None,
    positions: Mapping[str, float | Sequence[float]] | None = None,
    rates: Mapping[str, float | Sequence[float]] | None = None,
    registry: Registry | None = None,
) -> tuple[Scene, Any]:
    """The scene of a model of another program: URDF, SDF, MJCF, or a format of a plugin.

    Args:
        path: the file; or a folder, where the format is one of folders.
        format: keyword of an importer; by default that of the file.
        packages: name of a package, in ``package://NAME/...``, -> its folder.
        root: the folder that files which the model names must lie in; by default that of the file.
        free_base: links without a joint to a parent are free, where the format leaves it open.
        keep_fixed: fixed joints between moving links stay joints.
        balance_inertia: their mean replaces principal moments that no body has, not the nearest.
        limits: of joints: "soft", critically damped springs; "hard", where a rate ends; "off".
        contacts: shapes that meet others in the file do, by time stepping; else none does.
        shapes: links have their shapes; without, files of meshes are not looked for.
        strict: refuse a model of which something would be left out.
        allow_code, arguments: evaluate the expressions of a xacro file; its arguments by name.
        key: name of the keyframe of MJCF that it starts at, with its controls.
        positions, rates: of joints at the start, by name, as the file counts; coupled ones follow.
        registry: the installed types; by default all.

    Returns:
        The scene and a report: an ``ImportReport``, or for a folder that of its importer.

    Raises:
        SceneError: it cannot be imported; with its line.
    """
    file = _path(path)
    if (folders := _folder_importer(file, format)) is not None:
        given = (packages, root, free_base, keep_fixed, balance_inertia, arguments, key, positions)
        return _read_folder(folders, file, registry, strict=strict, given=any((*given, rates)))
    try:
        options = ImportOptions(free_base, keep_fixed, balance_inertia, limits, contacts=contacts)
        model, source, keyword = read_articulation(
            file, format=format, packages=packages, root=root, allow_code=allow_code, shapes=shapes,
            contacts=contacts, arguments=arguments, key=key)  # fmt: skip
        options.positions.update(_coordinates(positions, model, positions=True))
        options.rates.update(_coordinates(rates, model, positions=False))
        return _checked_scene(model, source, keyword, options, registry, strict)
    except FormatError as error:
        raise _refusal(error, file) from None


def _checked_scene(
    model: Articulation, source: SourceFiles, keyword: str, options: ImportOptions,
    registry: Registry | None, strict: bool,
) -> tuple[Scene, ImportReport]:  # fmt: skip
    """The scene of a model, and the report.

    Raises:
        FormatError: the model is no mechanism.
        SceneError: the scene is invalid, or something is left out and ``strict``; with lines.
    """
    names, meshes = Names(), MeshFiles()
    scene = scene_of(model, source.remarks, options, meshes=meshes, names=names)
    scene.description = f"From {source.path.name}."
    try:
        checked = check(scene, load_registry() if registry is None else registry)
    except SceneError as error:
        raise SceneError(_relocated(m, names, source.path) for m in error.mistakes) from None
    _refuse_omissions(source.remarks.left_out, strict)
    parts = ("links", "joints", "couplings", "actuators")
    return scene, ImportReport(
        str(source.path), keyword, {part: len(getattr(model, part)) for part in parts},
        source.remarks.translated, source.remarks.left_out, tuple(checked.notes),
        {path: name for (path, _), name in meshes.names.items()},
    )  # fmt: skip


def _path(path: Any) -> Path:
    """The path of a file."""
    try:
        return Path(os.fsdecode(path))
    except TypeError:
        raise _refusal(FormatError(f"a model is a file, not {path!r}")) from None


@checked
def import_matlab(
    folder: str | os.PathLike[str], registry: Registry | None = None
) -> tuple[Scene, Any]:
    """Read a model of the MATLAB program DAP3D; no code of it is run.

    Args:
        folder: with inBodies.m and the other files of a model (manual, "Describing A Model").
        registry: the installed types; by default all.

    Returns:
        The scene, checked but for the user's force, and a report of what was read, defaulted,
        changed and left out.

    Raises:
        SceneError: holds every mistake, with file and line; or the packages of the extra "matlab"
            are not installed.
    """
    return _read_folder(extensions("importer").load("matlab")(), _path(folder), registry)


def _read_folder(
    importer: FolderImporter, folder: Path, registry: Registry | None, *, strict: bool = False,
    given: bool = False,
) -> tuple[Scene, Any]:  # fmt: skip
    """The scene of a folder, and the report of its importer."""
    if given:
        what = f"a {importer.title} model takes no options of packages, links, joints and macros"
        raise _refusal(FormatError(what, remedy="leave them out"), folder)
    scene, report = importer.read_folder(folder, load_registry() if registry is None else registry)
    _refuse_omissions(report.unused, strict)
    return scene, report


def _folder_importer(folder: Path, wanted: str | None) -> FolderImporter | None:
    """The importer of a folder, as wanted or by a file in it; None where it is one of files."""
    if wanted is None and not os.path.isdir(folder):
        return None
    formats = extensions("importer")
    for keyword in formats.first if wanted is None else [wanted]:
        try:
            importer = formats.load(keyword)()
        except PluginError:
            if wanted is not None:
                raise
            continue
        if isinstance(importer, FolderImporter) and (
            wanted or os.path.exists(folder / importer.marker)
        ):
            return importer
    return None


def _refuse_omissions(remarks: Sequence[Any], strict: bool) -> None:
    """Refuse a model of which something is left out, where strict."""
    if strict and remarks:
        raise SceneError(
            Mistake("", MISSING, f"{one.text}: it would be left out", file=one.place.file,
                    line=one.place.line)
            for one in remarks
        )  # fmt: skip


def read_articulation(
    file: Path,
    *,
    format: str | None = None,
    packages: Mapping[str, str | os.PathLike[str]] | None = None,
    root: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    shapes: bool = True,
    contacts: bool = False,
    arguments: Mapping[str, Any] | None = None,
    key: str | None = None,
) -> tuple[Articulation, SourceFiles, str]:
    """The model in a file before it becomes a scene, its files, and the importer's keyword.

    Raises:
        FormatError: the file cannot be read.
        PluginError: there is no such importer, or it is broken.
    """
    _require_file(file)
    folders = {name: Path(os.fsdecode(folder)) for name, folder in (packages or {}).items()}
    for name, folder in folders.items():
        if not os.path.isdir(folder):
            raise FormatError(f"package {name}: {folder} is no folder")
    folder = file.parent if root is None else Path(os.fsdecode(root))
    if not os.path.isdir(folder):
        raise FormatError(f"root: {folder} is no folder")
    given = {name: str(value) for name, value in _named("arguments", arguments).items()}
    source = SourceFiles(file, folder, folders, allow_code, shapes, contacts, given, key=key)
    importer, keyword = _importer(source, format)
    try:
        model = importer.read(source)
        if source.unused:
            what = f"takes no argument {min(source.unused)!r}"
            raise FormatError(what, None, "arguments are those that a xacro file declares")
        if source.key is not None:
            raise FormatError(f"has no keyframes, and so none {source.key!r}")
        return model, source, keyword
    except (FormatError, PluginError):
        raise
    except RecursionError:
        raise FormatError("is nested too deep") from None


def _require_file(file: Path) -> None:
    """Refuse a path that is no file."""
    if os.path.isdir(file):
        models = sorted(one.name for one in file.iterdir() if one.suffix in SUFFIXES)
        names = f", such as {', '.join(models[:5])}" if models else ""
        raise FormatError("is a folder", remedy=f"name a file in it{names}")
    if not os.path.exists(file):
        hint = did_you_mean(file.name, _names_in(file.parent), "; {}")
        raise FormatError(f"there is no such file{hint}")


def _names_in(folder: Path) -> list[str]:
    try:
        return sorted(one.name for one in folder.iterdir())
    except OSError:
        return []


def _importer(source: SourceFiles, wanted: str | None) -> tuple[Importer, str]:
    """The importer of a file: the one wanted, named like its suffix, or of its suffix and root.

    They are loaded one after the other until one fits, those of dap3d itself first.
    """
    formats = extensions("importer")
    if wanted is not None:
        return formats.load(wanted)(), wanted
    suffixes = [one.lower() for one in source.path.suffixes]
    if suffixes[-1:] == [".toml"]:
        raise FormatError("is a scene of dap3d", remedy=f"dap3d run {source.path}")
    loaded: dict[str, Importer] = {}
    fitting: dict[str, Importer] = {}
    named = [one[1:] for one in suffixes if one[1:] in formats.keywords]
    for keyword in [*named, *(one for one in formats.first if one not in named)]:
        try:
            importer = formats.load(keyword)()
        except PluginError:  # a broken one hurts its own files alone
            continue
        if isinstance(importer, FolderImporter):
            continue
        loaded[keyword] = importer
        if suffixes[-1:] and suffixes[-1] in importer.suffixes:
            fitting[keyword] = importer
            if keyword in named or not importer.roots or source.xml().name in importer.roots:
                return importer, keyword
    name = source.xml().name
    fitting = {k: one for k, one in loaded.items() if name in one.roots} or fitting
    if len(fitting) == 1:
        keyword, importer = next(iter(fitting.items()))
        return importer, keyword
    known = ", ".join(f"{k} ({' '.join(one.suffixes)})" for k, one in loaded.items())
    what = f"is no file of a format that is installed: {known or 'none is'}"
    raise FormatError(what, remedy="name its format with --format")


def _coordinates(
    given: Mapping[str, Any] | None, model: Articulation, *, positions: bool
) -> dict[str, tuple[float, ...]]:
    """Coordinates of joints as tuples."""
    coordinates, what = {}, "position" if positions else "rate"
    quaternions = {"ball": 1, "free": 1} if positions else {}
    for name, value in _named(f"{what}s", given).items():
        if name not in model.joints:
            has = f"it has {some([*model.joints], 8)}"
            remedy = did_you_mean(name, model.joints, otherwise=has)
            raise FormatError(f"{what} of {name}: there is no such joint in the file", None, remedy)
        try:
            array = np.ravel(value)
        except ValueError:  # rows of different lengths
            array = np.ravel("")
        if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
            raise FormatError(f"{what} of {name} = {value!r} should be finite numbers")
        values = tuple(map(float, array))
        kind = model.joints[name].kind
        count = KINDS[kind] + quaternions.get(kind, 0)
        if len(values) != count:
            raise FormatError(
                f"joint {name} is {kind}: it takes {count} numbers, not {len(values)}"
            )
        coordinates[name] = values
    return coordinates


def _named(what: str, given: Any) -> Mapping[str, Any]:
    """Values by name, none for None."""
    if given is not None and not isinstance(given, Mapping):
        raise FormatError(f"{what} = {given!r}: should be a dictionary of names and values")
    return given or {}


def _relocated(mistake: Mistake, names: Names, file: Path) -> Mistake:
    """A mistake of the scene, at the line of the file that it comes from."""
    table, _, rest = mistake.key.partition(".")
    place = names.places.get((table, rest.partition(".")[0]))
    if place is None:
        return attrs.evolve(mistake, file=str(file))
    return attrs.evolve(mistake, file=place.file, line=place.line)


def _refusal(error: FormatError, file: Path | None = None) -> SceneError:
    """The error of a scene for that of a file."""
    place = error.place
    name = place.file or ("" if file is None else file.name)
    if file is not None and name == file.name:
        name = str(file)
    return SceneError(
        [Mistake("", MISSING, error.what, remedy=error.remedy, file=name, line=place.line)]
    )
