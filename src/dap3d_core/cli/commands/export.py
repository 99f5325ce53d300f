"""``dap3d export``: a result as a file for another program."""

from functools import partial
from pathlib import Path

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, INTERRUPTED, refusing


@command(
    "Write a result for ParaView, Blender, MATLAB or a table.",
    options.RESULT,
    click.option("-f", "--format", "kind", type=click.Choice(("vtk", "gltf", "mat", "csv")),
                 help="Format, if the name of the file does not give it; vtk by default."),
    options.output("A .vtkhdf, .glb, .mat or .csv file; RESULT and the suffix by default."),
    options.FPS, options.MODEL_OF_RESULT, options.ALLOW_CODE, options.FORCE, options.JSON,
    options.QUIET,
)  # fmt: skip
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
    from dap3d_core.cli.console.console import count, show_written, stderr
    from dap3d_core.cli.console.progress import counting
    from dap3d_core.cli.framework.paths import open_result, output_path, refuse_all, writable
    from dap3d_core.exchange import FORMATS, check_fps, format_of
    from dap3d_core.exchange import export as write
    from dap3d_core.result import ResultError

    target = output_path(result, output, FORMATS[kind or "vtk"])
    opened = open_result(result, model=model, allow_code=allow_code)
    refuse_all(
        partial(format_of, target, kind),
        partial(check_fps, fps),
        partial(writable, target, force=force, sources=(Path(result),)),
    )
    try:
        with (
            counting("part", quiet=quiet or as_json) as progress,
            refusing(ValueError, ResultError),
        ):
            made = write(opened, target, format=kind, fps=fps, model=model, progress=progress,
                         force=force)  # fmt: skip
    except KeyboardInterrupt:
        stderr().say(f"interrupted; {target} was not written", "bold red")
        return INTERRUPTED
    data = {"format": made.format, "instants": made.instants}
    contents = count(made.instants, "instant")
    show_written(target, contents, data, made.notes, as_json=as_json, quiet=quiet)
    return DONE
