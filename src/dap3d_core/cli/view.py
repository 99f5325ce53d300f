"""``dap3d view``: a result as one page with a moving scene, which any browser opens."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.exits import DONE, Refused
from dap3d_core.cli.group import Command

if TYPE_CHECKING:
    from dap3d_core.result import Result
    from dap3d_core.view import View


@click.command(cls=Command, short_help="Make a page with the moving scene of a result.")
@click.argument("result")
@click.option("-o", "--output", type=click.Path(), metavar="FILE",
              help="The page; RESULT.html by default.")  # fmt: skip
@click.option("--quantity", "quantities", metavar="QUANTITY", multiple=True,
              help="A curve that is drawn at once; may be given several times.")  # fmt: skip
@click.option("--fps", type=float, metavar="NUMBER",
              help="Frames a second; every reported instant by default.")  # fmt: skip
@click.option("--model", metavar="MODEL",
              help="The model whose own types (plugin.py) and meshes were used.")  # fmt: skip
@click.option("--allow-code", is_flag=True, help="Load the types of that model's plugin.py.")
@click.option("--open/--no-open", "opens", default=False, help="Open the page in a browser.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def view(
    result: str,
    *,
    output: str | None,
    quantities: tuple[str, ...],
    fps: float | None,
    model: str | None,
    allow_code: bool,
    opens: bool,
    force: bool,
    as_json: bool,
) -> int:
    """Make a page of a RESULT: the moving scene, plots, the ledger, settings.

    The page is one file. It opens from disk, loads nothing from a network and can be sent to
    others. Orbit with the mouse, play, scrub, follow a body, switch traces and arrows; the question
    mark shows its keys.

    \b
    dap3d view pen1.nc --open
    dap3d view pen1.nc -o tip.html --quantity cone.r.z --quantity J1.force.norm

    Quantities are named as for dap3d plot; more can be chosen in the page.
    """
    from dap3d_core.cli.files import open_result, refuse_all, writable
    from dap3d_core.cli.rendering import items, messages, print_json, say, size
    from dap3d_core.cli.rendering import output as output_console

    target = Path(output) if output is not None else Path(Path(result).stem + ".html")
    if target.suffix.lower() not in (".html", ".htm"):
        raise Refused(f"cannot write {target}: a page is a .html file")
    opened = open_result(result, model=model, allow_code=allow_code)
    refuse_all(
        partial(writable, target, force=force, sources=(Path(result),)),
        *(partial(opened.quantity, name) for name in quantities),
    )
    page = _made(opened, quantities, fps, model)
    page.save(target, force=force)
    notes, byte_count = page.data["about"]["view_notes"], target.stat().st_size
    if as_json:
        about = {"file": str(target), "size_bytes": byte_count, "instants": page.instants}
        print_json({**about, "quantities": list(page.data["asked"]), "notes": notes})
    else:
        items(messages(), notes)
        contents = f"{page.instants} instants"
        say(output_console(), f"{target} written ({size(byte_count)}): {contents}", whole=True)
    if opens:
        _open(target)
    return DONE


def _made(result: "Result", names: tuple[str, ...], fps: float | None, model: str | None) -> "View":
    from dap3d_core.result import UnknownNameError
    from dap3d_core.view import view as make_view

    try:
        return make_view(result, *names, fps=fps, model=model)
    except (UnknownNameError, ValueError) as error:
        raise Refused(str(error)) from error


def _open(target: Path) -> None:
    """Show the page; where there is no browser, say so: the page is there all the same."""
    import webbrowser

    from dap3d_core.cli.rendering import messages, say

    if not webbrowser.open(target.resolve().as_uri()):
        say(messages(), f"no browser could be started; open {target} in one", whole=True)
