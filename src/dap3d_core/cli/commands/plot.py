"""``dap3d plot``: quantities of results as curves, sweeps as maps, in a file or a window."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing

ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")
MM_PER_INCH = 25.4
#: Suffix that distinguishes results from quantities.
SUFFIX = ".nc"


@command(
    "Draw curves of results, maps of sweeps.",
    options.RESULT,
    click.argument("quantities", metavar="[RESULT | QUANTITY]...", nargs=-1,
                   shell_complete=completion.quantities),
    options.output("Picture: .png, .svg or .pdf; RESULT.png by default."),
    click.option("--x", metavar="QUANTITY", shell_complete=completion.quantities,
                 help="Abscissa of the curves; time by default. Of a sweep a parameter or an "
                      "output."),
    click.option("--at", metavar="NAME=VALUE", multiple=True,
                 help="Of a sweep: only the points nearest to this value of a parameter; may be "
                      "given several times."),
    click.option("--show", is_flag=True, help="Open a window; writes a file only with -o."),
    click.option("--width", type=float, metavar="MM",
                 help="Width of the picture in mm; 97 by default, good down to 60."),
    click.option("--height", type=float, metavar="MM",
                 help="Height in mm; what fits by default."),
    options.FORCE, options.MODEL_OF_RESULT, options.ALLOW_CODE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
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
    **types: Any,
) -> int:
    """Draw quantities of a RESULT, or outputs of a sweep: by default energies or all outputs.

    \b
    BODY.r .p .rd .w .wp .rdd .wd .wpd  of a body; .roll .pitch .yaw as in rpy
    POINT.r .v .a                       of a point
    JOINT.force .moment .lambda         reactions on body i
    JOINT.j.force                       on the body of slot j
    JOINT.force_body .moment_body       in body axes; .moment_at_point: its own point
    JOINT.angle .length .q1 .q1_dot     its coordinates, rates; .angle_rate .length_rate
    FORCE.length .tension .energy       of a spring
    energy.kinetic .potential .total    and work, t, [outputs] of the scene
    constraint.position .velocity .acceleration

    A component follows with another dot, crank.r.z; .norm is the length of a vector. Quantities of
    different units get panels of their own.

    \b
    dap3d plot pen1.nc cone.r.z J1.force.norm
    dap3d plot pen1.nc cone.r.y --x cone.r.x    a path
    dap3d plot a.nc b.nc cone.r.z               two runs

    Words that end in .nc are further results, drawn in the same figure. A sweep is
    drawn as lines over one number, a map over two, parallel coordinates over more.

    \b
    dap3d plot pen1-sweep.nc cone.r.z:max
    dap3d plot pen1-sweep.nc --at bodies.cone.mass=2
    dap3d plot pen1-sweep.nc cone.r.z:max --x bodies.cone.mass
    """
    from dap3d_core.cli.console.console import show_written

    files = [result, *(word for word in quantities if word.endswith(SUFFIX))]
    data, names, cuts = _open(files, quantities, x, at, types)
    target = None if show and output is None else Path(output or Path(result).stem + ".png")
    axes: dict[str, Any] = {"x": x, "at": cuts}
    size: dict[str, Any] = {"width": _inches(width), "height": _inches(height)}
    earlier = _notes_of(data)
    _check(data, names, target, axes, size, files, force)
    _draw(data, names, target, show, force, **axes, **size)
    if target is not None:
        about = {"results": files, "quantities": names} | _drawn(data, axes)
        notes = [note for note in _notes_of(data) if note not in earlier]
        show_written(target, ", ".join(names), about, notes)
    return DONE


def _drawn(data: Any, axes: dict[str, Any]) -> dict[str, Any]:
    """The axes of a sweep, the abscissa of a result."""
    return axes if hasattr(data, "data_vars") else {"x": axes["x"] or "t"}


def _notes_of(data: Any) -> list[str]:
    """The notes of the results that are drawn."""
    runs = list(data.values()) if isinstance(data, Mapping) else [data]
    return [note for run in runs for note in getattr(run, "notes", ())]


def _open(
    files: Sequence[str],
    words: tuple[str, ...],
    x: str | None,
    at: Sequence[str],
    types: Mapping[str, Any],
) -> tuple[Any, tuple[str, ...], dict[str, float]]:
    """The results or the sweep, the names to draw, and the cuts through a sweep."""
    from dap3d_core.cli.framework.paths import open_result, open_sweep
    from dap3d_core.study.sweep.dataset import is_sweep

    names = tuple(word for word in words if not word.endswith(SUFFIX))
    sweeps = [file for file in files if is_sweep(file)]
    if sweeps and len(files) > 1:
        raise Refused(f"{sweeps[0]} is a sweep, which is drawn alone")
    if sweeps:
        from dap3d_core.plot.sweep.sweep_table import table_of

        data = open_sweep(files[0])
        with refusing(ValueError):
            return data, names or table_of(data).default_outputs(x), _cuts(at)
    if at:
        raise Refused(f"--at chooses points of a sweep; {files[0]} is none")
    runs = {n: open_result(f, **types) for n, f in zip(_labels(files), files, strict=True)}
    return runs if len(runs) > 1 else runs.popitem()[1], names or ENERGIES, {}


def _cuts(at: Sequence[str]) -> dict[str, float]:
    """Parameters and the values to which they are fixed."""
    cuts: dict[str, float] = {}
    for word in at:
        name, _, value = (part.strip() for part in word.rpartition("="))
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not name or not math.isfinite(number):
            raise Refused(f"--at {word!r} should be NAME=VALUE, such as bodies.crank.mass=2")
        if name in cuts:
            raise Refused(f"--at {name} is given twice")
        cuts[name] = number
    return cuts


def _labels(files: Sequence[str]) -> list[str]:
    """Names of runs for the legend: as many parts of their paths as distinguish them."""
    paths = [Path(f).absolute() for f in files]
    if len(set(paths)) < len(files):
        raise Refused("a result is named twice; each run is drawn once")
    parts = [path.with_suffix("").parts for path in paths]
    for size in range(1, max(map(len, parts)) + 1):
        labels = ["/".join(p[-size:]) for p in parts]
        if len(set(labels)) == len(files):
            return labels
    return [str(f) for f in files]


def _check(
    data: Any,
    names: tuple[str, ...],
    target: Path | None,
    axes: Mapping[str, Any],
    size: Mapping[str, float | None],
    files: Sequence[str],
    force: bool,
) -> None:
    """Refuse what cannot be drawn or written, for all reasons at once."""
    from dap3d_core.cli.framework.paths import picture_checks, refuse_all
    from dap3d_core.plot.figure import picture_of
    from dap3d_core.plot.figure_file import SIDES

    def check_side(name: str, side: float | None) -> None:
        if side is not None and not SIDES[0] <= side <= SIDES[1]:
            least, most = (round(limit * MM_PER_INCH) for limit in SIDES)
            raise Refused(f"--{name} is from {least} to {most} mm, not {side * MM_PER_INCH:g}")

    checks: list[Callable[[], object]] = [partial(check_side, *side) for side in size.items()]
    if target is not None:
        checks += picture_checks(target, force=force, sources=tuple(map(Path, files)))
    if hasattr(data, "data_vars"):  # a sweep
        from dap3d_core.plot.sweep.sweep_table import table_of

        checks += [partial(table_of(data).check, name) for name in names]
        checks += [partial(picture_of, data, names, axes["x"], axes["at"])]
    else:
        checks += [partial(picture_of, data, [name], None, None) for name in names]
        checks += [partial(picture_of, data, ["t"], axes["x"], None)]
    refuse_all(*checks)


def _draw(
    data: Any, names: tuple[str, ...], target: Path | None, show: bool, force: bool, **settings: Any
) -> None:
    from dap3d_core.plot import WIDTH, save_plot, show_plot
    from dap3d_core.result import ResultError, UnknownNameError

    settings["width"] = settings["width"] or WIDTH
    if target is not None:
        with refusing(UnknownNameError, ValueError):
            save_plot(data, names, target, force=force, **settings)
    if show:
        with refusing(UnknownNameError, ResultError, ValueError):
            show_plot(data, names, **settings)


def _inches(mm: float | None) -> float | None:
    return None if mm is None else mm / MM_PER_INCH
