"""Checks the free disk and memory for the reports of a run before it begins."""

import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from dap3d_core.result.file.atomic_write import file_size_limit
from dap3d_core.scene import MISSING, Mistake, SceneError

#: Reports of less are not worth a look at the machine, bytes.
ALWAYS = 64 * 2**20
#: A result is there twice, in memory or on the disk, while it is put together.
COPIES = 2
#: What a file holds besides the reports, bytes: scene, model, settings.
DESCRIPTION = 2**16


def check_room(
    rows: int, numbers: int, dt: float | None, output: str | os.PathLike[str] | None
) -> None:
    """Refuse a run whose reports do not fit: on the disk where they are written, else in memory.

    Args:
        rows: reported instants.
        numbers: of each.
        dt: reporting step, s, as given.
        output: the file that takes them, or None.

    Raises:
        SceneError: says how much there would be, how much room there is, and what to do.
    """
    reports, limit = 8 * rows * numbers, file_size_limit()
    needed, times = COPIES * reports, 0.0
    place, room = _room(output) if needed > ALWAYS else ("", None)
    if output is not None and limit is not None and reports > limit - DESCRIPTION:
        place, room, needed = "in a file, by its limit (ulimit -f)", limit, reports + DESCRIPTION
        times = 2.0 * reports / max(limit - DESCRIPTION, 1)
    if room is None or needed <= room:
        return
    what = (
        f"the run would report {rows:,} instants of {numbers:,} numbers, {_size(needed)}; "
        f"there is room for {_size(room)} {place}"
    )
    times = times or 2.0 * needed / max(room, 1)  # half of the room is for all else
    if times >= rows:
        remedy = "no run fits there: raise the limit"
    elif dt is None:
        remedy = f"report less often, with a dt {times:.3g} times as long or more"
    else:
        remedy = f"give dt of at least {times * dt:.3g}"
    if output is None:
        remedy += ", or name a file (output=, -o), which takes them as they come"
    raise SceneError([Mistake("dt", MISSING if dt is None else dt, what, remedy=remedy)])


def check_room_of_points(count: int, width: int, output: str | os.PathLike[str] | None) -> None:
    """Refuse a study whose points do not fit: on the disk where they are written, else in memory.

    Args:
        count: number of points.
        width: bytes of each.
        output: the file that takes them, or None.

    Raises:
        SceneError: says how much there would be, how much room there is, and what to do.
    """
    needed = count * width
    place, room = _room(output)
    if needed <= ALWAYS or room is None or needed <= room:
        return
    what = (
        f"the study has {count:,} points of {width:,} bytes, {_size(needed)}; there is room for "
        f"{_size(room)} {place}"
    )
    remedy = "take fewer points, keep less of each, or insist by force"
    if output is None:
        remedy += "; a file (output=, -o) takes them as they come"
    raise SceneError([Mistake("vary", MISSING, what, remedy=remedy)])


def _room(output: str | os.PathLike[str] | None) -> tuple[str, int | None]:
    """Destination of the numbers of a run, and the bytes that are free there."""
    if output is not None:
        return "on the disk", _free_disk(Path(output).parent)
    return "in memory", _free_memory()


def _free_disk(folder: Path) -> int | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:  # the writer will say what is wrong with the folder
        return None


def _free_memory() -> int | None:
    """Bytes that processes may still take; None where the system does not say."""
    return min(_bounds(), default=None)


def _bounds() -> Iterator[int]:
    with suppress(AttributeError, OSError, ValueError):  # not on every system
        yield os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    with suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/meminfo").read_text().splitlines()
        yield next(1024 * int(x.split()[1]) for x in lines if x.startswith("MemAvailable:"))
    with suppress(OSError, ValueError):  # of a container; ValueError: "max", no limit
        yield int(Path("/sys/fs/cgroup/memory.max").read_text())


def _size(byte_count: float) -> str:
    return (
        f"{byte_count / 2**30:,.3g} GiB" if byte_count >= 2**27 else f"{byte_count / 1e6:,.3g} MB"
    )
