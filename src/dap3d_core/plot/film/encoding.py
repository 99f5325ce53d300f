"""Pictures as a film: GIF by Pillow, MP4 by the program ffmpeg."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from dap3d_core.result import ResultError
from dap3d_core.result.file.atomic_write import cannot

NO_FFMPEG = (
    "an MP4 needs the program ffmpeg, which is not on PATH: install it (apt install ffmpeg, "
    "brew install ffmpeg, conda install ffmpeg), or name a .gif file"
)
#: Colours of a GIF; lines at any angle need shades between theirs and white.
COLORS = 128
#: Parts of a colour from here on are as bright as can be.
PALEST = 248

Frames = Iterator[Any]


class FilmFormat(NamedTuple):
    """A format of films: how it is written, its highest fps, what it makes of an fps."""

    write: Callable[[Path, Frames, float], None]
    most_fps: float
    fps: Callable[[float], float]


def write_film(form: FilmFormat, part: Path, target: Path, frames: Frames, fps: float) -> None:
    """Write frames, (height, width, 4) bytes each, each used before the next is requested.

    Raises:
        ResultError: the disk or the encoder refuses; no ffmpeg.
    """
    try:
        form.write(part, frames, fps)
    except OSError as error:
        raise cannot("write", target, error) from error


def _write_gif(part: Path, frames: Frames, fps: float) -> None:
    from PIL import Image

    none = Image.Dither.NONE
    first = Image.fromarray(next(frames)).convert("RGB")
    palette = first.quantize(COLORS, method=Image.Quantize.MEDIANCUT, dither=none)
    # The means of pale shades fall short of white, and colours are looked up in steps of 8.
    palette.putpalette([s if s < PALEST else 255 for s in palette.getpalette() or []])
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
