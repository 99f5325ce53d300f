"""``export_model``: a scene as a C library, an FMU, or a model of another program."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Unpack

import attrs

from dap3d_core.formats.export_model import ExportReport
from dap3d_core.formats.export_model import export_model as export_text
from dap3d_core.interface.errors import PluginError
from dap3d_core.interface.formats import ResultExporter
from dap3d_core.kernels.compiler import background
from dap3d_core.kernels.compiler.types import CompileError
from dap3d_core.native.build import PLATFORMS, Platform, platforms_named
from dap3d_core.native.c_source import PARAMETERS, Variable, data_of, variables_of
from dap3d_core.native.fmu import write_fmu
from dap3d_core.native.library import Exported
from dap3d_core.native.run.directions import Directions
from dap3d_core.native.run.limits import limits_of
from dap3d_core.native.run.outputs import Outputs, outputs_of
from dap3d_core.native.run.parameters import places_of
from dap3d_core.native.run.prepared import PreparedRun, refusal
from dap3d_core.registry import Registry
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.extensions import extensions
from dap3d_core.registry.suggestions import did_you_mean
from dap3d_core.scene import Scene, SceneError, load
from dap3d_core.settings import StepSettings
from dap3d_core.study.parameters import SceneParameter, parameters_named

#: Formats, with the suffix of their files; "c" is a folder.
NATIVE_FORMATS = {"c": "", "fmu": ".fmu"}
#: Suffixes of files that it is not.
FILES_OF_C = (".c", ".h")
#: Letters of the name of a library at most.
LONGEST = 100
SOURCE = Path(__file__).parent / "source"
#: Files of it with words of the model.
WRITTEN = ("example.c", "example.rs", "example.m", "CMakeLists.txt", "README.md")


@attrs.frozen
class NativeExport:
    """The report of an export to C or an FMU.

    Attributes:
        format: "c" or "fmu".
        path: the folder or the file.
        platforms: names of those that there are libraries for.
        inputs, parameters, outputs: names of the variables.
        left_out: outputs of the scene that compiled code does not compute.
        size: bytes of the largest shared library.
    """

    format: str
    path: Path
    platforms: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    left_out: tuple[str, ...]
    size: int


def export_native(
    scene: Scene | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    format: str,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] = (),
    platforms: Sequence[str] = (),
    fmi: int = 3,
    strict: bool = False,
    force: bool = False,
    allow_code: bool = False,
    registry: Registry | None = None,
    **settings: Any,
) -> NativeExport:
    """Write a scene as a C library or an FMU; arguments as of ``export_model``.

    Raises:
        SceneError: the scene is invalid; something cannot be exported: its name, and why.
        SimulationError: its run cannot begin.
        OSError: a file cannot be written, or exists and ``force`` is off.
    """
    target = Path(path)
    if format == "c" and target.suffix in FILES_OF_C:
        folder = target.with_suffix("")
        raise refusal(f"format c is a folder of files, not {target}", f"give {folder}")
    if fmi not in (2, 3):
        raise refusal(f"there is no FMI {fmi}", "FMI 3 and 2 are written")
    if target.exists() and not force:
        raise FileExistsError(f"{target} exists; force overwrites it")
    if target.exists() and target.is_dir() != (format == "c"):
        what = "a folder" if target.is_dir() else "a file"
        raise refusal(f"{target} is {what}", "give another path")
    is_export = all((target / name).is_file() for name in ("dap3d.h", "variables.h"))
    if format == "c" and target.is_dir() and any(target.iterdir()) and not is_export:
        raise refusal(f"{target} is a folder with files of others", "give another path")
    chosen = platforms_named(platforms)
    options = {"allow_code": allow_code, "registry": registry} | settings
    model = model_of(scene, outputs, parameters, target.stem, **options)
    variables, left_out = model.variables, model.outputs.left_out
    if strict and left_out:
        raise refusal(left_out[0], "name the outputs to be exported")
    version = fmi if format == "fmu" else 0
    try:
        size = _write(model, chosen, target, version)
    except CompileError:  # a function without a derivative
        size = _write(attrs.evolve(model, directions=None), chosen, target, version)
    kinds = {"input": ("input",), "parameter": PARAMETERS, "output": ("output",)}
    names = {k: tuple(v.name for v in variables if v.kind in of) for k, of in kinds.items()}
    return NativeExport(
        format, target, tuple(p.name for p in chosen), names["input"], names["parameter"],
        names["output"], tuple(left_out), size,
    )  # fmt: skip


def model_of(
    scene: Scene | str | os.PathLike[str],
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] = (),
    name: str = "",
    **options: Any,
) -> Exported:
    """A model on its way into files; a name for a scene without one, and settings of its run.

    Raises:
        SceneError, SimulationError: as ``export_native``.
    """
    scene = scene if isinstance(scene, Scene) else load(scene)
    prepared = PreparedRun(scene, **options)
    prepared.may_start_anew &= bool(parameters)
    given = outputs_of(prepared, outputs)
    directions = None
    with suppress(CompileError):  # a function has no derivative
        directions = Directions(prepared, given)
    chosen = _parameters(prepared, parameters, options, given)
    variables = variables_of(prepared, given.found, chosen)
    _refuse_shared(variables)
    word = re.sub(r"\W+", "_", str(scene.name or name), flags=re.ASCII) or "model"
    # an identifier of C, and part of the names of files
    word = f"_{word}"[:LONGEST] if word[0].isdigit() else word[:LONGEST]
    return Exported(prepared, variables, word, given, directions)


def _write(model: Exported, platforms: Sequence[Platform], target: Path, fmi: int) -> int:
    """Write an FMU of a version, or for 0 a folder; bytes of the largest library."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        given = model.prepared, model.variables, model.outputs.elements, model.directions
        (folder / "data.h").write_text(data_of(*given))
        for file in SOURCE.iterdir():
            shutil.copy(file, folder / file.name)
        if fmi:
            return write_fmu(model, platforms, target, fmi, folder)
        made = folder / "made"
        size = _write_folder(model, platforms, made, folder)
        # libraries of what was there before would be loaded for the new ones
        for name in PLATFORMS:
            shutil.rmtree(target / name, ignore_errors=True)
        _copy(made, target)
        return size


def _copy(made: Path, target: Path) -> None:
    """Copy a folder; one that is not written whole is removed, if it was not there before."""
    was_there = target.exists()
    try:
        for file in made.rglob("*"):
            copy = target / file.relative_to(made)
            if file.is_file():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, copy)
    except BaseException:
        if not was_there:
            shutil.rmtree(target, ignore_errors=True)
        raise


def _parameters(
    prepared: PreparedRun, names: Sequence[str], options: dict[str, Any], outputs: Outputs
) -> list[Variable]:
    """Parameters as variables."""
    try:
        parameters = parameters_named(prepared.compiled.checked, names)
    except SceneError as error:
        raise SceneError([attrs.evolve(m, key="parameters") for m in error.mistakes]) from None
    found = [_parameter(prepared, parameter, options, outputs) for parameter in parameters]
    limits = limits_of(prepared, parameters, allow_code=bool(options.get("allow_code")))
    pairs = zip(found, limits, strict=True)
    return [attrs.evolve(v, limits=x, label="; ".join([v.label, *x.words])) for v, x in pairs]


def _refuse_shared(variables: Sequence[Variable]) -> None:
    """Refuse two variables of one name, or that set one number of the memory."""
    names = [variable.name for variable in variables]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        what = f"two variables have the name {twice[0]}"
        raise refusal(what, "names of inputs, outputs and parameters have to differ")
    known: dict[int, str] = {}
    for variable in variables:
        inputs = [variable.first] if variable.kind == "input" else []
        for word in (*inputs, *(word for word, _ in variable.words)):
            if (other := known.setdefault(word, variable.name)) != variable.name:
                what = f"{other} and {variable.name} set the same number of the model"
                raise refusal(what, "leave one of them out")


def _parameter(
    prepared: PreparedRun, parameter: SceneParameter, options: dict[str, Any], outputs: Outputs
) -> Variable:
    """A parameter as a variable."""
    name = parameter.name
    if parameter.table == "inputs":
        raise refusal(
            f"{name} is the start of an input, which exported models have as a variable",
            f"set {parameter.path[1]} in its place",
        )
    places = places_of(prepared, parameter, options, outputs)
    kind = "fixed" if places.is_fixed else "parameter"
    return Variable(
        name, kind, parameter.unit, f"parameter {name}", int(places.moves_start),
        float(parameter.value or 0.0), tuple(places.words.items()),
    )  # fmt: skip


def _write_folder(
    model: Exported, platforms: Sequence[Platform], target: Path, sources: Path
) -> int:
    """Write the folder of a C library; bytes of the largest shared one."""
    target.mkdir(parents=True, exist_ok=True)
    size = 0
    for one in platforms:
        folder = target / one.name
        folder.mkdir(exist_ok=True)
        archive = folder / f"lib{model.name}.a"
        library = folder / library_name(model.name, one)
        size = max(size, model.link(sources / "runtime.c", one, library, archive))
    header = variables_header(model.prepared, model.variables)
    (target / "variables.h").write_text(header, encoding="utf-8", newline="\n")
    shutil.copy(SOURCE / "dap3d.h", target / "dap3d.h")
    words = _words(model, platforms)
    for file in WRITTEN:
        text = (SOURCE / file).read_text(encoding="utf-8")
        for key, value in words.items():
            text = text.replace(f"@{key}@", str(value))
        (target / file).write_text(text, encoding="utf-8", newline="\n")
    return size


def library_name(name: str, target: Platform) -> str:
    """File name of a shared library."""
    return f"{'' if target.library == '.dll' else 'lib'}{name}{target.library}"


def variables_header(prepared: PreparedRun, variables: Sequence[Variable]) -> str:
    """The text of variables.h: references of the variables."""
    title = prepared.compiled.scene.description or prepared.compiled.scene.name
    head = f"/* Variables of the model: {_comment(title)}"
    lines = [head, "   Units are in brackets. */", "enum {"]
    used: set[str] = set()
    for k, v in enumerate(variables):
        word = re.sub(r"\W+", "_", v.name, flags=re.ASCII).strip("_").upper()
        while word in used:
            word += "_"
        used.add(word)
        words = [f"{v.kind}: {v.name} [{v.unit}]", *v.limits.words]
        lines.append(f"    V_{word} = {k}, /* {_comment('; '.join(words))} */")
    return "\n".join([*lines, "};", ""])


def _comment(text: str) -> str:
    """A text within a comment of C, which it neither ends nor makes compilers warn of."""
    return re.sub(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=\?)(?=\?)", " ", text)


def _words(model: Exported, platforms: Sequence[Platform]) -> dict[str, Any]:
    from dap3d_core.result.metadata import current_versions

    prepared = model.prepared
    settings = prepared.run.settings
    return {
        "NAME": model.name,
        "DESCRIPTION": str(prepared.compiled.scene.description or model.name),
        "VERSION": current_versions()["dap3d"],
        "PLATFORMS": ", ".join(p.name for p in platforms),
        "FIRST": platforms[0].name,
        "LIBRARY": library_name(model.name, platforms[0]),
        "OUTPUTS": sum(v.kind == "output" for v in model.variables),
        "T_END": repr(prepared.t_end),
        "METHOD": prepared.compiled.method,
        "INTEGRATOR": settings.integrator,
        "RTOL": settings.rtol,
        "ATOL": settings.atol,
    }


@checked
def export_model(
    scene: Scene | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    format: str | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] | None = None,
    platforms: Sequence[str] | None = None,
    fmi: int = 3,
    t_end: float | None = None,
    strict: bool = False,
    force: bool = False,
    allow_code: bool = False,
    registry: Registry | None = None,
    **settings: Unpack[StepSettings],
) -> ExportReport | NativeExport:
    """Write a scene as a model of another program, or as one that runs without Python.

    Args:
        scene: the scene; or its name, folder or file.
        path: the file, of "c" a folder; None writes none, of formats of text. Files of meshes are
            named from its folder, or that of the scene.
        format: "fmu", "c" (header, libraries, an example) or the keyword of an exporter, such as
            "urdf"; by default that of the path's suffix, "c" without one.
        outputs: of "fmu" and "c": names of quantities; by default the outputs of the scene, or
            where it has none the motion of its bodies.
        parameters: numbers that may be set, such as "forces.spring.k".
        platforms: "linux", "windows", "macos", "linux-arm64" ...; by default this one.
        fmi: version of an FMU, 3 or 2.
        t_end: of "fmu" and "c": final time of a run that is given none, s.
        strict, force: refuse to leave something out; overwrite what exists.
        allow_code, registry: as of ``compile``.
        **settings: of "fmu" and "c": how a run takes its steps, as of ``simulate``.

    Raises:
        SceneError: the scene is invalid, or cannot be exported so: what, and why.
        SimulationError: its run cannot begin.
        PluginError: there is no such exporter, or it is broken.
        OSError: the file cannot be written, or exists and ``force`` is off.
    """
    kind = format or _format_of(path)
    chosen: dict[str, Any] = {
        "outputs": outputs, "parameters": parameters, "platforms": platforms, "t_end": t_end,
        **settings,
    }  # fmt: skip
    given = {name: value for name, value in chosen.items() if value is not None}
    if kind not in NATIVE_FORMATS:
        _require_format(kind, given)
        return export_text(scene, path, format=kind, strict=strict, force=force, registry=registry)
    if path is None:
        raise refusal(f"format {kind} needs a path", "give that of the file or folder")
    given |= {"strict": strict, "force": force, "allow_code": allow_code, "registry": registry}
    with background.optimiser.held():
        return export_native(scene, path, format=kind, fmi=fmi, **given)


def _format_of(path: str | os.PathLike[str] | None) -> str:
    """The format that the suffix of a path says."""
    suffix = Path("" if path is None else path).suffix
    return "c" if suffix in ("", *FILES_OF_C) else suffix.lstrip(".")


def _require_format(kind: str, given: Iterable[str]) -> None:
    """Refuse settings of other formats, and a format that there is not; names the nearest."""
    for name in given:
        raise refusal(f"{name} is of formats {', '.join(NATIVE_FORMATS)}, not of {kind}")
    exporters = extensions("exporter")
    if kind in exporters.keywords:
        return

    def is_of_models(keyword: str) -> bool:
        try:
            return not issubclass(exporters.load(keyword), ResultExporter)
        except PluginError:
            return False

    formats = sorted([*NATIVE_FORMATS, *filter(is_of_models, exporters.keywords)])
    hint, listed = did_you_mean(kind, formats, "; {}"), ", ".join(formats)
    raise PluginError(f"there is no format {kind!r} of models{hint} (there are: {listed})")
