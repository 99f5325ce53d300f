"""``dap3d resume``: continues an interrupted run."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import refusing

if TYPE_CHECKING:
    from dap3d_core.cli.framework.execute import Announce, Watch
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel


@command(
    "Continue an interrupted run.",
    click.argument("checkpoint", type=click.Path()),
    options.output("Result file; by default that of the run, next to the checkpoint."),
    click.option("--checkpoint", "every", type=options.Seconds(), metavar="EVERY", default=math.inf,
                 help="Write a checkpoint so often: 90, 5min, 2h."),
    options.MODEL_OF_RESULT, options.ALLOW_CODE, options.STRICT, options.FORCE, options.JSON,
    options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def resume(
    ctx: click.Context,
    checkpoint: str,
    output: str | None,
    every: float,
    model: str | None,
    *,
    allow_code: bool,
    strict: bool,
    force: bool,
) -> int:
    """Continue a run from its CHECKPOINT.

    A run that is ended by Ctrl-C or SIGTERM leaves RESULT.checkpoint next to its result; with
    --checkpoint it writes one at intervals, from which a run that was killed continues. The result
    is that of an uninterrupted run, bit for bit.
    """
    from dap3d_core.cli.console.run_summary import report_run
    from dap3d_core.cli.framework.execute import execute
    from dap3d_core.cli.framework.paths import RESULTS, writable
    from dap3d_core.result import ResultError
    from dap3d_core.simulation import CheckpointError
    from dap3d_core.simulation.resume import ResumedRun

    resumed: list[ResumedRun] = []

    def prepare(announce: "Announce") -> "CompiledModel":
        with refusing(ResultError):
            resumed.append(
                ResumedRun(checkpoint, model=model, allow_code=allow_code, announce=announce)
            )
        return resumed[0].compiled

    def run(_: "CompiledModel", announce: "Announce", watch: "Watch") -> "Result":
        if output is not None:
            writable(Path(output), force=force, sources=(Path(checkpoint),), kinds=RESULTS)
        with refusing(CheckpointError):  # a fault of the file that shows as it is restored
            return resumed[0].execute(output, force=force, checkpoint=every, watch=watch)

    outcome = execute(ctx, prepare, run)
    target = Path(output) if output is not None else resumed[0].output
    return report_run(outcome, checkpoint, target, strict=strict)
