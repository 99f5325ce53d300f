"""``dap3d export``: a result as a file of another program."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import results as complete_results
from dap3d_core.cli.process.exit_codes import DONE, INTERRUPTED, Refused

if TYPE_CHECKING:
    from dap3d_core.exchange import Export


@click.command(cls=Command, short_help="Write a result for ParaView, Blender, MATLAB or a table.")
@click.argument("result", shell_complete=complete_results)
@click.option("-f", "--format", "kind", type=click.Choice(("vtk", "gltf", "mat", "csv")),
              help="Form of the file, where its name does not say it; vtk by default.")  # fmt: skip
@click.option("-o", "--output", type=click.Path(), metavar="FILE",
              help="What is written: a .vtkhdf, .glb, .mat or .csv file; RESULT and the suffix by "
              "default.")  # fmt: skip
@click.option("--fps", type=float, metavar="NUMBER",
              help="Instants a second; every reported instant by default.")  # fmt: skip
@click.option("--model", metavar="MODEL",
              help="The model whose own types (plugin.py) and meshes were used.")  # fmt: skip
@click.option("--allow-code", is_flag=True, help="Load the types of that model's plugin.py.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
@click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")
def export(
    result: str,
    *,
    kind: str | None,
    output: str | None,
    fps: float | None,
    model: str | None,
    allow_code: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write a RESULT to a file of another program.

    vtk (.vtkhdf) is the moving scene for ParaView, gltf (.glb) for Blender, browsers and viewers:
    shapes, bodies, joints and springs as dap3d view draws them. mat has all arrays for MATLAB and
    Octave, csv a column for each component.

    \b
    dap3d export pen1.nc --format vtk
    dap3d export pen1.nc -o pen1.glb --fps 60

    Ctrl-C leaves no file behind.
    """
    from dap3d_core.cli.console.console import messages, say
    from dap3d_core.cli.console.progress import counting
    from dap3d_core.cli.framework.paths import open_result, refuse_all, writable
    from dap3d_core.exchange import FORMATS, check_fps, format_of
    from dap3d_core.exchange import export as write
    from dap3d_core.result import ResultError

    suffix = FORMATS[kind or "vtk"]
    target = Path(output) if output is not None else Path(Path(result).stem + suffix)
    opened = open_result(result, model=model, allow_code=allow_code)
    refuse_all(
        partial(format_of, target, kind),
        partial(check_fps, fps),
        partial(writable, target, force=force, sources=(Path(result),)),
    )
    try:
        with counting("part", quiet=quiet or as_json) as progress:
            made = write(opened, target, format=kind, fps=fps, model=model, progress=progress,
                         force=force)  # fmt: skip
    except KeyboardInterrupt:
        say(messages(), f"interrupted; {target} was not written", "bold red")
        return INTERRUPTED
    except (ValueError, ResultError) as error:
        raise Refused(str(error)) from error
    _tell(made, target, as_json=as_json, quiet=quiet)
    return DONE


def _tell(made: "Export", target: Path, *, as_json: bool, quiet: bool) -> None:
    from dap3d_core.cli.console.console import count, items, messages, output, print_json, say, size

    byte_count = target.stat().st_size
    if as_json:
        about = {"file": str(target), "format": made.format, "size_bytes": byte_count}
        print_json({**about, "instants": made.instants, "notes": list(made.notes)})
    elif not quiet:
        items(messages(), made.notes)
        words = f"{target} written ({size(byte_count)}): {count(made.instants, 'instant')}"
        say(output(), words, whole=True)
