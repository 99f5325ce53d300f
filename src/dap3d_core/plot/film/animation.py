"""Animations of a result as GIF or MP4, and snapshots: the manual's stick figure, in motion."""

import base64
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.plot.figure_file import FORMATS as PICTURES
from dap3d_core.plot.figure_file import fixed_files
from dap3d_core.plot.film import projection
from dap3d_core.plot.film.frame import Stage
from dap3d_core.plot.film.stick_figure import pose_at, sticks_of
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, ResultError
from dap3d_core.result.errors import unknown
from dap3d_core.result.file.atomic_write import cannot, whole_file

#: Pixels; a height of 0 becomes one that suits the motion.
SIZE = (640, 0)
FPS = 25.0
#: Films of motions that last this long, s, are in real time, others last ABOUT seconds.
SHORTEST, LONGEST, ABOUT = 2.0, 10.0, 5.0
#: More frames are refused as a mistake.
MOST_FRAMES = 20_000
BEYOND = "the motion leaves the limits of the scene's [animation]; fit (--fit) frames it all"
#: Suffix -> media type of what notebooks show.
MEDIA = {".gif": "image/gif", ".png": "image/png", ".svg": "image/svg+xml", ".mp4": "video/mp4"}

Progress = Callable[[int, int], None]
NO_FFMPEG = (
    "an MP4 needs the program ffmpeg, which is not on PATH: install it (apt install ffmpeg, "
    "brew install ffmpeg, conda install ffmpeg), or name a .gif file"
)
#: Colours of a GIF; lines at any angle need shades between theirs and white.
COLORS = 128

Frames = Iterator[Any]


class FilmFormat(NamedTuple):
    """A format of films: how it is written, its highest fps, what it makes of an fps."""

    write: Callable[[Path, Frames, float], None]
    most_fps: float
    fps: Callable[[float], float]


def _write_gif(part: Path, frames: Frames, fps: float) -> None:
    from PIL import Image

    none = Image.Dither.NONE
    first = Image.fromarray(next(frames)).convert("RGB")
    palette = first.quantize(COLORS, method=Image.Quantize.MEDIANCUT, dither=none)
    # The means of pale shades fall short of white, and colours are looked up in steps of 8.
    palette.putpalette([s if s < 248 else 255 for s in palette.getpalette() or []])
    rest = (Image.fromarray(f).convert("RGB").quantize(palette=palette, dither=none)
            for f in frames)  # fmt: skip
    with part.open("wb") as file:
        palette.save(file, format="GIF", save_all=True, append_images=rest, loop=0,
                     optimize=False, duration=round(1000.0 / fps))  # fmt: skip


def _write_mp4(part: Path, frames: Frames, fps: float) -> None:
    program = shutil.which("ffmpeg")
    if program is None:
        raise ResultError(NO_FFMPEG)
    first = next(frames)
    height, width = first.shape[:2]
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"  # what the usual encoders ask for
    words = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba",
             "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-", "-an", "-vf", even,
             "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(part)]  # fmt: skip
    with tempfile.TemporaryFile() as said:
        # In a session of its own: Ctrl-C is ours to handle, the encoder is ended below.
        process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=said, stderr=said,
                                   start_new_session=True)  # fmt: skip
        assert process.stdin is not None
        try:
            with suppress(BrokenPipeError):  # it has ended, and says why
                process.stdin.write(first.tobytes())
                for frame in frames:
                    process.stdin.write(frame.tobytes())
        except BaseException:
            process.kill()
            raise
        finally:
            with suppress(BrokenPipeError):
                process.stdin.close()
            code = process.wait()
        said.seek(0)
        why = said.read().decode(errors="replace").strip().splitlines()
    if code:
        raise ResultError(f"ffmpeg failed with exit code {code}: {why[-1] if why else 'no reason'}")


#: Suffix -> format. Delays of a GIF are multiples of 10 ms.
FILMS = {
    ".gif": FilmFormat(_write_gif, 50.0, lambda fps: 100.0 / round(100.0 / fps)),
    ".mp4": FilmFormat(_write_mp4, 240.0, lambda fps: fps),
}
SUFFIXES = (*FILMS, *PICTURES)


@attrs.frozen
class Film:
    """A file that ``animate`` wrote; notebooks show it.

    Attributes:
        path: the file, from the root of the file system.
        frames: number of pictures; 1 for a snapshot.
        fps: pictures a second; GIF rounds their time to 10 ms.
        speed: simulated time over time of the film.
        size: width and height, pixels.
        notes: warnings.
    """

    path: Path
    frames: int
    fps: float
    speed: float
    size: tuple[int, int]
    notes: tuple[str, ...] = ()

    def _repr_html_(self) -> str:
        kind = MEDIA.get(self.path.suffix.lower(), "")
        if not kind:
            return ""
        data = f"data:{kind};base64,{base64.b64encode(self.path.read_bytes()).decode()}"
        width, height = self.size
        if kind.startswith("video"):
            return f'<video src="{data}" width="{width}" height="{height}" controls loop></video>'
        return f'<img src="{data}" width="{width}" height="{height}" alt="{self.path.stem}">'


@fixed_files()
@checked
def animate(
    result: Result,
    path: str | os.PathLike[str],
    *,
    fps: float = FPS,
    speed: float | None = None,
    size: tuple[int, int] = SIZE,
    view: str | None = None,
    at: float | None = None,
    fit: bool = False,
    follow: str | None = None,
    model: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    force: bool = False,
) -> Film:
    """Draw the motion of a result as a stick figure into a file; needs no display.

    Bodies with shapes are drawn by them, others by lines from their mass centres to their points.

    Args:
        result: the result.
        path: the file: .gif; .mp4, which needs ffmpeg; .png, .svg or .pdf for a snapshot.
        fps: pictures a second, 1 to 50 for a GIF, to 240 for an MP4.
        speed: simulated seconds in one of the film; by default 1, or such that it lasts some 5 s.
        size: width and height, pixels; a height of 0 becomes one that suits the motion.
        view: "x", "y" or "z" looks along that axis, "AZIMUTH,ELEVATION" from there (degrees); by
            default along the axis across a plane motion, else from the side and above.
        at: time of a snapshot, s; by default the first instant.
        fit: frame the whole motion, whatever limits the scene's [animation] gives.
        follow: a body that stays in its place of the picture; what else moves is seen from there.
        model: the model (a name, a folder, a file) in whose folder meshes of shapes lie.
        progress: called as progress(done, frames).
        force: overwrites an existing file.

    Raises:
        ValueError, UnknownNameError: no instants; an invalid suffix, number, view or body.
        ResultError: the file cannot be written, or exists and ``force`` is off; no ffmpeg.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    _check(result, target, fps, speed, size, at)
    stage, notes = _stage_of(result, view, size, model, follow, fit=fit, still=suffix not in FILMS)
    duration = float(result.t[-1] - result.t[0])
    speed, times = speed or usual_speed(duration), np.array([result.t[0] if at is None else at])
    if suffix in FILMS:
        fps = FILMS[suffix].fps(fps)
        times = frame_times(result.t, fps, speed)
    clock = _clock(duration or float(times[0]), speed if len(times) > 1 else 1.0)
    with whole_file(target, force) as part:
        if suffix in FILMS:
            frames = _frames(result, stage, times, clock, progress)
            try:
                FILMS[suffix].write(part, frames, fps)
            except OSError as error:
                raise cannot("write", target, error) from error
        else:
            stage.place(*pose_at(result, float(times[0])), clock(float(times[0])))
            stage.figure.savefig(part, format=suffix[1:], metadata=PICTURES[suffix])
    return Film(target.absolute(), len(times), fps, speed, stage.size, notes)


def _stage_of(
    result: Result,
    view: str | None,
    size: tuple[int, int],
    model: str | os.PathLike[str] | None,
    follow: str | None,
    *,
    fit: bool,
    still: bool,
) -> tuple[Stage, tuple[str, ...]]:
    """The stage, and notes on what it shows."""
    if follow is not None and follow not in result.summary.body_names:
        raise unknown("body", follow, result.summary.body_names)
    about = None if follow is None else result.summary.body_names.index(follow)
    sticks = sticks_of(result, model, still=still)
    extent = sticks.extent(result, np.eye(3))
    camera = projection.camera_of(view, extent)
    limits = sticks.limits
    if limits is None or fit or about is not None:
        limits = projection.with_margin(extent)
    room = limits
    if about is not None:
        near = sticks.extent(result, np.eye(3), about)
        room = projection.with_margin(near)
        limits[2] = extent[2] + (room - near)[2]  # the floor is as near as to a short motion
    seen = projection.visible_rectangle(camera, room, sticks.extent(result, camera.axes, about))
    stage = Stage(sticks, camera, limits, seen, size, result.record.title, about)
    notes = () if sticks.shapes is None else sticks.shapes.notes
    return stage, (*notes, BEYOND) if projection.leaves(limits, extent, camera) else notes


def _frames(
    result: Result,
    stage: Stage,
    times: Floats,
    clock: Callable[[float], str],
    progress: Progress | None,
) -> Iterator[Any]:
    """The pictures, each valid until the next is requested."""
    for k, t in enumerate(map(float, times)):
        stage.place(*pose_at(result, t), clock(t))
        yield stage.pixels()
        if progress is not None:
            progress(k + 1, len(times))


def _check(
    result: Result,
    target: Path,
    fps: float,
    speed: float | None,
    size: tuple[int, int],
    at: float | None,
) -> None:
    film = FILMS.get(target.suffix.lower())
    if target.suffix.lower() not in SUFFIXES:
        raise ValueError(f"cannot write {target}: an animation is one of {', '.join(SUFFIXES)}")
    if not len(result.t):
        raise ValueError("the result has no instants: there is nothing to draw")
    if film and not 1.0 <= fps <= film.most_fps:
        raise ValueError(
            f"fps of a {target.suffix.lower()} file is a number from 1 to {film.most_fps:g}, not "
            f"{fps:g}"
        )
    if speed is not None and not 0.0 < speed < float("inf"):
        raise ValueError(f"speed is a number above 0 (1 is real time), not {speed:g}")
    if not (100 <= size[0] <= 4096 and (size[1] == 0 or 100 <= size[1] <= 4096)):
        raise ValueError(f"width and height are from 100 to 4096 pixels, not {size[0]} x {size[1]}")
    if at is not None and film:
        raise ValueError(f"a film has no single time; name a picture ({', '.join(PICTURES)})")
    if at is not None and not result.t[0] <= at <= result.t[-1]:
        raise ValueError(
            f"there is nothing to see at t = {at:g} s; the result goes from {result.t[0]:g} s to "
            f"{result.t[-1]:g} s"
        )


def usual_speed(duration: float) -> float:
    """1 for motions of a length that suits real time, else a round number."""
    if duration <= 0.0 or SHORTEST <= duration <= LONGEST:
        return 1.0
    return projection.round_number(duration / ABOUT)


def frame_times(t: Floats, fps: float, speed: float) -> Floats:
    """(frames,) simulated times of the pictures of a film, from the first instant to the last, s.

    Raises:
        ValueError: there are too many.
    """
    count = int(np.floor(float(t[-1] - t[0]) * fps / speed * (1.0 + 1e-12))) + 1
    if count > MOST_FRAMES:
        raise ValueError(
            f"{count:,} frames are more than {MOST_FRAMES:,}; a larger speed or a smaller fps "
            "makes fewer"
        )
    times = float(t[0]) + np.arange(count, dtype=np.float64) * (speed / fps)
    return np.asarray(np.minimum(times, float(t[-1])), dtype=np.float64)


def _clock(duration: float, speed: float) -> Callable[[float], str]:
    """Text for a time, with as many digits as a motion of this length needs."""
    digits = int(max(0.0, 2.0 - np.floor(np.log10(duration or 1.0))))
    pace = "" if speed == 1.0 else f"  ({speed:g} × real time)"
    return lambda t: f"t = {t:.{digits}f} s{pace}"
