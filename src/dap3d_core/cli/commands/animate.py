"""``dap3d animate``: the motion of a result as a film, or a snapshot of it."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.framework.completion import results as complete_results
from dap3d_core.cli.process.exit_codes import DONE, INTERRUPTED, Refused

if TYPE_CHECKING:
    from dap3d_core.plot import Film
    from dap3d_core.result import Result


@click.command(cls=Command, saves=True, short_help="Draw the motion of a result as a film.")
@click.argument("result", shell_complete=complete_results)
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    metavar="FILE",
    help="A .gif or .mp4, or a snapshot: .png, .svg, .pdf. RESULT.gif by default; "
    "RESULT.png where the run was at t = 0 alone.",
)
@click.option("--fps", type=float, metavar="N", help="Pictures a second; 25 by default.")
@click.option(
    "--speed",
    type=float,
    metavar="X",
    help="1 is real time, 0.1 ten times slower; by default films last 2 s to 10 s.",
)
@click.option(
    "--size",
    metavar="WIDTHxHEIGHT",
    help="Pixels, such as 640x480; WIDTH alone lets the height fit. 640 by default.",
)
@click.option(
    "--view",
    metavar="VIEW",
    help="x, y or z looks along that axis; AZIMUTH,ELEVATION from there, in degrees "
    "(-60,22); a plane motion is looked at across its plane by default.",
)
@click.option("--at", type=float, metavar="S", help="Time of a snapshot in s.")
@click.option(
    "--fit", is_flag=True, help="Frame the whole motion, whatever limits the scene gives."
)
@click.option("--model", metavar="MODEL", help="The model in whose folder meshes lie.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
@click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")
def animate(
    result: str,
    *,
    output: str | None,
    size: str | None,
    fit: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
    **given: Any,
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
    from dap3d_core.cli.console.console import messages, say
    from dap3d_core.cli.console.progress import counting
    from dap3d_core.cli.framework.paths import open_result, writable

    opened = open_result(result)
    suffix = ".gif" if len(opened.t) > 1 else ".png"
    target = Path(output) if output is not None else Path(Path(result).stem + suffix)
    options = {name: value for name, value in given.items() if value is not None}
    if size is not None:
        options["size"] = _size(size)
    writable(target, force=force, sources=(Path(result),))
    try:
        with counting("frame", quiet=quiet or as_json) as progress:
            film = _film(opened, target, progress=progress, fit=fit, force=force, **options)
    except KeyboardInterrupt:
        say(messages(), f"interrupted; {target} was not written", "bold red")
        return INTERRUPTED
    _tell(film, target, as_json=as_json, quiet=quiet)
    return DONE


def _film(result: "Result", target: Path, **options: Any) -> "Film":
    """The film.

    Raises:
        Refused: it cannot be made as asked for; says why.
    """
    from dap3d_core.plot import animate as draw
    from dap3d_core.result import ResultError

    try:
        return draw(result, target, **options)
    except (ValueError, ResultError) as error:
        raise Refused(str(error)) from error


def _size(words: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,6})(?:[x×](\d{1,6}))?", words.strip().lower())
    if match is None:
        raise Refused(f"--size is WIDTHxHEIGHT in pixels, such as 640x480, or WIDTH, not {words!r}")
    return int(match[1]), int(match[2] or 0)


def _tell(film: "Film", target: Path, *, as_json: bool, quiet: bool) -> None:
    from dap3d_core.cli.console.console import count, items, messages, output, print_json, say, size

    byte_count = target.stat().st_size
    if as_json:
        about: dict[str, Any] = {
            "file": str(target),
            "size_bytes": byte_count,
            "frames": film.frames,
        }
        about |= {"fps": film.fps, "speed": film.speed, "width": film.size[0]}
        print_json({**about, "height": film.size[1], "notes": film.notes})
        return
    if quiet:
        return
    items(messages(), film.notes)
    words = f"{film.size[0]} x {film.size[1]}, {count(film.frames, 'frame')}"
    if film.frames > 1:
        words += f" at {film.fps:g} a second, {film.speed:g} x real time"
    say(output(), f"{target} written ({size(byte_count)}): {words}", whole=True)
