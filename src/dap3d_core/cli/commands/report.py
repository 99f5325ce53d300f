"""``dap3d report``: speed against error of every method and integrator on a model."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import models as complete_models
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused, Terminated

if TYPE_CHECKING:
    from dap3d_core.cli.process.signals import Stopping
    from dap3d_core.report import Report

#: Settings with the options that give them, as ``in_options`` wants them.
SETTINGS = {
    "method": "--method",
    "integrator": "--integrator",
    "rtol": "--rtol",
    "step": "--step",
    "t_end": "--t-end",
    "dt": "--dt",
}

_OPTIONS = (
    click.option("--target-error", type=float, metavar="E",
                 help="Say which setting reaches this error soonest."),
    click.option("--quick", is_flag=True, help="Three rungs of each ladder, timed once."),
    click.option("--method", "methods", multiple=True, metavar="NAME",
                 help="Formulation to measure; may be given again. All by default."),
    click.option("--integrator", "integrators", multiple=True, metavar="NAME",
                 help="Integrator to measure; may be given again. All by default."),
    click.option("--rtol", "tolerances", multiple=True, type=float, metavar="X",
                 help="A rung of the ladder; may be given again. 1e-3 to 1e-12 by default."),
    click.option("--step", "steps", multiple=True, type=float, metavar="S",
                 help="A rung for fixed steps in s; may be given again."),
    click.option("--repeat", type=click.IntRange(min=1), metavar="N",
                 help="Timings of each rung, of which the median counts; 5 by default."),
    click.option("--limit", "limit_s", type=float, default=30.0, show_default=True, metavar="S",
                 help="End a run after so many seconds; it is listed as failed."),
    click.option("--t-end", type=float, metavar="S", help="Final time in s."),
    click.option("--dt", type=float, metavar="S", help="Reporting step in s."),
    click.option("--correct/--no-correct", default=None,
                 help="Correct the initial conditions so that they fulfil the constraints."),
    click.option("--project/--no-project", default=None,
                 help="Bring every step onto the constraints."),
    click.option("--plot", "picture", type=click.Path(), metavar="FILE",
                 help="Draw time against error: .png, .svg or .pdf."),
    click.option("--csv", "csv_file", type=click.Path(), metavar="FILE",
                 help="Write all settings as a table."),
    click.option("-o", "--output", type=click.Path(), metavar="FILE",
                 help="Write what --json prints to a file."),
    click.option("--force", is_flag=True, help="Overwrite existing files."),
    click.option("--allow-code", is_flag=True,
                 help="Allow the model's own types (plugin.py in its folder) to run."),
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else."),
)  # fmt: skip


def _with_options(function: Callable[..., Any]) -> Callable[..., Any]:
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@click.command(cls=Command, short_help="Measure speed against error on a model.")
@click.argument("model", shell_complete=complete_models)
@_with_options
@click.pass_context
def report(
    ctx: click.Context,
    /,
    model: str,
    *,
    picture: str | None,
    csv_file: str | None,
    output: str | None,
    force: bool,
    as_json: bool,
    **given: Any,
) -> int:
    """Measure speed against error of every method and integrator that fits a MODEL.

    Each is run on a ladder of tolerances or steps, timed in turns, and compared with a reference:
    two independent runs at the tightest tolerance, whose difference is the reference's own
    uncertainty. Errors are relative, over all reported positions and velocities (docs/report.md).

    \b
    dap3d report pen1 --quick
    dap3d report fourbar3 --target-error 1e-6 --plot speed.png --csv speed.csv

    Ctrl-C ends it; what was measured until then is shown and written.
    """
    import dap3d_core as dap

    scene = dap.load(model)
    targets = _targets(picture, csv_file, output, force=force, scene_file=scene.path)
    found, code = _measured(scene, given, ctx.meta["dap3d.stopping"], quiet=as_json)
    written = _write(found, targets, force=force)
    command = _command(model, given)
    with_target = given["target_error"] is not None
    _tell(found, model, command, written, as_json=as_json, with_target=with_target)
    if code != exit_codes.DONE:
        from dap3d_core.cli.console.console import messages, say

        say(messages(), "ended early; what was measured until then is above", "bold red")
    return code


def _targets(
    picture: str | None, csv_file: str | None, output: str | None, *, force: bool, scene_file: Any
) -> dict[str, Path]:
    """The files that are written, by what they are; refused before any work is done."""
    from dap3d_core.cli.framework.paths import writable

    asked = {"picture": picture, "csv": csv_file, "json": output}
    found = {}
    for kind, name in asked.items():
        if name is None:
            continue
        if kind == "picture":
            from dap3d_core.plot.figure import check_suffix

            try:
                check_suffix(Path(name))
            except ValueError as error:
                raise Refused(str(error)) from error
        found[kind] = writable(Path(name), force=force, sources=(scene_file,))
    if len({path.resolve() for path in found.values()}) < len(found):
        raise Refused("--plot, --csv and --output name one file twice; give each its own")
    return found


def _measured(
    scene: Any, given: dict[str, Any], stopping: "Stopping", *, quiet: bool
) -> tuple["Report", int]:
    """The report and an exit code; one that ends early gives what was measured."""
    import dap3d_core as dap
    from dap3d_core.cli.console.report_tables import ReportProgress
    from dap3d_core.cli.framework.options import in_options
    from dap3d_core.scene import SceneError

    asked: dict[str, Any] = {name: None if value == () else value for name, value in given.items()}
    with ReportProgress(quiet=quiet) as progress:

        def on_progress(done: float, total: float, words: str) -> None:
            progress.work(done, total, words)
            stopping.between_chunks()

        try:
            found = dap.report(scene, progress=on_progress, announce=progress.announce, **asked)
        except SceneError as error:
            raise in_options(error, SETTINGS) from error
        except ValueError as error:
            raise Refused(str(error)) from error
        except (Terminated, KeyboardInterrupt) as error:
            kept = getattr(error, "report", None)
            if kept is None:
                raise
            return kept, _code(error)
        return found, exit_codes.DONE


def _code(error: BaseException) -> int:
    return exit_codes.INTERRUPTED if isinstance(error, KeyboardInterrupt) else exit_codes.PARTIAL


def _write(found: "Report", targets: dict[str, Path], *, force: bool) -> list[Path]:
    """Write the files asked for; a picture only where there is something to draw."""
    from dap3d_core.cli.console.console import messages, say
    from dap3d_core.result.file.atomic_write import whole_file

    written = []
    for kind, target in targets.items():
        if kind == "csv":
            found.save_csv(target, force)
        elif kind == "json":
            with whole_file(target, force) as part:
                part.write_text(found.to_json() + "\n", "utf-8")
        else:
            try:
                found.plot(target, force)
            except ValueError as error:
                say(messages(), f"{target} is not drawn: {error}", "red")
                continue
        written.append(target)
    return written


def _command(model: str, given: dict[str, Any]) -> str:
    """What runs the model as it was measured, but for the setting."""
    words = ["dap3d run", shlex.quote(model)]
    said = {name: value for name, value in given.items() if value is not None}
    words += [f"{SETTINGS[name]} {said[name]!r}" for name in ("t_end", "dt") if name in said]
    switches = [name for name in ("correct", "project") if name in said]
    words += [f"--{'' if said[name] else 'no-'}{name}" for name in switches]
    return " ".join(words + ["--allow-code"] * bool(said["allow_code"]))


def _tell(
    found: "Report",
    model: str,
    command: str,
    written: list[Path],
    *,
    as_json: bool,
    with_target: bool,
) -> None:
    from dap3d_core.cli.console.console import output, print_json, say
    from dap3d_core.cli.console.report_tables import show_report

    if as_json:
        print_json({"model": model, **found.to_dict()})
        return
    console = output()
    show_report(console, found, command, with_target=with_target)
    for path in written:
        say(console, f"{path} written", whole=True)
