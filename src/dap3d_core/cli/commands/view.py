"""``dap3d view``: a result or a sweep as a page with a moving scene, for any browser."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command, signals_of
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing


@command(
    "Make a page with the moving scene of a result.",
    options.RESULT,
    options.output("The page; RESULT.html by default."),
    click.option("--quantity", "quantities", metavar="QUANTITY", multiple=True,
                 help="A curve that is drawn at once; may be given several times."),
    options.FPS, options.MODEL_OF_RESULT, options.ALLOW_CODE,
    click.option("--open/--no-open", "opens", default=False, help="Open the page in a browser."),
    click.option("--play", is_flag=True, help="Let the scene move as the page opens."),
    options.FORCE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def view(
    ctx: click.Context,
    /,
    result: str,
    *,
    output: str | None,
    quantities: tuple[str, ...],
    fps: float | None,
    model: str | None,
    allow_code: bool,
    opens: bool,
    play: bool,
    force: bool,
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
    from dap3d_core.cli.console.console import show_written
    from dap3d_core.cli.console.progress import PointsProgress
    from dap3d_core.cli.framework.paths import output_path, writable
    from dap3d_core.result import UnknownNameError
    from dap3d_core.view import view as make_view

    target = output_path(result, output, ".html")
    if target.suffix.lower() not in (".html", ".htm"):
        raise Refused(f"cannot write {target}: a page is a .html file")
    check_target = partial(writable, target, force=force, sources=(Path(result),))
    data = _data(result, quantities, check_target, model=model, allow_code=allow_code)
    with PointsProgress() as progress, refusing(UnknownNameError, ValueError):
        count = signals_of(ctx).interruptible(progress.count)
        page = make_view(data, *quantities, fps=fps, play=play, model=model, allow_code=allow_code,
                         progress=count, announce=progress.announce)  # fmt: skip
    page.save(target, force=force)
    about = {"instants": page.instants, "quantities": list(page.data["asked"])}
    contents = f"{page.instants} instants"
    if "sweep" in page.data:
        about["points"] = len(page.data["sweep"]["points"])
        contents = f"{about['points']} points"
    show_written(target, contents, about, page.data["about"]["view_notes"])
    if opens:
        _open(target)
    return DONE


def _data(
    file: str, quantities: tuple[str, ...], check_target: Callable[[], object], **types: Any
) -> Any:
    """The result or the sweep in a file; refused together with other faults."""
    from dap3d_core.cli.framework.paths import open_result, open_sweep, refuse_all
    from dap3d_core.study.sweep.dataset import is_sweep

    if is_sweep(file):
        data: Any = open_sweep(file)
        check_target()
    else:
        data = open_result(file, **types)
        refuse_all(check_target, *(partial(data.quantity, name) for name in quantities))
    return data


def _open(target: Path) -> None:
    """Open the page; report if there is no browser, since the page is written all the same."""
    import webbrowser

    from dap3d_core.cli.console.console import stderr

    if not webbrowser.open(target.resolve().as_uri()):
        stderr().say(f"no browser could be started; open {target} in one", whole=True)
