"""``dap3d run``: simulate a model and write its result."""

import math
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.carrying import Seconds, carry_out
from dap3d_core.cli.completion import models as complete_models
from dap3d_core.cli.group import Command

if TYPE_CHECKING:
    from dap3d_core.cli.carrying import Announce, Watch
    from dap3d_core.result import Result
    from dap3d_core.scene import Scene, SceneError
    from dap3d_core.simulation import CompiledModel

#: Settings of a run that the command line overrides, with the options that do.
SETTINGS = {
    "t_end": "--t-end",
    "dt": "--dt",
    "method": "--method",
    "integrator": "--integrator",
    "rtol": "--rtol",
    "atol": "--atol",
    "step": "--step",
    "correct": "--correct",
    "project": "--project",
    "correct_metric": "--correct-metric",
}

_OPTIONS = (
    click.option("-o", "--output", type=click.Path(), metavar="FILE",
                 help="Result file; MODEL.nc in the current folder by default."),
    click.option("--t-end", type=float, metavar="S",
                 help="Final time in s; 0 solves once at t = 0."),
    click.option("--dt", type=float, metavar="S", help="Reporting step in s."),
    click.option("--method", metavar="NAME",
                 help="Formulation: auto, unconstrained, standard, penalty, lsq."),
    click.option("--integrator", metavar="NAME",
                 help="dop853, dopri5, adams, radau for stiff scenes, or rk4 with --step."),
    click.option("--rtol", type=float, metavar="X", help="Relative tolerance."),
    click.option("--atol", type=float, metavar="X", help="Absolute tolerance."),
    click.option("--step", type=float, metavar="S",
                 help="Fixed step in s, without error control."),
    click.option("--correct/--no-correct", default=None,
                 help="Correct the initial conditions so that they fulfil the constraints."),
    click.option("--correct-metric", type=click.Choice(["unit", "mass"]), default=None,
                 help="The least correction is that in m and rad, or weighted by masses."),
    click.option("--project/--no-project", default=None,
                 help="Bring every step onto the constraints."),
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
    click.option("--allow-code", is_flag=True,
                 help="Allow the model's own types (plugin.py in its folder) to run."),
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else."),
    click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone."),
)  # fmt: skip


def _with_options(function: Callable[..., Any]) -> Callable[..., Any]:
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@click.command(cls=Command, short_help="Simulate a model, write its result.")
@click.argument("model", required=False, shell_complete=complete_models)
@_with_options
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
    from dap3d_core.cli.files import writable
    from dap3d_core.cli.outcome import tell
    from dap3d_core.integrators import ahead

    if model is None:
        model, scene, force = _ask(ctx, given, output, force=force)
    else:
        scene = dap.load(model)
    target = writable(_target(model, output), force=force, sources=(scene.path,))
    _check_settings(scene, given)
    found: list[CompiledModel] = []

    def prepare(announce: "Announce") -> "CompiledModel":
        ahead.start(given["integrator"] or str(scene.simulation.integrator))
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
    from dap3d_core.cli.questions import ask

    model, scene = ask(given)
    target = _target(model, output)
    if not force and target.is_file():
        force = click.confirm(f"{target} exists. Overwrite it?", default=False, err=True)
    return model, scene, force


def _target(model: str, output: str | None) -> Path:
    """Where the result goes: MODEL.nc in the current folder if nothing else is said."""
    if output is not None:
        return Path(output)
    path = Path(model)
    if path.is_file():
        return Path(f"{path.stem}.nc")
    return Path(f"{path.resolve().name if path.exists() else path.name}.nc")


def _check_settings(scene: "Scene", given: dict[str, Any]) -> None:
    """Refuse what the options say before the model is compiled; names the options."""
    import attrs

    from dap3d_core.scene import SceneError, check_simulation

    said = {name: value for name, value in given.items() if value is not None}
    try:
        check_simulation(attrs.evolve(scene.simulation, **said), scene.bodies)
    except SceneError as error:
        options = said.keys() | ({"step"} if "integrator" in said else set())
        about = options | ({"dt"} if "t_end" in said else set())
        mistakes = [m for m in error.mistakes if m.key in about]
        if mistakes:  # others are found again with the whole scene, with their lines
            raise in_options(SceneError(mistakes), options) from error


def in_options(error: "SceneError", said: Collection[str]) -> "SceneError":
    """The same mistakes, those of some settings under the names of their options."""
    import attrs

    from dap3d_core.scene import MISSING, SceneError

    return SceneError(
        attrs.evolve(m, key=SETTINGS[m.key], value=MISSING if m.value is None else m.value)
        if m.key in said and not m.file
        else m
        for m in error.mistakes
    )
