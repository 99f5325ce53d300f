"""``dap3d view``: a result or a sweep as one page with a moving scene, which any browser opens."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.options import JSON, QUIET
from dap3d_core.cli.process.exit_codes import DONE, Refused

if TYPE_CHECKING:
    from dap3d_core.view import View


@click.command(cls=Command, saves=True, short_help="Make a page with the moving scene of a result.")
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
@JSON
@QUIET
@click.pass_context
def view(
    ctx: click.Context,
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
    quiet: bool,
) -> int:
    """Make a page of a RESULT or a sweep: the moving scene, plots, the ledger, settings.

    The page is one file. It opens from disk, loads nothing from a network and can be sent to
    others. Orbit with the mouse, play, scrub, follow a body, switch traces and arrows; the question
    mark shows its keys.

    \b
    dap3d view pen1.nc --open
    dap3d view pen1.nc -o tip.html --quantity cone.r.z --quantity J1.force.norm

    Quantities are named as for dap3d plot; more can be chosen in the page.

    Points of a sweep are run again, 50 of many, and chosen in the page by sliders.
    """
    from dap3d_core.cli.framework.paths import writable
    from dap3d_core.study.sweep.dataset import is_sweep

    target = Path(output) if output is not None else Path(Path(result).stem + ".html")
    if target.suffix.lower() not in (".html", ".htm"):
        raise Refused(f"cannot write {target}: a page is a .html file")
    free = partial(writable, target, force=force, sources=(Path(result),))
    if is_sweep(result):
        page = _of_sweep(ctx, result, free, quantities, fps, model, allow_code=allow_code,
                         quiet=quiet or as_json)  # fmt: skip
    else:
        page = _of_result(result, free, quantities, fps, model, allow_code=allow_code)
    page.save(target, force=force)
    _tell(page, target, as_json=as_json, quiet=quiet)
    if opens:
        _open(target)
    return DONE


def _tell(page: "View", target: Path, *, as_json: bool, quiet: bool) -> None:
    from dap3d_core.cli.console.console import items, messages, print_json, say, size
    from dap3d_core.cli.console.console import output as output_console

    points = len(page.data["sweep"]["points"]) if "sweep" in page.data else None
    notes, byte_count = page.data["about"]["view_notes"], target.stat().st_size
    if as_json:
        about: dict[str, Any] = {
            "file": str(target),
            "size_bytes": byte_count,
            "instants": page.instants,
        }
        about |= {} if points is None else {"points": points}
        print_json({**about, "quantities": list(page.data["asked"]), "notes": notes})
    elif not quiet:
        items(messages(), notes)
        contents = f"{page.instants} instants" if points is None else f"{points} points"
        say(output_console(), f"{target} written ({size(byte_count)}): {contents}", whole=True)


def _of_result(
    file: str,
    free: Callable[[], object],
    quantities: tuple[str, ...],
    fps: float | None,
    model: str | None,
    *,
    allow_code: bool,
) -> "View":
    """The page of a result."""
    from dap3d_core.cli.framework.paths import open_result, refuse_all
    from dap3d_core.result import UnknownNameError
    from dap3d_core.view import view as make_view

    opened = open_result(file, model=model, allow_code=allow_code)
    refuse_all(free, *(partial(opened.quantity, name) for name in quantities))
    try:
        return make_view(opened, *quantities, fps=fps, model=model)
    except (UnknownNameError, ValueError) as error:
        raise Refused(str(error)) from error


def _of_sweep(
    ctx: click.Context,
    file: str,
    free: Callable[[], object],
    quantities: tuple[str, ...],
    fps: float | None,
    model: str | None,
    *,
    allow_code: bool,
    quiet: bool,
) -> "View":
    """The page of a sweep, whose points are run again."""
    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.cli.framework.paths import open_sweep
    from dap3d_core.result import UnknownNameError
    from dap3d_core.view import view as make_view

    data = open_sweep(file)
    free()
    stopping = ctx.meta["dap3d.stopping"]

    def count(done: int, total: int) -> None:
        progress.count(done, total)
        stopping.between_chunks()

    with PointsProgress(quiet=quiet) as progress:
        try:
            return make_view(data, *quantities, fps=fps, model=model, allow_code=allow_code,
                             progress=count, announce=progress.announce)  # fmt: skip
        except (UnknownNameError, ValueError) as error:
            raise Refused(str(error)) from error


def _open(target: Path) -> None:
    """Show the page; where there is no browser, say so: the page is there all the same."""
    import webbrowser

    from dap3d_core.cli.console.console import messages, say

    if not webbrowser.open(target.resolve().as_uri()):
        say(messages(), f"no browser could be started; open {target} in one", whole=True)
