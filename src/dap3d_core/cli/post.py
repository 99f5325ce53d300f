"""``dap3d post``: the post-processor's arrays as a table or a file with named dimensions."""

from pathlib import Path

import click

from dap3d_core.cli.exits import DONE, Refused
from dap3d_core.cli.group import Command

SUFFIXES = (".nc", ".csv")


@click.command(cls=Command, short_help="Compute all arrays of a result.")
@click.argument("result")
@click.option("-o", "--output", type=click.Path(), metavar="FILE", required=True,
              help="What is written: a .nc or a .csv file.")  # fmt: skip
@click.option("--jac", is_flag=True, help="The constraint Jacobian as well.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
def post(result: str, *, output: str, jac: bool, force: bool) -> int:
    """Compute the arrays of the manual's post-processor from a RESULT.

    r, p, rd, w, wp, rdd, wd, wpd of the bodies, rP, rPd of the points (animation points last), Lam
    and, with --jac, Jac; wp and wpd are in body axes.

    A .csv file has the time and a column for each component, named as dap3d plot names it, such as
    crank.r.x. A .nc file has the arrays with named dimensions and units.
    """
    from dap3d_core.cli.files import open_result, writable
    from dap3d_core.cli.rendering import output as output_console
    from dap3d_core.cli.rendering import say, size
    from dap3d_core.cli.tables import write_csv, write_netcdf

    target = Path(output)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise Refused(f"cannot write {target}: a .nc or a .csv file is written")
    opened = open_result(result)
    writable(target, force=force, sources=(Path(result),))
    write = write_csv if suffix == ".csv" else write_netcdf
    contents = write(opened, target, jacobian=jac, force=force)
    say(
        output_console(),
        f"{target} written ({size(target.stat().st_size)}): {contents}",
        whole=True,
    )
    return DONE
