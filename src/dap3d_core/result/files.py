"""Files that are written whole or not at all, and never over another without being asked to."""

import errno
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dap3d_core.result.errors import ResultError

#: So many unfinished files may lie beside one another.
_MOST_PARTS = 1000


def cannot(verb: str, path: Path, error: BaseException) -> ResultError:
    """The error for a file that the system or a library refuses, in a sentence."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    if getattr(error, "errno", None) in (errno.EACCES, errno.EPERM):
        reason = "no permission"
    elif "HDF error" in reason:
        reason = f"the library says {reason!r}; is the disk full?"
    return ResultError(f"cannot {verb} {path}: {reason}")


def beginning(file: Path, count: int) -> bytes:
    """The first bytes of a file, as many as there are of them.

    Raises:
        ResultError: there is no such file, it is a folder, or the system refuses.
    """
    try:
        with file.open("rb") as stream:
            return stream.read(count)
    except FileNotFoundError as error:
        raise ResultError(f"cannot read {file}: there is no such file") from error
    except IsADirectoryError as error:
        raise ResultError(f"cannot read {file}: it is a folder; name a file in it") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise cannot("read", file, error) from error


def check_target(path: str | os.PathLike[str], force: bool = False) -> Path:
    """The path of a file that may be written.

    Raises:
        ResultError: its folder does not exist, it is no file, or it exists and ``force`` is off.
    """
    target = Path(path)
    try:
        mode = _mode_of(target)  # asked once: another process may make it meanwhile
        if mode and stat.S_ISREG(mode):
            fault = "" if force else "the file exists; force overwrites it"
        elif mode and stat.S_ISDIR(mode):
            fault = "it is a folder; name a file in it"
        elif mode:
            fault = "it is no regular file"
        elif target.is_symlink():
            fault = "" if force else "it is a link that leads nowhere; force replaces it"
        elif not target.parent.is_dir():
            fault = f"there is no folder {target.parent}"
        else:
            fault = ""
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise cannot("write", target, error) from error
    if fault:
        raise ResultError(f"cannot write {target}: {fault}")
    return target


def _mode_of(path: Path) -> int:
    """What there is at a path, as ``stat`` has it; 0 where there is nothing."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0


def reserve(target: Path, kind: str = "part") -> Path:
    """Make an empty file beside the target, ``NAME.part`` or the first of its kind that is free.

    An unfinished file of an earlier run that was killed is left as it is.

    Raises:
        ResultError: the folder cannot be written to.
    """

    def make(part: Path) -> None:
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))

    return _first_free(target, kind, make)


def named_part(file: Path, target: Path) -> Path:
    """Give a file beside the target, which may be open, the name ``NAME.part``, or the like.

    Raises:
        ResultError: the system refuses.
    """
    return _first_free(target, "part", lambda part: _name_if_free(file, part))


def _first_free(target: Path, kind: str, take: Callable[[Path], None]) -> Path:
    for k in range(1, _MOST_PARTS):
        part = target.with_name(f"{target.name}.{kind}{k if k > 1 else ''}")
        try:
            take(part)
        except FileExistsError:
            continue
        except (OSError, ValueError) as error:
            raise cannot("write", target, error) from error
        return part
    raise ResultError(f"cannot write {target}: {_MOST_PARTS} unfinished files lie beside it")


def synchronise(path: Path) -> None:
    """Wait until a file's content is on the disk; OSError where the system refuses."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def put_in_place(part: Path, target: Path, force: bool = True) -> None:
    """Give a finished file its name, once its content is on the disk.

    Args:
        part: the finished file.
        target: its name.
        force: whether another file of that name is replaced.

    Raises:
        ResultError: the system refuses; another file has the name and ``force`` is off.
    """
    try:
        synchronise(part)
        if force:
            os.replace(part, target)
        else:
            _name_if_free(part, target)
        with suppress(OSError):  # not every system lets a folder be synchronised
            folder = os.open(target.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
    except OSError as error:
        raise cannot("write", target, error) from error


def _name_if_free(part: Path, target: Path) -> None:
    """Give a file a name that no other has; of two processes that try, one succeeds."""
    try:
        os.link(part, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        os.replace(part, target)
    else:
        part.unlink()


@contextmanager
def whole_file(
    path: str | os.PathLike[str], force: bool = False, kind: str = "part"
) -> Iterator[Path]:
    """A file to write into, which gets its name at the end; left with an error, it vanishes.

    Args:
        path: what it is called in the end.
        force: whether an existing file is overwritten.
        kind: what it is called until then, after a dot behind its name.

    Raises:
        ResultError: the path cannot be written to.
    """
    target = check_target(path, force)
    part = reserve(target, kind)
    try:
        yield part
        check_target(path, force)
        put_in_place(part, target, force)
    finally:
        part.unlink(missing_ok=True)
