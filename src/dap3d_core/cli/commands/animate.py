"""``dap3d animate``: the motion of a result as a film, or a snapshot of it."""

import re
from pathlib import Path
from typing import Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, Refused, refusing


@command(
    "Draw the motion of a result as a film.",
    options.RESULT,
    options.output("A .gif or .mp4, or a snapshot: .png, .svg, .pdf. RESULT.gif by default; "
                   "RESULT.png where the run was at t = 0 alone."),
    click.option("--fps", type=float, metavar="N", help="Pictures a second; 25 by default."),
    click.option("--speed", type=float, metavar="X",
                 help="1 is real time, 0.1 ten times slower; by default films last 2 s to 10 s."),
    click.option("--size", metavar="WIDTHxHEIGHT",
                 help="Pixels, such as 640x480; WIDTH alone lets the height fit. 640 by default."),
    click.option("--view", metavar="VIEW",
                 help="x, y or z looks along that axis; AZIMUTH,ELEVATION from there, in degrees "
                      "(-60,22); by default across the plane of a plane motion."),
    click.option("--at", type=float, metavar="S", help="Time of a snapshot in s."),
    click.option("--fit", is_flag=True,
                 help="Frame the whole motion, whatever limits the scene gives."),
    click.option("--follow", metavar="BODY", help="A body that stays in its place of the picture."),
    click.option("--model", metavar="MODEL", help="The model in whose folder meshes lie."),
    options.FORCE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
def animate(
    result: str, *, output: str | None, size: str | None, fit: bool, force: bool, **given: Any
) -> int:
    """Draw the motion of a RESULT as a stick figure: a GIF, an MP4 or a snapshot.

    Bodies with shapes are drawn by them; of others lines run from the mass centre to the points and
    to the animation points of the scene; springs are dashed. The limits of the scene's [animation]
    frame the picture, else the motion does. No display is needed; an MP4 needs the program ffmpeg.

    \b
    dap3d animate fourbar3.nc
    dap3d animate fourbar3.nc -o slow.mp4 --speed 0.2
    dap3d animate fourbar3.nc -o top.png --view z --at 0.5

    Ctrl-C leaves no file behind.
    """
    from dap3d_core.cli.console.console import count, show_written
    from dap3d_core.cli.console.progress import counting
    from dap3d_core.cli.framework.paths import open_result, output_path, writable
    from dap3d_core.plot import animate as draw
    from dap3d_core.result import UnknownNameError

    opened = open_result(result)
    target = output_path(result, output, ".gif" if len(opened.t) > 1 else ".png")
    options = {name: value for name, value in given.items() if value is not None}
    if size is not None:
        match = re.fullmatch(r"(\d{1,6})(?:[x×](\d{1,6}))?", size.strip().lower())
        if match is None:
            raise Refused(
                f"--size is WIDTHxHEIGHT in pixels, such as 640x480, or WIDTH, not {size!r}"
            )
        options["size"] = int(match[1]), int(match[2] or 0)
    writable(target, force=force, sources=(Path(result),))
    with counting("frame") as progress, refusing(ValueError, UnknownNameError):
        film = draw(opened, target, progress=progress, fit=fit, force=force, **options)
    width, height = film.size
    contents = f"{width} x {height}, {count(film.frames, 'frame')}"
    if film.frames > 1:
        contents += f" at {film.fps:g} a second, {film.speed:g} x real time"
    data = {"frames": film.frames, "fps": film.fps, "speed": film.speed, "width": width,
            "height": height}  # fmt: skip
    show_written(target, contents, data, film.notes)
    return DONE
