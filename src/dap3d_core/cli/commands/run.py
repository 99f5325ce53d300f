"""``dap3d run``: simulates a model and writes its result."""

import math
import sys
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command

if TYPE_CHECKING:
    from pathlib import Path

    from dap3d_core.cli.framework.execute import Announce, Watch
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene
    from dap3d_core.simulation import CompiledModel


@command(
    "Simulate a model, write its result.",
    click.argument("model", required=False, shell_complete=completion.models),
    options.output("Result file; MODEL.nc in the current folder by default."),
    *options.SETTING_OPTIONS.values(),
    click.option("--from", "start_file", metavar="RESULT[@TIME]",
                 help="Start from the state of a result, at its end or at a time in s; bodies are "
                      "matched by their names."),
    click.option("--error/--no-estimate", "estimate_error", default=None,
                 help="Estimate the error of all positions and velocities by a second run at "
                      "tolerances ten times tighter, or half the step; by default where that takes "
                      "less than a second."),
    click.option("--checkpoint", type=options.Seconds(), metavar="EVERY", default=math.inf,
                 help="Write RESULT.checkpoint so often: 90, 5min, 2h; dap3d resume continues "
                      "from it, also after the run was killed."),
    options.STRICT, options.FORCE, options.ALLOW_CODE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def run(
    ctx: click.Context,
    /,
    model: str | None,
    *,
    output: str | None,
    start_file: str | None,
    strict: bool,
    force: bool,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> int:
    """Simulate a MODEL and write its result.

    MODEL is the name of a shipped model (dap3d models), a folder with a scene.toml, or a TOML file.
    Without it, in a terminal, dap3d asks. Settings without an option are those of the scene.

    Ctrl-C ends a run; what was computed until then is saved, and dap3d resume continues it.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.run_summary import report_run
    from dap3d_core.cli.framework.execute import execute_scene
    from dap3d_core.cli.framework.paths import named_after, writable

    if model is None:
        model, scene, force = _ask(ctx, given, output, force=force)
    else:
        scene = dap.load(model)
    start, source = _start(ctx, start_file, given)
    target = writable(named_after(model, output), force=force, sources=(scene.path, source))
    options.check_settings(scene, given)
    if given["estimate_error"] is None:
        given["estimate_error"] = "quick"
    given["start"] = start
    names = options.SETTINGS | ({"start": "--from"} if start_file else {})

    def simulate(compiled: "CompiledModel", announce: "Announce", watch: "Watch") -> "Result":
        return dap.simulate(
            compiled, watch=watch, announce=announce, output=target, force=force, **given
        )

    outcome = execute_scene(ctx, scene, simulate, names, method=given["method"],
                            allow_code=allow_code, quiet=quiet)  # fmt: skip
    return report_run(outcome, model, target, strict=strict, as_json=as_json, quiet=quiet)


def _start(
    ctx: click.Context, start_file: str | None, given: dict[str, Any]
) -> tuple[Any, "Path | None"]:
    """What the run starts from, as ``simulate`` takes it, and the result file that has it."""
    if start_file is None:
        return given["start"], None
    if given["start"] is not None:
        raise click.UsageError("--from and --start each say where the run starts: give one", ctx)
    from dap3d_core.cli.framework.paths import open_state

    return open_state(start_file)


def _ask(
    ctx: click.Context, given: dict[str, Any], output: str | None, *, force: bool
) -> tuple[str, "Scene", bool]:
    """Ask for the model, its settings, and whether to overwrite a result, in a terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise click.UsageError("name a MODEL; dap3d models lists the shipped ones", ctx)
    from dap3d_core.cli.commands.run_interactive import ask
    from dap3d_core.cli.framework.paths import named_after

    model, scene = ask(given)
    target = named_after(model, output)
    if not force and target.is_file():
        force = click.confirm(f"{target} exists. Overwrite it?", default=False, err=True)
    return model, scene, force
