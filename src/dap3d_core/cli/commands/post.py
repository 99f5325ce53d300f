"""``dap3d post``: the arrays of the post-processor as a table or a file with named dimensions."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.framework import completion, options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing

if TYPE_CHECKING:
    from dap3d_core.result import Result

Names = tuple[str, ...]
FORMATS = {".nc": "nc", ".csv": "csv"}


@command(
    "Compute all arrays of a result.",
    options.RESULT,
    click.argument("quantities", metavar="[QUANTITY]...", nargs=-1,
                   shell_complete=completion.quantities),
    options.output("A .nc or a .csv file; RESULT-post.nc by default."),
    click.option("--format", "kind", type=click.Choice(tuple(FORMATS.values())),
                 help="Format, if the name of the file does not give it."),
    click.option("--select", "selected", metavar="QUANTITY...", multiple=True,
                 shell_complete=completion.quantities, help="Only these quantities."),
    click.option("--jacobian", "--jac", "jacobian", is_flag=True,
                 help="Also the constraint Jacobian."),
    options.MODEL_OF_RESULT, options.ALLOW_CODE, options.FORCE, options.JSON,
    saves=True,
)  # fmt: skip
def post(
    result: str,
    quantities: Names,
    *,
    output: str | None,
    kind: str | None,
    selected: Names,
    jacobian: bool,
    model: str | None,
    allow_code: bool,
    force: bool,
) -> int:
    """Compute the arrays of the manual's post-processor from a RESULT.

    r, p, rd, w, wp, rdd, wd, wpd of the bodies, rP, rPd, rPdd of the points (animation points
    last), Lam, energies, residuals, the reaction of every joint on each of its bodies in global and
    in body axes, coordinates of joints, outputs of the scene and, with --jacobian, Jac.

    A .csv file has the time and a column for each component with its unit, such as "crank.r.x [m]".
    A .nc file has the arrays with named dimensions and units.

    \b
    dap3d post pen1.nc -o pen1.csv
    dap3d post pen1.nc -o tip.csv --select cone.r.z J1.force.norm

    Quantities are named as for dap3d plot. --json lists what was written: names, shapes, units.
    """
    from dap3d_core.cli.console.console import show_written
    from dap3d_core.cli.framework.paths import open_result, refuse_all, writable
    from dap3d_core.result.quantities.netcdf_export import why_no_reactions

    target, kind = _target(result, output, kind)
    opened = open_result(result, model=model, allow_code=allow_code)
    names = tuple(dict.fromkeys((*selected, *quantities)))
    refuse_all(
        partial(
            writable,
            target,
            force=force,
            sources=(Path(result),),
            kinds=(f".{kind}",),
            any_name=True,
        ),
        *(partial(opened.quantity, name) for name in names),
    )
    earlier = len(opened.notes)
    left_out = "" if names else why_no_reactions(opened)
    notes = [f"reactions are left out: {left_out}"] if left_out else []
    write = _write_table if kind == "csv" else _write_arrays
    arrays = write(opened, target, names, not left_out, jacobian, force)
    notes += opened.notes[earlier:]
    instants = len(opened.t)
    contents = f"{instants} instants, {len(arrays)} {'columns' if kind == 'csv' else 'arrays'}"
    data = {"format": kind, "instants": instants, "arrays": arrays}
    show_written(target, contents, data, notes)
    return DONE


def _target(result: str, output: str | None, kind: str | None) -> tuple[Path, str]:
    """The file to write, and its format."""
    if output is None:
        kind = kind or "nc"
        return Path(f"{Path(result).stem}-post.{kind}"), kind
    target = Path(output)
    named = FORMATS.get(target.suffix.lower())
    if named is None and kind is None:
        raise Refused(f"cannot write {target}: name a .nc or a .csv file, or give --format")
    if kind is not None and named not in (None, kind):
        raise Refused(f"cannot write {target}: --format {kind} and its name differ; leave one out")
    return target, kind or str(named)


def _write_table(
    result: "Result", target: Path, names: Names, reactions: bool, jacobian: bool, force: bool
) -> list[dict[str, Any]]:
    """Write a CSV table; returns its columns."""
    from dap3d_core.result import ResultError, UnknownNameError
    from dap3d_core.result.quantities.csv_table import (
        columns_of,
        jacobian_columns,
        selected,
        write_csv,
    )

    with refusing(ResultError, UnknownNameError):
        columns = selected(result, names) if names else columns_of(result, reactions)
        more = jacobian_columns(result) if jacobian else []
    write_csv(result, target, columns, more, force=force)
    return [
        {"name": c.name, "dimensions": ["time"], "shape": [len(result.t)], "unit": c.unit}
        for c in (*columns, *more)
    ]


def _write_arrays(
    result: "Result", target: Path, names: Names, reactions: bool, jacobian: bool, force: bool
) -> list[dict[str, Any]]:
    """Write a NetCDF file; returns its arrays."""
    from dap3d_core.result import ResultError, UnknownNameError
    from dap3d_core.result.quantities.netcdf_export import (
        dataset_to_write,
        selection_of,
        write_netcdf,
    )

    with refusing(ResultError, UnknownNameError):
        if jacobian and result.summary.row_count:
            _ = result.evaluator
        dataset = selection_of(result, names) if names else dataset_to_write(result, reactions)
    return write_netcdf(result, target, dataset, jacobian=jacobian, force=force)
