"""``dap3d plot``: quantities of results as curves, in a file or a window."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.completion import quantities as complete_quantities
from dap3d_core.cli.completion import results as complete_results
from dap3d_core.cli.exits import DONE, Refused
from dap3d_core.cli.group import Command

if TYPE_CHECKING:
    from dap3d_core.result import Result

ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")
MM_PER_INCH = 25.4
#: Ending of result files, by which a word is told from a quantity.
ENDING = ".nc"


@click.command(cls=Command, short_help="Draw curves of results.")
@click.argument("result", shell_complete=complete_results)
@click.argument(
    "quantities", metavar="[RESULT | QUANTITY]...", nargs=-1, shell_complete=complete_quantities
)
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    metavar="FILE",
    help="Picture: .png, .svg or .pdf; RESULT.png by default.",
)
@click.option(
    "--x",
    metavar="QUANTITY",
    shell_complete=complete_quantities,
    help="What the curves are drawn over; time by default.",
)
@click.option("--show", is_flag=True, help="Open a window; writes a file only with -o.")
@click.option(
    "--width",
    type=float,
    metavar="MM",
    help="Width of the picture in mm; 97 by default, good down to 60.",
)
@click.option("--height", type=float, metavar="MM", help="Height in mm; what fits by default.")
@click.option("--force", is_flag=True, help="Overwrite an existing picture.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
def plot(
    result: str,
    quantities: tuple[str, ...],
    *,
    output: str | None,
    x: str | None,
    show: bool,
    width: float | None,
    height: float | None,
    force: bool,
    as_json: bool,
) -> int:
    """Draw quantities of a RESULT; without any, its energies.

    \b
    BODY.r .p .rd .w .wp .rdd .wd .wpd  of a body
    POINT.r .v .a                       of a point
    JOINT.force .moment .lambda         reactions on body i
    JOINT.j.force                       on the body of slot j
    JOINT.force_body .moment_body       in body axes
    JOINT.moment_at_point               about its own point
    FORCE.length .tension .energy       of a spring
    energy.kinetic .potential .total    and work
    constraint.position .velocity .acceleration

    A component follows with another dot, crank.r.z; .norm is the length of a vector. Quantities of
    different units get panels of their own.

    \b
    dap3d plot pen1.nc cone.r.z J1.force.norm
    dap3d plot pen1.nc cone.r.y --x cone.r.x    a path
    dap3d plot a.nc b.nc cone.r.z               two runs

    Words that end in .nc are further results, drawn in the same figure.
    """
    from dap3d_core.cli.files import open_result
    from dap3d_core.cli.rendering import output as output_console
    from dap3d_core.cli.rendering import print_json, say

    files = [result, *(word for word in quantities if word.endswith(ENDING))]
    names = tuple(w for w in quantities if not w.endswith(ENDING)) or ENERGIES
    runs = dict(zip(_told_apart(files), map(open_result, files), strict=True))
    shown: Mapping[str, Result] | Result = runs if len(runs) > 1 else runs.popitem()[1]
    target = None
    if output is not None or not show:
        target = Path(output or Path(result).stem + ".png")
    size = _inches(width), _inches(height)
    _check(shown, names, target, x, {"--width": size[0], "--height": size[1]}, files, force)
    _draw(shown, names, target, x, show, size, force)
    if target is not None and as_json:
        print_json({"file": str(target), "results": files, "quantities": names, "x": x or "t"})
    elif target is not None:
        say(output_console(), f"{target} written", whole=True)
    return DONE


def _told_apart(files: Sequence[str]) -> list[str]:
    """Names of runs for the legend: their files without what all have in common.

    Raises:
        Refused: a file is named twice.
    """
    if len({Path(f).absolute() for f in files}) < len(files):
        raise Refused("a result is named twice; each run is drawn once")
    parts = [Path(f).absolute().with_suffix("").parts for f in files]
    for size in range(1, max(map(len, parts)) + 1):
        names = ["/".join(p[-size:]) for p in parts]
        if len(set(names)) == len(files):
            return names
    return [str(f) for f in files]


def _inches(size: float | None) -> float | None:
    return None if size is None else size / MM_PER_INCH


def _check(
    runs: "Mapping[str, Result] | Result",
    names: tuple[str, ...],
    target: Path | None,
    x: str | None,
    sizes: Mapping[str, float | None],
    files: Sequence[str],
    force: bool,
) -> None:
    """Refuse what cannot be drawn or written, for all reasons at once."""
    from dap3d_core.cli.files import refuse_all, writable
    from dap3d_core.plot.drawing import gather
    from dap3d_core.plot.saving import SIDES, check_suffix

    def fits(option: str, size: float | None) -> None:
        if size is not None and not SIDES[0] <= size <= SIDES[1]:
            least, most = (round(side * MM_PER_INCH) for side in SIDES)
            raise Refused(f"{option} is from {least} to {most} mm, not {size * MM_PER_INCH:g}")

    sources = tuple(map(Path, files))
    checks: list[Callable[[], object]] = []
    checks += [partial(fits, option, size) for option, size in sizes.items()]
    if target is not None:
        checks += [partial(check_suffix, target)]
        checks += [partial(writable, target, force=force, sources=sources)]
    checks += [partial(gather, runs, [name], None) for name in names]
    refuse_all(*checks, partial(gather, runs, ["t"], x))


def _draw(
    runs: "Mapping[str, Result] | Result",
    names: tuple[str, ...],
    target: Path | None,
    x: str | None,
    show: bool,
    size: tuple[float | None, float | None],
    force: bool,
) -> None:
    from dap3d_core.plot import WIDTH, save_plot, show_plot
    from dap3d_core.result import ResultError, UnknownNameError

    width, height = size[0] or WIDTH, size[1]
    try:
        if target is not None:
            save_plot(runs, names, target, x=x, width=width, height=height, force=force)
        if show:
            show_plot(runs, names, x=x, width=width, height=height)
    except (UnknownNameError, ResultError, ValueError) as error:
        raise Refused(str(error)) from error
