"""``dap3d run``: simulate a model and write its result."""

import math
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import models as complete_models
from dap3d_core.cli.framework.execute import Seconds, carry_out
from dap3d_core.cli.framework.options import (
    ALLOW_CODE,
    JSON,
    QUIET,
    SETTING_OPTIONS,
    SETTINGS,
    check_settings,
    in_options,
    with_options,
)
from dap3d_core.cli.framework.paths import named_after

if TYPE_CHECKING:
    from dap3d_core.cli.framework.execute import Announce, Watch
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene
    from dap3d_core.simulation import CompiledModel

_OPTIONS = (
    click.option("-o", "--output", type=click.Path(), metavar="FILE",
                 help="Result file; MODEL.nc in the current folder by default."),
    *SETTING_OPTIONS,
    click.option("--error", "estimate_error", is_flag=True,
                 help="Estimate the error of all positions and velocities by a second run at "
                      "tolerances ten times tighter, or half the step."),
    click.option("--checkpoint", type=Seconds(), metavar="EVERY", default=math.inf,
                 help="Write RESULT.checkpoint so often: 90, 5min, 2h; dap3d resume goes on from "
                      "it, also where the run was killed."),
    click.option("--strict", is_flag=True,
                 help="Exit with 1 if there are warnings (notes that tell of a change) or the "
                      "ledger does not close; the result is saved all the same."),
    click.option("--force", is_flag=True, help="Overwrite an existing result."),
    ALLOW_CODE,
    JSON,
    QUIET,
)  # fmt: skip


@click.command(cls=Command, saves=True, short_help="Simulate a model, write its result.")
@click.argument("model", required=False, shell_complete=complete_models)
@with_options(*_OPTIONS)
@click.pass_context
def run(
    ctx: click.Context,
    /,
    model: str | None,
    *,
    output: str | None,
    estimate_error: bool,
    checkpoint: float,
    strict: bool,
    force: bool,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> int:
    """Simulate a MODEL and write its result.

    MODEL is the name of a shipped model (dap3d models), a folder with a scene.toml, or a TOML file.
    Without it, in a terminal, dap3d asks. What no option says is taken from the scene.

    Ctrl-C ends a run; what was computed until then is saved, and dap3d resume goes on from there.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.run_outcome import tell
    from dap3d_core.cli.framework.paths import writable

    if model is None:
        model, scene, force = _ask(ctx, given, output, force=force)
    else:
        scene = dap.load(model)
    target = writable(named_after(model, output), force=force, sources=(scene.path,))
    check_settings(scene, given)
    found: list[CompiledModel] = []

    def prepare(announce: "Announce") -> "CompiledModel":
        method = given["method"]
        found.append(dap.compile(scene, method=method, allow_code=allow_code, announce=announce))
        return found[0]

    def go(announce: "Announce", watch: "Watch") -> "Result":
        try:
            return dap.simulate(
                found[0],
                watch=watch,
                announce=announce,
                output=target,
                force=force,
                estimate_error=estimate_error,
                checkpoint=checkpoint,
                **given,
            )
        except dap.SceneError as error:  # settings that only the integrator can judge
            raise in_options(error, SETTINGS) from error

    outcome = carry_out(ctx, prepare, go, quiet=quiet)
    return tell(outcome, model, target, strict=strict, as_json=as_json, quiet=quiet)


def _ask(
    ctx: click.Context, given: dict[str, Any], output: str | None, *, force: bool
) -> tuple[str, "Scene", bool]:
    """Model, scene and settings by questions, where somebody can answer; whether to overwrite."""
    import sys

    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise click.UsageError("name a MODEL; dap3d models lists the shipped ones", ctx)
    from dap3d_core.cli.commands.run_interactive import ask

    model, scene = ask(given)
    target = named_after(model, output)
    if not force and target.is_file():
        force = click.confirm(f"{target} exists. Overwrite it?", default=False, err=True)
    return model, scene, force
