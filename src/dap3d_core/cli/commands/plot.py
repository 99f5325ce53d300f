"""``dap3d plot``: quantities of results as curves, sweeps as maps, in a file or a window."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import quantities as complete_quantities
from dap3d_core.cli.framework.completion import results as complete_results
from dap3d_core.cli.framework.options import ALLOW_CODE, JSON, QUIET
from dap3d_core.cli.process.exit_codes import DONE, Refused

ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")
MM_PER_INCH = 25.4
#: Ending of result files, by which a word is told from a quantity.
ENDING = ".nc"


@click.command(cls=Command, saves=True, short_help="Draw curves of results, maps of sweeps.")
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
    help="What the curves are drawn over; time by default. Of a sweep a number or an output.",
)
@click.option(
    "--at",
    metavar="NAME=VALUE",
    multiple=True,
    help="Of a sweep: only the points nearest to this value of a number; may be given several "
    "times.",
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
@click.option("--model", metavar="MODEL", help="The model whose own types (plugin.py) were used.")
@ALLOW_CODE
@JSON
@QUIET
def plot(
    result: str,
    quantities: tuple[str, ...],
    *,
    output: str | None,
    x: str | None,
    at: tuple[str, ...],
    show: bool,
    width: float | None,
    height: float | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    **types: Any,
) -> int:
    """Draw quantities of a RESULT, or outputs of a sweep.

    Without any, the energies of a result and all outputs of a sweep.

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

    A sweep is drawn as lines over one number, a map over two, parallel coordinates over more.

    \b
    dap3d plot pen1-sweep.nc cone.r.z:max
    dap3d plot pen1-sweep.nc --at bodies.cone.mass=2
    dap3d plot pen1-sweep.nc cone.r.z:max --x bodies.cone.mass
    """
    files = [result, *(word for word in quantities if word.endswith(ENDING))]
    names = tuple(w for w in quantities if not w.endswith(ENDING))
    shown, names, cuts = _opened(files, names, x, at, types)
    target = None if show and output is None else Path(output or Path(result).stem + ".png")
    over: dict[str, Any] = {"x": x, "at": cuts}
    size = _inches(width), _inches(height)
    _check(shown, names, target, over, {"--width": size[0], "--height": size[1]}, files, force)
    _draw(shown, names, target, over, show, size, force)
    if target is not None:
        along = over if hasattr(shown, "data_vars") else {"x": x or "t"}
        _tell({"file": str(target), "results": files, "quantities": names} | along, as_json, quiet)
    return DONE


def _tell(found: dict[str, Any], as_json: bool, quiet: bool) -> None:
    from dap3d_core.cli.console.console import output as output_console
    from dap3d_core.cli.console.console import print_json, say

    if as_json:
        print_json(found)
    elif not quiet:
        say(output_console(), f"{found['file']} written", whole=True)


def _opened(
    files: Sequence[str],
    names: tuple[str, ...],
    x: str | None,
    at: Sequence[str],
    types: Mapping[str, Any],
) -> tuple[Any, tuple[str, ...], dict[str, float]]:
    """What is drawn, the names in it, and where a sweep is cut.

    Raises:
        Refused: a file cannot be read; a sweep beside other files; a cut that is none.
    """
    from dap3d_core.cli.framework.paths import open_result, open_sweep
    from dap3d_core.study.sweep.dataset import is_sweep

    sweeps = [file for file in files if is_sweep(file)]
    if sweeps and len(files) > 1:
        raise Refused(f"{sweeps[0]} is a sweep, which is drawn alone")
    if sweeps:
        from dap3d_core.plot.sweep.sweep_table import table_of

        data = open_sweep(files[0])
        try:
            return data, names or table_of(data).usual(x), _cuts(at)
        except ValueError as error:
            raise Refused(str(error)) from error
    if at:
        raise Refused(f"--at chooses points of a sweep; {files[0]} is none")
    runs = dict(zip(_told_apart(files), (open_result(f, **types) for f in files), strict=True))
    return runs if len(runs) > 1 else runs.popitem()[1], names or ENERGIES, {}


def _cuts(at: Sequence[str]) -> dict[str, float]:
    """Numbers and the values they are held at."""
    found: dict[str, float] = {}
    for word in at:
        name, _, value = word.rpartition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not name.strip() or not math.isfinite(number):
            raise Refused(f"--at {word!r} should be NAME=VALUE, such as bodies.crank.mass=2")
        if name.strip() in found:
            raise Refused(f"--at {name.strip()} is given twice")
        found[name.strip()] = number
    return found


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
    shown: Any,
    names: tuple[str, ...],
    target: Path | None,
    over: Mapping[str, Any],
    sizes: Mapping[str, float | None],
    files: Sequence[str],
    force: bool,
) -> None:
    """Refuse what cannot be drawn or written, for all reasons at once."""
    from dap3d_core.cli.framework.paths import refuse_all, writable
    from dap3d_core.plot.figure import SIDES, check_suffix, painting

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
    if hasattr(shown, "data_vars"):
        from dap3d_core.plot.sweep.sweep_table import table_of

        checks += [partial(table_of(shown).check, name) for name in names]
        checks += [partial(painting, shown, names, over["x"], over["at"])]
    else:
        checks += [partial(painting, shown, [name], None, None) for name in names]
        checks += [partial(painting, shown, ["t"], over["x"], None)]
    refuse_all(*checks)


def _draw(
    shown: Any,
    names: tuple[str, ...],
    target: Path | None,
    over: Mapping[str, Any],
    show: bool,
    size: tuple[float | None, float | None],
    force: bool,
) -> None:
    from dap3d_core.plot import WIDTH, save_plot, show_plot
    from dap3d_core.result import ResultError, UnknownNameError

    width, height = size[0] or WIDTH, size[1]
    try:
        if target is not None:
            save_plot(shown, names, target, **over, width=width, height=height, force=force)
    except (UnknownNameError, ValueError) as error:
        raise Refused(str(error)) from error
    if not show:
        return
    try:
        show_plot(shown, names, **over, width=width, height=height)
    except (UnknownNameError, ResultError, ValueError) as error:
        raise Refused(str(error)) from error
