"""``dap3d sweep``: run a model at many combinations of its numbers."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import models as complete_models
from dap3d_core.cli.framework.completion import numbers as complete_numbers
from dap3d_core.cli.framework.options import (
    ALLOW_CODE,
    JSON,
    QUIET,
    SETTING_OPTIONS,
    SETTINGS,
    in_options,
    with_options,
)
from dap3d_core.cli.framework.paths import named_after
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused

if TYPE_CHECKING:
    import xarray

    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.scene import SceneError

#: What the command line calls the arguments of ``dap.sweep``.
OPTIONS = SETTINGS | {
    "vary": "--vary",
    "outputs": "--keep",
    "sample": "--sample",
    "design": "--design",
    "seed": "--seed",
    "threads": "--threads",
    "pack": "--pack",
}

_OPTIONS = (
    click.option("--vary", multiple=True, metavar="NUMBER=FORM", shell_complete=complete_numbers,
                 help="A number that varies: bodies.crank.mass=1:5:9 (from:to:count), 1:100:5:log, "
                      "10,50,100; may be given again. Samples: 1:5, 1:100:log, 3~0.1 "
                      "(mean~deviation), 10,50,100."),
    click.option("--keep", multiple=True, metavar="QUANTITY[:WHAT]",
                 help="What is kept of each run: crank.r.z:max; end (by default), min, max, mean "
                      "or series; may be given again."),
    click.option("--sample", type=int, metavar="N",
                 help="Run N samples instead of the grid of all combinations."),
    click.option("--design", metavar="NAME", default=None,
                 help="How samples are drawn: lhs (by default), random, sobol, halton."),
    click.option("--seed", type=int, metavar="S", default=None,
                 help="Seed of the samples; 0 by default."),
    click.option("-o", "--output", type=click.Path(), metavar="FILE",
                 help="File of the sweep; MODEL-sweep.nc in the current folder by default."),
    *SETTING_OPTIONS,
    click.option("--threads", type=int, metavar="N",
                 help="Points that run at once; by default one for each core."),
    click.option("--pack", type=int, metavar="N", default=1,
                 help="N points take their steps together: small scenes gain about 2 times; equal "
                      "to single runs within the tolerances only."),
    click.option("--scheduler", metavar="ADDRESS",
                 help="Run the points on the dask cluster of this scheduler: tcp://node7:8786."),
    click.option("--resume", is_flag=True,
                 help="Go on with FILE.part of a sweep that was ended."),
    click.option("--strict", is_flag=True, help="Exit with 1 if a point went wrong."),
    click.option("--force", is_flag=True,
                 help="Overwrite an existing file, and the part of another sweep."),
    ALLOW_CODE,
    JSON,
    QUIET,
)  # fmt: skip


@click.command(cls=Command, saves=True, short_help="Run a model at many values of its numbers.")
@click.argument("model", shell_complete=complete_models)
@with_options(*_OPTIONS)
@click.pass_context
def sweep(
    ctx: click.Context,
    /,
    model: str,
    *,
    output: str | None,
    scheduler: str | None,
    strict: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> int:
    """Run a MODEL at many combinations of its numbers and keep some numbers of each run.

    \b
    dap3d sweep pen1 --vary bodies.cone.mass=1:5:9 --keep cone.r.z:max
    dap3d sweep pen1 --vary bodies.cone.w.y=-10~1 --sample 100 --keep cone.r

    Numbers are named as in the scene file, a component behind a further dot: bodies.crank.mass,
    points.A.sPp.x, forces.spring.k, simulation.rtol. Quantities are named as for dap3d plot. Points
    that go wrong do not end the others; they are listed.

    Ctrl-C ends a sweep; what was computed stays in FILE.part, and --resume goes on from there.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.cli.framework.execute import what_is_left
    from dap3d_core.cli.framework.paths import writable

    _check_usage(ctx, given, scheduler)
    scene = dap.load(model)
    target = writable(
        named_after(model, output, "-sweep"), force=given["force"], sources=(scene.path,)
    )
    code, reason = exit_codes.DONE, ""
    with PointsProgress(quiet=quiet) as progress:
        try:
            dataset = _swept(ctx, scene, target, scheduler, progress, given)
        except (Exception, KeyboardInterrupt) as error:
            dataset, code, reason = what_is_left(ctx, error)
    return _tell(ctx, dataset, target, progress, code, reason, strict=strict, as_json=as_json,
                 quiet=quiet)  # fmt: skip


def _check_usage(ctx: click.Context, given: dict[str, Any], scheduler: str | None) -> None:
    """Refuse options that say nothing without another; fill in what is left out."""
    for name in ("design", "seed"):
        if given["sample"] is None and given[name] is not None:
            raise click.UsageError(f"--{name} is of samples: give --sample N as well", ctx)
    if scheduler is not None and given["threads"] is not None:
        words = "--threads is of this machine; with --scheduler the workers have their own"
        raise click.UsageError(words, ctx)
    given["design"] = "lhs" if given["design"] is None else given["design"]
    given["seed"] = 0 if given["seed"] is None else given["seed"]


def _swept(
    ctx: click.Context,
    scene: Any,
    target: Path,
    scheduler: str | None,
    progress: "PointsProgress",
    given: dict[str, Any],
) -> "xarray.Dataset":
    """The sweep; what cannot be begun is refused."""
    import dap3d_core as dap
    from dap3d_core.result import ResultError

    stopping = ctx.meta["dap3d.stopping"]
    asked = dict(given)
    vary, keep = asked.pop("vary"), asked.pop("keep")

    def count(done: int, total: int) -> None:
        progress.count(done, total)
        stopping.between_chunks()

    client = None
    try:
        if scheduler is not None:
            from dap3d_core.study.workers.dask_cluster import connect

            client = connect(scheduler)
        return dap.sweep(
            scene, vary, outputs=keep, client=client, output=target, progress=count,
            announce=progress.announce, **asked,
        )  # fmt: skip
    except dap.SceneError as error:
        raise _in_options(error, given) from error
    except (dap.SimulationError, ResultError) as error:
        if getattr(error, "result", None) is not None:
            raise
        raise Refused(str(error)) from error
    finally:
        if client is not None:
            client.close()


def _in_options(error: "SceneError", given: dict[str, Any]) -> "SceneError":
    """The same mistakes under the names of the options."""
    import attrs

    from dap3d_core.scene import SceneError

    said = {name for name, value in given.items() if value is not None} | {"outputs"}
    said |= {"step"} if "integrator" in said else set()
    renamed = in_options(error, said, OPTIONS)
    return SceneError(
        attrs.evolve(m, key=f"--{m.key}") if m.key.startswith("vary ") else m
        for m in renamed.mistakes
    )


def _tell(
    ctx: click.Context,
    dataset: "xarray.Dataset",
    target: Path,
    progress: "PointsProgress",
    code: int,
    reason: str,
    *,
    strict: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Tell how a sweep ended; returns the exit code."""
    from dap3d_core.cli.console.console import messages, output, print_json, say
    from dap3d_core.cli.console.sweep_tables import show_failing, show_sweep, sweep_facts

    file = target.with_name(f"{target.name}.part") if reason else target
    found = sweep_facts(dataset)
    found["wall_time_s"] = progress.elapsed
    found["points_per_second"] = progress.ran / progress.elapsed if progress.elapsed else None
    wrong = found["stopped"] + found["failed"]
    if not reason and found["failed"] == found["points"]:
        code, reason = exit_codes.PARTIAL, "all points failed"
    elif not reason and strict and wrong:
        code = exit_codes.FAILED
    if as_json:
        print_json({"file": str(file), **found, "reason": reason, "exit_code": code})
    elif not quiet:
        show_sweep(output(), found, str(file))
    console = messages()
    if not as_json:
        others = f"dap3d info {shlex.quote(str(file))} --json has them"
        show_failing(console, found, others)
    if reason:
        say(console, reason, "bold red")
    if file != target:
        say(console, f"what was computed until then is in {file}; to go on from there:", whole=True)
        words = [w for w in ctx.meta["dap3d.words"] if w != "--resume"]
        command = shlex.join(["dap3d", "sweep", *words, "--resume"])
        say(console, command, "green", indent=2, whole=True)
    if strict and code == exit_codes.FAILED:
        say(console, "--strict: points went wrong; exit code 1")
    return code
