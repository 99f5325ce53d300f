"""``dap3d plot``: quantities of a result as curves in a file."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.exits import DONE, Refused
from dap3d_core.cli.group import Command

if TYPE_CHECKING:
    from dap3d_core.result import Result

ENERGIES = ("energy.kinetic", "energy.potential", "energy.total")


@click.command(cls=Command, short_help="Draw curves of a result.")
@click.argument("result")
@click.argument("quantities", metavar="[QUANTITY]...", nargs=-1)
@click.option("-o", "--output", type=click.Path(), metavar="FILE",
              help="Picture: .png, .svg or .pdf; RESULT.png by default.")  # fmt: skip
@click.option("--x", metavar="QUANTITY", help="What the curves are drawn over; time by default.")
@click.option("--force", is_flag=True, help="Overwrite an existing picture.")
def plot(
    result: str, quantities: tuple[str, ...], *, output: str | None, x: str | None, force: bool
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
    """
    from dap3d_core.cli.files import open_result, writable
    from dap3d_core.cli.rendering import output as output_console
    from dap3d_core.cli.rendering import say

    target = Path(output) if output is not None else Path(Path(result).stem + ".png")
    opened = open_result(result)
    writable(target, force=force, sources=(Path(result),))
    _draw(opened, quantities or ENERGIES, target, x, force)
    say(output_console(), f"{target} written", whole=True)
    return DONE


def _draw(
    result: "Result", names: tuple[str, ...], target: Path, x: str | None, force: bool
) -> None:
    from dap3d_core.plot import save_plot
    from dap3d_core.result import UnknownNameError

    try:
        save_plot(result, names, target, x=x, force=force)
    except (UnknownNameError, ValueError) as error:
        raise Refused(str(error)) from error
