"""Files that are written whole or not at all, and never over another without being asked to."""

import errno
import os
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator
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


def check_utf8(verb: str, path: str | os.PathLike[str]) -> None:
    """Refuse a NetCDF file whose path is not UTF-8, such as Latin-1: the library opens none.

    Args:
        verb: "read" or "write".
        path: the file.

    Raises:
        ResultError: its name, or that of a folder above it, is not UTF-8.
    """
    try:
        os.path.abspath(path).encode("utf-8")
    except UnicodeEncodeError as error:
        raise ResultError(
            f"cannot {verb} {path}: its name, or that of a folder above it, is not UTF-8, which "
            "the NetCDF library needs; rename it, or take another folder"
        ) from error


def _mode_of(path: Path) -> int:
    """What there is at a path, as ``stat`` has it; 0 where there is nothing."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0


def reserve(target: Path) -> Path:
    """Create an empty temporary file next to the target, ``NAME.new-`` and a random suffix.

    No other process ever uses its name, so that whoever made it may remove that name at any time,
    even after the file has got another one.

    Raises:
        ResultError: the folder cannot be written to.
    """

    def create(file: Path) -> None:
        os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))

    return _claim(target, (f".new-{secrets.token_hex(6)}" for _ in range(_MOST_PARTS)), create)


def named_part(file: Path, target: Path) -> Path:
    """Rename a temporary file, which may be open, to ``NAME.part`` or the first such name free.

    The part of another run, or of one that was killed, stays as it is.

    Raises:
        ResultError: the system refuses.
    """
    suffixes = (f".part{k if k > 1 else ''}" for k in range(1, _MOST_PARTS))
    return _claim(target, suffixes, lambda part: _name_if_free(file, part))


def _claim(target: Path, suffixes: Iterable[str], take: Callable[[Path], None]) -> Path:
    """The target with the first suffix for which ``take`` finds no file of that name."""
    for suffix in suffixes:
        part = target.with_name(target.name + suffix)
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
def whole_file(path: str | os.PathLike[str], force: bool = False) -> Iterator[Path]:
    """A file to write into, which gets its name at the end; left with an error, it vanishes.

    Args:
        path: what it is called in the end.
        force: whether an existing file is overwritten.

    Raises:
        ResultError: the path cannot be written to.
    """
    target = check_target(path, force)
    part = reserve(target)
    try:
        yield part
        check_target(path, force)
        put_in_place(part, target, force)
    finally:
        part.unlink(missing_ok=True)
