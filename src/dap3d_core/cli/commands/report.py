"""``dap3d report``: speed against error of every method and integrator on a model."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command, signals_of
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused, Terminated, refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.report import Report
    from dap3d_core.scene import Scene


@command(
    "Measure speed against error on a model.",
    options.MODEL,
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
    *(options.SETTING_OPTIONS[name] for name in ("t_end", "dt", "correct", "project")),
    click.option("--plot", "picture", type=click.Path(), metavar="FILE",
                 help="Draw time against error: .png, .svg or .pdf."),
    click.option("--csv", "csv_file", type=click.Path(), metavar="FILE",
                 help="Write all settings as a table."),
    options.output("Write what --json prints to a file."),
    options.FORCE, options.ALLOW_CODE, options.JSON,
)  # fmt: skip
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
    **given: Any,
) -> int:
    """Measure speed against error of every method and integrator that fits a MODEL.

    Each is run on a ladder of tolerances or steps, timed in turns, and compared with a reference:
    two independent runs at the tightest tolerance, whose difference is the reference's own
    uncertainty. Errors are relative, over all reported positions and velocities
    (docs/how-to/report.md).

    \b
    dap3d report pen1 --quick
    dap3d report fourbar3 --target-error 1e-6 --plot speed.png --csv speed.csv

    Ctrl-C ends it; what was measured until then is shown and written.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import show_data, stderr
    from dap3d_core.cli.console.report_tables import show_report

    scene = dap.load(model)
    files = {"picture": picture, "csv": csv_file, "json": output}
    targets = _targets(files, scene.path, force=force)
    measured, code = _measure(ctx, scene, given)
    written = _write(measured, targets, force=force)

    def show(console: "Terminal") -> None:
        with_target = given["target_error"] is not None
        show_report(console, measured, _run_command(model, given), with_target=with_target)

    show_data({"model": model, **measured.to_dict()}, show, *written)
    if code != exit_codes.DONE:
        stderr().say("ended early; what was measured until then is above", "bold red")
    return code


def _targets(
    files: dict[str, str | None], scene_file: Path | None, *, force: bool
) -> dict[str, Path]:
    """The files to write, by their contents; refused before any work is done."""
    from dap3d_core.cli.framework.paths import writable

    if files["picture"] is not None:
        from dap3d_core.plot.figure_file import check_suffix

        with refusing(ValueError):
            check_suffix(Path(files["picture"]))
    targets = {
        kind: writable(Path(name), force=force, sources=(scene_file,),
                       kinds=() if kind == "picture" else (f".{kind}",), any_name=True)
        for kind, name in files.items()
        if name is not None
    }  # fmt: skip
    if len({path.resolve() for path in targets.values()}) < len(targets):
        raise Refused("--plot, --csv and --output name one file twice; give each its own")
    return targets


def _measure(ctx: click.Context, scene: "Scene", given: dict[str, Any]) -> tuple["Report", int]:
    """The report and an exit code; a report that ends early has what was measured."""
    import dap3d_core as dap
    from dap3d_core.cli.console.report_tables import ReportProgress
    from dap3d_core.result import Computed

    settings: dict[str, Any] = {name: None if v == () else v for name, v in given.items()}
    with ReportProgress() as progress, refusing(ValueError):
        try:
            work = signals_of(ctx).interruptible(progress.work)
            measured = dap.report(scene, progress=work, announce=progress.announce, **settings)
        except dap.SceneError as error:
            raise options.in_options(error) from error
        except (Terminated, KeyboardInterrupt) as error:
            if (partial := Computed.of(error).report) is None:
                raise
            interrupted = isinstance(error, KeyboardInterrupt)
            return partial, exit_codes.INTERRUPTED if interrupted else exit_codes.PARTIAL
        return measured, exit_codes.DONE


def _write(measured: "Report", targets: dict[str, Path], *, force: bool) -> list[Path]:
    """Write the files; a picture only if there is something to draw."""
    from dap3d_core.cli.console.console import stderr
    from dap3d_core.result.file.atomic_write import whole_file

    written = []
    for kind, target in targets.items():
        if kind == "csv":
            measured.save_csv(target, force)
        elif kind == "json":
            with whole_file(target, force) as part:
                part.write_text(measured.to_json() + "\n", "utf-8")
        else:
            try:
                measured.plot(target, force)
            except ValueError as error:
                stderr().say(f"{target} is not drawn: {error}", "red")
                continue
        written.append(target)
    return written


def _run_command(model: str, given: dict[str, Any]) -> str:
    """The command that runs the model as it was measured, without the setting."""
    said = {name: value for name, value in given.items() if value is not None}
    times = [f"{options.SETTINGS[n]} {said[n]!r}" for n in ("t_end", "dt") if n in said]
    switches = [f"--{'' if said[n] else 'no-'}{n}" for n in ("correct", "project") if n in said]
    code = ["--allow-code"] * said["allow_code"]
    return " ".join(["dap3d run", shlex.quote(model), *times, *switches, *code])
