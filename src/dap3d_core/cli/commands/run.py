"""``dap3d run``: simulates a model and writes its result."""

import math
import sys
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command

if TYPE_CHECKING:
    from pathlib import Path

    from dap3d_core.scene import Scene


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
    **given: Any,
) -> int:
    """Simulate a MODEL and write its result.

    MODEL is the name of a shipped model (dap3d models), a folder with a scene.toml, or a TOML file.
    Without it, in a terminal, dap3d asks. Settings without an option are those of the scene.

    Ctrl-C ends a run; what was computed until then is saved, and dap3d resume continues it.
    """
    import dap3d_core as dap
    from dap3d_core.cli.framework.execute import execute_scene
    from dap3d_core.cli.framework.paths import result_target

    if model is None:
        model, scene, force = _ask(ctx, given, output, force=force)
    else:
        scene = dap.load(model)
    start, source = _start(ctx, start_file, given)
    target = result_target(model, output, scene.path, source, force=force)
    options.check_settings(scene, given)
    if given["estimate_error"] is None:
        given["estimate_error"] = "quick"
    given["start"] = start
    names = options.SETTINGS | ({"start": "--from"} if start_file else {})
    return execute_scene(
        ctx, scene, model, target,
        lambda compiled, announce, watch: dap.simulate(
            compiled, watch=watch, announce=announce, output=target, force=force, **given
        ),
        names, method=given["method"], strict=strict, allow_code=allow_code,
    )  # fmt: skip


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
    """Ask for the model, its settings, and whether to overwrite a result, in a terminal.

    Args:
        given: settings by name; answers replace those that no option gives.
    """
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise click.UsageError("name a MODEL; dap3d models lists the shipped ones", ctx)
    from dap3d_core.cli.framework.paths import named_after

    model, scene = _ask_model()
    settings = scene.simulation
    if given["correct"] is None and scene.joints:
        question = "Do you want to correct the initial conditions?"
        given["correct"] = click.confirm(question, default=settings.correct is not False, err=True)
    if given["t_end"] is None:
        given["t_end"] = _ask_number("Final time in seconds", settings.t_end, min=0.0)
    t_end = given["t_end"]
    if given["dt"] is None and t_end:
        usual = settings.dt if isinstance(settings.dt, (int, float)) else 0.0
        usual = usual if 0.0 < usual <= t_end else t_end / 100.0
        given["dt"] = _ask_number(
            "Reporting time-step in seconds", usual, min=0.0, min_open=True, max=t_end
        )
    if given["method"] is None:
        given["method"] = _ask_method(str(settings.method))
    target = named_after(model, output)
    if not force and target.is_file():
        force = click.confirm(f"{target} exists. Overwrite it?", default=False, err=True)
    return model, scene, force


def _ask_model() -> tuple[str, "Scene"]:
    from dap3d_core.cli.console.console import stderr
    from dap3d_core.scene import SceneError, load, shipped_models

    console = stderr()
    console.say(f"Shipped models: {', '.join(shipped_models()) or 'none'}")
    while True:
        model = click.prompt("Which model (a name, a folder or a file)", type=str, err=True)
        try:
            return model, load(model)
        except SceneError as error:
            console.say(str(error), "red")


class _Finite(click.FloatRange):
    """A finite number within bounds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail("the number must be finite")


def _ask_number(question: str, usual: Any, **bounds: Any) -> float:
    """A number within its bounds; the question is repeated until it is one."""
    default = f"{usual:g}" if isinstance(usual, (int, float)) else None
    return float(click.prompt(question, default=default, type=_Finite(**bounds), err=True))


def _ask_method(usual: str) -> str:
    """The formulation; its first letters are enough, as in the manual."""
    from dap3d_core.settings import METHODS

    def read(text: str) -> str:
        matches = [m for m in METHODS if m.startswith(text.strip().lower())]
        if text.strip() and len(matches) == 1:
            return matches[0]
        raise click.UsageError(f"one of {', '.join(METHODS)}")

    default = usual if usual in METHODS else "auto"
    question = f"Solution method ({', '.join(METHODS)})"
    return str(click.prompt(question, default=default, value_proc=read, err=True))
