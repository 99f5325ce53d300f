"""``dap3d rerun``: make a run again from its result, and compare."""

from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.exit_codes import Refused

if TYPE_CHECKING:
    from dap3d_core.simulation import Standing
    from dap3d_core.simulation.rerun import Repetition


@click.command(cls=Command, short_help="Make a run again from its result, and compare.")
@click.argument("result", type=click.Path())
@click.option("--model", metavar="MODEL", help="The model whose own types the run used.")
@click.option("--allow-code", is_flag=True,
              help="Allow the model's own types (plugin.py in its folder) to run.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
@click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")
@click.pass_context
def rerun(
    ctx: click.Context,
    result: str,
    model: str | None,
    *,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Make the run of a RESULT again and compare, bit for bit.

    The scene, the settings and the versions that made it are in the result; no other file is
    needed. Exit code 0 where all arrays are equal, 1 where they are not. Nothing is written.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json
    from dap3d_core.cli.console.progress import RunProgress
    from dap3d_core.cli.framework.paths import open_result
    from dap3d_core.result import ResultError

    first, stopping = open_result(result), ctx.meta["dap3d.stopping"]
    with RunProgress(quiet=quiet) as progress:

        def watch(standing: "Standing") -> None:
            progress.advance(standing)
            stopping.between_chunks()

        try:
            found = dap.rerun(
                first, model=model, allow_code=allow_code, watch=watch, announce=progress.announce
            )
        except ResultError as error:
            raise Refused(str(error)) from error
    code = exit_codes.DONE if found.equal else exit_codes.FAILED
    if as_json:
        print_json({"file": result, **_facts(found), "exit_code": code})
    else:
        _show(found, result, quiet=quiet)
    return code


def _facts(found: "Repetition") -> dict[str, Any]:
    return {
        "equal": found.equal,
        "instants": found.instants,
        "differences": found.differences,
        "types": found.types,
        "versions": {n: {"result": a, "here": b} for n, (a, b) in found.versions.items()},
    }


def _show(found: "Repetition", result: str, *, quiet: bool) -> None:
    from dap3d_core.cli.console.console import items, messages, output, say

    compared = f"{found.instants:,} instants compared"
    console = messages()
    if found.equal:
        if not quiet:
            say(output(), f"{result}: made again, equal bit for bit; {compared}", "green")
        _show_types(found)
        return
    say(console, f"{result}: made again, not equal; {compared}", "bold red")
    items(console, [f"{name}: differs by up to {x:.3g}" for name, x in found.differences.items()])
    _show_types(found)
    other = [f"{name} {a}, here {b}" for name, (a, b) in found.versions.items()]
    if other:
        say(console, f"it was made with other versions: {'; '.join(other)}")


def _show_types(found: "Repetition") -> None:
    from dap3d_core.cli.console.console import messages, say

    if found.types:
        say(messages(), f"the formulas of {', '.join(found.types)} have changed since")
