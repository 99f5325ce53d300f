"""``dap3d resume``: go on with a run that was ended."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.execute import Seconds, carry_out
from dap3d_core.cli.process.exit_codes import Refused

if TYPE_CHECKING:
    from dap3d_core.cli.framework.execute import Announce, Watch
    from dap3d_core.result import Result
    from dap3d_core.simulation import CompiledModel
    from dap3d_core.simulation.resume import Resumption


@click.command(cls=Command, saves=True, short_help="Go on with a run that was ended.")
@click.argument("checkpoint", type=click.Path())
@click.option("-o", "--output", type=click.Path(), metavar="FILE",
              help="Result file; by default that of the run, beside the checkpoint.")  # fmt: skip
@click.option("--checkpoint", "every", type=Seconds(), metavar="EVERY", default=math.inf,
              help="Write a checkpoint so often: 90, 5min, 2h.")  # fmt: skip
@click.option("--model", metavar="MODEL", help="The model whose own types the run uses.")
@click.option("--allow-code", is_flag=True,
              help="Allow the model's own types (plugin.py in its folder) to run.")  # fmt: skip
@click.option("--strict", is_flag=True,
              help="Exit with 1 if there are warnings or the ledger does not close.")  # fmt: skip
@click.option("--force", is_flag=True, help="Overwrite an existing result.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
@click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")
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
    as_json: bool,
    quiet: bool,
) -> int:
    """Go on with a run from its CHECKPOINT.

    A run that is ended by Ctrl-C or SIGTERM leaves RESULT.checkpoint beside its result; with
    --checkpoint it writes one now and then, from which a run that was killed goes on. The result is
    that of a run that was not ended, bit for bit.
    """
    from dap3d_core.cli.console.run_outcome import tell
    from dap3d_core.cli.framework.paths import writable
    from dap3d_core.result import ResultError
    from dap3d_core.simulation import CheckpointError
    from dap3d_core.simulation.resume import resumption

    found: list[Resumption] = []

    def prepare(announce: "Announce") -> "CompiledModel":
        try:
            found.append(
                resumption(checkpoint, model=model, allow_code=allow_code, announce=announce)
            )
        except ResultError as error:
            raise Refused(str(error)) from error
        return found[0].compiled

    def go(announce: "Announce", watch: "Watch") -> "Result":
        if output is not None:
            writable(Path(output), force=force, sources=(Path(checkpoint),))
        try:
            return found[0].go(output, force=force, checkpoint=every, watch=watch)
        except CheckpointError as error:  # what is wrong with the file shows as it is restored
            raise Refused(str(error)) from error

    outcome = carry_out(ctx, prepare, go, quiet=quiet)
    target = Path(output) if output is not None else found[0].output
    return tell(outcome, checkpoint, target, strict=strict, as_json=as_json, quiet=quiet)
