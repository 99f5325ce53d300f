"""``dap3d sweep``: runs a model at many combinations of its parameters."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command, signals_of
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused
from dap3d_core.cli.process.streams import is_quiet, prints_json

if TYPE_CHECKING:
    import xarray

    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.scene import Scene, SceneError

#: Arguments of ``dap.sweep`` with the options that give them.
OPTIONS = {"vary": "--vary", "outputs": "--keep"} | {
    name: f"--{name}" for name in ("sample", "design", "seed", "threads")
}


@command(
    "Run a model at many values of its parameters.",
    options.MODEL,
    click.option("--vary", multiple=True, metavar="NUMBER=FORM",
                 shell_complete=completion.parameters,
                 help="A parameter that varies: bodies.crank.mass=1:5:9 (from:to:count), "
                      "1:100:5:log, 10,50,100; may be given again. Samples: 1:5, 1:100:log, 3~0.1 "
                      "(mean~deviation), 10,50,100."),
    click.option("--keep", multiple=True, metavar="QUANTITY[:WHAT]",
                 help="An output of each run: crank.r.z:max; end (by default), min, max, mean, "
                      "rms, integral or series; may be given again."),
    click.option("--sample", type=int, metavar="N",
                 help="Run N samples instead of the grid of all combinations."),
    click.option("--design", metavar="NAME",
                 help="How samples are drawn: lhs (by default), random, sobol, halton."),
    click.option("--seed", type=int, metavar="S", help="Seed of the samples; 0 by default."),
    options.output("File of the sweep; MODEL-sweep.nc in the current folder by default."),
    click.option("--gradients", is_flag=True,
                 help="Derivatives of the outputs by what varies, too, at each point."),
    *options.SETTING_OPTIONS.values(),
    click.option("--threads", type=int, metavar="N",
                 help="Points that run at once; by default one for each core."),
    click.option("--scheduler", metavar="ADDRESS",
                 help="Run the points on the dask cluster of this scheduler: tcp://node7:8786."),
    click.option("--resume", is_flag=True,
                 help="Continue an interrupted sweep from FILE.part."),
    click.option("--strict", is_flag=True, help="Exit with 1 if a point went wrong."),
    click.option("--force", is_flag=True,
                 help="Overwrite an existing file, and the part of another sweep."),
    options.ALLOW_CODE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def sweep(
    ctx: click.Context,
    /,
    model: str,
    *,
    output: str | None,
    scheduler: str | None,
    strict: bool,
    **given: Any,
) -> int:
    """Run a MODEL at many combinations of its parameters and store some outputs of each run.

    \b
    dap3d sweep pen1 --vary bodies.cone.mass=1:5:9 --keep cone.r.z:max
    dap3d sweep pen1 --vary bodies.cone.w.y=-10~1 --sample 100 --keep cone.r

    Parameters are named as in the scene file, a component after a further dot: bodies.crank.mass,
    points.A.sPp.x, forces.spring.k, simulation.rtol. Quantities are named as for dap3d plot. Points
    that go wrong do not end the others; they are listed.

    Ctrl-C ends a sweep; what was computed stays in FILE.part, and --resume continues from there.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.cli.framework.execute import partial_result
    from dap3d_core.cli.framework.paths import result_target

    _complete(ctx, given, scheduler)
    scene = dap.load(model)
    target = result_target(model, output, scene.path, force=given["force"], tail="-sweep")
    code, reason = exit_codes.DONE, ""
    with PointsProgress(quiet=is_quiet()) as progress:
        try:
            dataset = _sweep(ctx, scene, target, scheduler, progress, given)
        except (Exception, KeyboardInterrupt) as error:
            dataset, code, reason = partial_result(ctx, error)
    return _report(ctx, dataset, target, progress, code, reason, strict=strict)


def _complete(ctx: click.Context, given: dict[str, Any], scheduler: str | None) -> None:
    """Refuse options that have no meaning without another; set the defaults of samples."""
    for name, default in (("design", "lhs"), ("seed", 0)):
        if given[name] is None:
            given[name] = default
        elif given["sample"] is None:
            raise click.UsageError(f"--{name} is of samples: give --sample N as well", ctx)
    if scheduler is not None and given["threads"] is not None:
        text = "--threads is of this machine; with --scheduler the workers have their own"
        raise click.UsageError(text, ctx)


def _sweep(
    ctx: click.Context,
    scene: "Scene",
    target: Path,
    scheduler: str | None,
    progress: "PointsProgress",
    given: dict[str, Any],
) -> "xarray.Dataset":
    """The sweep; refused if it cannot begin."""
    import dap3d_core as dap
    from dap3d_core.result import Computed, ResultError

    settings = {name: value for name, value in given.items() if name not in ("vary", "keep")}
    client = None
    try:
        if scheduler is not None:
            from dap3d_core.study.workers.dask_cluster import connect

            client = connect(scheduler)
        return dap.sweep(
            scene, given["vary"], outputs=given["keep"], client=client, output=target,
            progress=signals_of(ctx).interruptible(progress.count),
            announce=progress.announce, **settings,
        )  # fmt: skip
    except dap.SceneError as error:
        raise _in_options(error, given) from error
    except (dap.SimulationError, ResultError) as error:
        if Computed.of(error).result is not None:
            raise
        raise Refused(str(error)) from error
    finally:
        if client is not None:
            client.close()


def _in_options(error: "SceneError", given: dict[str, Any]) -> "SceneError":
    """The same mistakes under the names of the options."""
    import attrs

    from dap3d_core.scene import SceneError

    names = {name: option for name, option in OPTIONS.items() if given.get(name) is not None}
    names |= options.of_settings(given) | {"outputs": OPTIONS["outputs"]}
    renamed = options.in_options(error, names)
    return SceneError(
        attrs.evolve(m, key=f"--{m.key}") if m.key.startswith("vary ") else m
        for m in renamed.mistakes
    )


def _report(
    ctx: click.Context,
    dataset: "xarray.Dataset",
    target: Path,
    progress: "PointsProgress",
    code: int,
    reason: str,
    *,
    strict: bool,
) -> int:
    """Report a sweep; returns the exit code."""
    from dap3d_core.cli.console.console import print_json, stderr, stdout
    from dap3d_core.cli.console.sweep_tables import show_failing, show_sweep, sweep_data

    file = target.with_name(f"{target.name}.part") if reason else target
    data = sweep_data(dataset)
    data["wall_time_s"] = progress.elapsed
    data["points_per_second"] = progress.ran / progress.elapsed if progress.elapsed else None
    if not reason and data["failed"] == data["points"]:
        code, reason = exit_codes.PARTIAL, "all points failed"
    elif not reason and strict and data["stopped"] + data["failed"]:
        code = exit_codes.FAILED
    console = stderr()
    if prints_json():
        print_json({"file": str(file), **data, "reason": reason, "exit_code": code})
    else:
        if not is_quiet():
            show_sweep(stdout(), data, str(file))
        show_failing(console, data, f"dap3d info {shlex.quote(str(file))} --json has them")
    if reason:
        console.say(reason, "bold red")
    if file != target:
        console.say(f"what was computed until then is in {file}; to continue:", whole=True)
        words = [w for w in ctx.meta["dap3d.words"] if w != "--resume"]
        command = shlex.join(["dap3d", "sweep", *words, "--resume"])
        console.say(command, "green", indent=2, whole=True)
    if strict and code == exit_codes.FAILED:
        console.say("--strict: points went wrong; exit code 1")
    return code
