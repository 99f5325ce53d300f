"""``dap3d export``: a result, or a model, as a file for another program."""

import contextlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import Option, command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing
from dap3d_core.settings import StepSettings

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal

#: Options of the formats c and fmu alone, by parameter.
NATIVE_OPTIONS: dict[str, Option] = {
    "quantities": click.option(
        "--quantity", "quantities", multiple=True, metavar="NAME",
        help="c, fmu: an output, such as load.r.z, once for each; those of the MODEL by default."),
    "parameters": click.option(
        "--parameter", "parameters", multiple=True, metavar="NAME",
        help="c, fmu: a number that may be set, such as forces.spring.k, once for each."),
    "platforms": click.option(
        "--platform", "platforms", multiple=True, metavar="NAME",
        help="c, fmu: linux, windows, macos, or linux-arm64 ..., once for each; this one by "
        "default."),
    "fmi": click.option("--fmi", type=click.Choice(["3", "2"]), default=None,
                        help="fmu: version of the standard; 3 by default."),
    **{name: options.SETTING_OPTIONS[name] for name in ("t_end", *StepSettings.__annotations__)},
}  # fmt: skip


@command(
    "Write a result or a model for another program.",
    options.RESULT,
    click.option("-f", "--format", "kind", metavar="NAME",
                 help="vtk, gltf, mat or csv of a result; urdf, mjcf, c, fmu or that of a plugin "
                 "of a MODEL; by default what the suffix of the file says; without one, c of a "
                 "MODEL, vtk of a result."),
    options.output("A file; RESULT, or the name of MODEL, and the suffix by default."),
    options.FPS, options.MODEL_OF_RESULT, options.ALLOW_CODE,
    click.option("--strict", is_flag=True,
                 help="Refuse a MODEL if something would be left out."),
    *NATIVE_OPTIONS.values(),
    options.FORCE, options.JSON, options.QUIET,
)  # fmt: skip
def export(
    result: str,
    *,
    kind: str | None,
    output: str | None,
    fps: float | None,
    model: str | None,
    allow_code: bool,
    strict: bool,
    force: bool,
    **of_native: Any,
) -> int:
    """Write a RESULT, or a MODEL, to a file of another program.

    vtk (.vtkhdf) is the moving scene for ParaView, gltf (.glb) for Blender, browsers and viewers:
    shapes, bodies, joints and springs as dap3d view draws them. mat has all arrays for MATLAB and
    Octave, csv a column for each component.

    urdf and mjcf are models: bodies, joints, loops, and what acts in joints, of a MODEL in the
    place of RESULT. What they cannot say is refused, or listed. c (a library for C) and fmu (a
    model for co-simulation and model exchange) run without Python, with the numbers of dap3d run;
    of these alone are the settings of a run, from --t-end on, by default those of the MODEL.

    \b
    dap3d export pen1.nc --format vtk
    dap3d export pen1.nc -o pen1.glb --fps 60
    dap3d export fourbar4 --format mjcf
    dap3d export crane -o crane.fmu --platform linux --platform windows
    dap3d export pen1 -o pen1-c --integrator rk4 --step 0.001

    Ctrl-C leaves no file.
    """
    from dap3d_core.exchange import result_exporters

    kind = kind or _native_format(result, output)
    if kind in ("c", "fmu"):
        return _export_native(result, kind, output, strict=strict, force=force,
                              allow_code=allow_code, **of_native)  # fmt: skip
    words = {"quantities": "--quantity", "parameters": "--parameter", "platforms": "--platform"}
    words |= options.SETTINGS
    for name, value in of_native.items():
        if value not in (None, ()):
            raise Refused(f"{words.get(name, f'--{name}')} is of formats c and fmu")
    kind = kind or _model_format(output)
    if kind is not None and kind not in result_exporters():
        return _export_model(result, kind, output, strict=strict, force=force)
    if Path(result).suffix in ("", ".toml"):
        raise Refused(f"{result} is a model, no result; name a format of models, such as -f fmu")
    return _export_result(
        result, kind, output, fps=fps, model=model, allow_code=allow_code, force=force
    )


def _native_format(source: str, output: str | None) -> str | None:
    """The format of a .fmu, or of the folder of a library that a model is to be; else None."""
    suffix = Path(output or "").suffix
    is_model = output is not None and Path(source).suffix in ("", ".toml")
    return "fmu" if suffix == ".fmu" else "c" if is_model and suffix in ("", ".c", ".h") else None


def _model_format(output: str | None) -> str | None:
    """The format of models that has the suffix of a file; None for those of results."""
    from dap3d_core.exchange import result_exporters
    from dap3d_core.interface.errors import PluginError
    from dap3d_core.registry.extensions import extensions

    suffix, formats = Path(output or "").suffix, extensions("exporter")
    of_models = [one for one in formats.keywords if suffix and one not in result_exporters()]
    for keyword in of_models:
        with contextlib.suppress(PluginError):
            if formats.load(keyword).suffix == suffix:
                return keyword
    return None


def _export_result(
    result: str, kind: str | None, output: str | None, *, fps: float | None, model: str | None,
    allow_code: bool, force: bool,
) -> int:  # fmt: skip
    """Write a result by an exporter of a plugin."""
    from dap3d_core import export as write
    from dap3d_core.cli.console.console import count, show_written
    from dap3d_core.cli.console.progress import counting
    from dap3d_core.cli.framework.paths import open_result, output_path, refuse_all, writable
    from dap3d_core.exchange import check_fps, exporter_of, suffix_of

    suffix = suffix_of(kind or "vtk")
    target = output_path(result, output, suffix)
    opened = open_result(result, model=model, allow_code=allow_code)
    refuse_all(
        partial(exporter_of, target, kind),
        partial(check_fps, fps),
        partial(
            writable,
            target,
            force=force,
            sources=(Path(result),),
            kinds=(suffix,) if kind else (),
            any_name=True,
        ),
    )
    with counting("part") as progress, refusing(ValueError):
        made = write(opened, target, format=kind, fps=fps, model=model, progress=progress,
                     force=force)  # fmt: skip
    data = {"format": made.format, "instants": made.instants}
    show_written(target, count(made.instants, "instant"), data, made.notes)
    return DONE


def _export_model(model: str, kind: str, output: str | None, *, strict: bool, force: bool) -> int:
    """Write a model by an exporter of a plugin."""
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data
    from dap3d_core.cli.framework.paths import writable
    from dap3d_core.registry.extensions import extensions
    from dap3d_core.registry.suggestions import did_you_mean
    from dap3d_core.result.file.atomic_write import cannot

    formats = extensions("exporter")
    if kind not in formats.keywords:
        hint = did_you_mean(kind, known := [*formats.keywords, "c", "fmu"], "{} ")
        raise Refused(f"--format {kind}: unknown; {hint}formats: {', '.join(known)}")
    scene = dap.load(model)
    suffix = formats.load(kind).suffix
    target = Path(output or _name_of(model) + suffix)
    writable(target, force=force, sources=(scene.path,), kinds=(suffix,), any_name=True)
    try:
        report = dap.export_model(scene, target, format=kind, strict=strict, force=True)
    except OSError as error:
        raise cannot("write", target, error) from error
    remarks = {
        key: [one.text for one in getattr(report, key)] for key in ("translated", "left_out")
    }

    def show(console: "Terminal") -> None:
        console.say(f"{target} written")
        console.section("said in another way", remarks["translated"])
        console.section("left out", remarks["left_out"])

    show_data({"file": target, "format": kind} | remarks, show)
    return DONE


def _name_of(model: str) -> str:
    return Path(model).stem if Path(model).is_file() else Path(model).name


def _export_native(
    model: str,
    kind: str,
    output: str | None,
    *,
    quantities: Sequence[str],
    parameters: Sequence[str],
    platforms: Sequence[str],
    fmi: str | None,
    strict: bool,
    force: bool,
    allow_code: bool,
    **settings: Any,
) -> int:
    """Write a model as a C library or an FMU."""
    import dap3d_core as dap
    from dap3d_core.cli.console.console import count, show_data
    from dap3d_core.cli.framework.paths import writable
    from dap3d_core.result.file.atomic_write import cannot

    target = Path(output or _name_of(model) + (".fmu" if kind == "fmu" else ""))
    scene = dap.load(model)
    if kind == "fmu" or not target.exists():
        kinds = (".fmu",) if kind == "fmu" else ()
        writable(target, force=force, sources=(scene.path,), kinds=kinds, any_name=True)
    try:
        made: Any = dap.export_model(
            scene, target, format=kind, outputs=list(quantities) or None,
            parameters=list(parameters), platforms=list(platforms), fmi=int(fmi or 3),
            strict=strict, force=force, allow_code=allow_code, **settings,
        )  # fmt: skip
    except dap.SceneError as error:
        raise options.in_options(error, options.of_settings(settings)) from error
    except FileExistsError as error:
        raise Refused(f"{target} exists; --force overwrites it") from error
    except OSError as error:
        raise cannot("write", target, error) from error
    data = {
        "file": str(target), "format": kind, "platforms": made.platforms, "inputs": made.inputs,
        "parameters": made.parameters, "outputs": made.outputs, "left_out": made.left_out,
    }  # fmt: skip

    def show(console: "Terminal") -> None:
        variables = (made.inputs, "input"), (made.parameters, "parameter"), (made.outputs, "output")
        contents = ", ".join(count(len(names), noun) for names, noun in variables if names)
        console.say(f"{target} written: {contents}; {', '.join(made.platforms)}")
        console.section("left out", list(made.left_out))

    show_data(data, show)
    return DONE
