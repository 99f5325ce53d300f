"""``dap3d rerun``: repeats a run from its result, and compares."""

from typing import TYPE_CHECKING

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command, signals_of
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import refusing
from dap3d_core.cli.process.streams import is_quiet, prints_json

if TYPE_CHECKING:
    from dap3d_core.simulation.rerun import Reproduction


@command(
    "Repeat a run from its result, and compare.",
    options.RESULT, options.MODEL_OF_RESULT, options.ALLOW_CODE, options.JSON, options.QUIET,
)  # fmt: skip
@click.pass_context
def rerun(ctx: click.Context, result: str, model: str | None, *, allow_code: bool) -> int:
    """Repeat the run of a RESULT and compare, bit for bit.

    The scene, the settings and the versions that made it are in the result; no other file is
    needed. Exit code 0 where all arrays are equal, 1 where they are not. Nothing is written.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json
    from dap3d_core.cli.console.progress import ProgressBar
    from dap3d_core.cli.framework.paths import open_result
    from dap3d_core.result import ResultError

    first = open_result(result)
    with ProgressBar(quiet=is_quiet()) as progress, refusing(ResultError):
        watch = signals_of(ctx).interruptible(progress.advance)
        repetition = dap.rerun(
            first, model=model, allow_code=allow_code, watch=watch, announce=progress.announce
        )
    code = exit_codes.DONE if repetition.equal else exit_codes.FAILED
    if prints_json():
        data = {name: getattr(repetition, name) for name in ("equal", "instants", "differences")}
        versions = {n: {"result": a, "here": b} for n, (a, b) in repetition.versions.items()}
        about = {"types": repetition.types, "versions": versions, "exit_code": code}
        print_json({"file": result, **data, **about})
    else:
        _show(repetition, result)
    return code


def _show(repetition: "Reproduction", result: str) -> None:
    from dap3d_core.cli.console.console import stderr, stdout

    compared = f"{repetition.instants:,} instants compared"
    console = stderr()
    if not repetition.equal:
        console.say(f"{result}: repeated, not equal; {compared}", "bold red")
        console.items([f"{n}: differs by up to {x:.3g}" for n, x in repetition.differences.items()])
    elif not is_quiet():
        stdout().say(f"{result}: repeated, equal bit for bit; {compared}", "green")
    if repetition.types:
        console.say(f"the formulas of {', '.join(repetition.types)} have changed since")
    if not repetition.equal and repetition.versions:
        other = [f"{name} {a}, here {b}" for name, (a, b) in repetition.versions.items()]
        console.say(f"it was made with other versions: {'; '.join(other)}")
