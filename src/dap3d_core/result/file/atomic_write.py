"""Files that are written whole or not at all, and never over another without being asked to."""

import errno
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dap3d_core.registry.regular_files import kind_of, read_regular
from dap3d_core.result.errors import ResultError

#: A disk with less room, bytes, is full: a block of a file no longer fits.
_NO_ROOM = 2**16
#: So many unfinished files may lie beside one another.
_MOST_PARTS = 1000


def cannot(verb: str, path: Path, error: BaseException) -> ResultError:
    """The error for a file that the system or a library refuses, in a sentence."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    from_library = "HDF error" in reason
    if getattr(error, "errno", None) in (errno.EACCES, errno.EPERM):
        reason = "no permission"
        from_library = os.access(path.parent, os.W_OK)  # so it calls whatever goes wrong
    if verb == "write" and from_library and _is_full(path.parent):
        reason = os.strerror(errno.ENOSPC)
    elif "HDF error" in reason:
        reason = f"the library says {reason!r}; is the disk full?"
    return ResultError(f"cannot {verb} {path}: {reason}")


def _is_full(folder: Path) -> bool:
    """Whether the disk of a folder has next to no room left."""
    try:
        return shutil.disk_usage(folder).free < _NO_ROOM
    except OSError:
        return False


def beginning(file: Path, count: int) -> bytes:
    """The first bytes of a file, as many as there are of them.

    Raises:
        ResultError: there is no such file, it is no regular file, or the system refuses.
    """
    try:
        return read_regular(file, count)
    except FileNotFoundError as error:
        raise ResultError(f"cannot read {file}: there is no such file") from error
    except IsADirectoryError as error:
        raise ResultError(f"cannot read {file}: it is a folder; name a file in it") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise cannot("read", file, error) from error


def check_target(path: str | os.PathLike[str], force: bool = False) -> Path:
    """The path of a file that may be written; a link is followed to the file that it stands for.

    Raises:
        ResultError: its folder does not exist, it is no file, or it exists and ``force`` is off.
    """
    target = Path(path)
    try:
        if target.is_symlink():
            return _link_target(target, force)
        mode = _mode_of(target)  # asked once: another process may make it meanwhile
        if mode and stat.S_ISREG(mode):
            fault = "" if force else "the file exists; force overwrites it"
        elif mode and stat.S_ISDIR(mode):
            fault = "it is a folder; name a file in it"
        elif mode:
            fault = f"it is no regular file but {kind_of(mode)}"
        elif not target.parent.is_dir():
            fault = f"there is no folder {target.parent}"
        else:
            fault = ""
    except ResultError:
        raise
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


def _link_target(link: Path, force: bool) -> Path:
    """The file that a link stands for, as ``check_target`` has it: the link itself stays.

    A link of the system, such as /dev/stdout, may stand for an open file that has no name.
    """
    target = Path(os.path.realpath(link))
    mode = _mode_of(link)
    if mode and not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        fault = f"it is no regular file but {kind_of(mode)}"
    elif mode and not (target.exists() and target.samefile(link)):
        fault = "the file that it stands for has no name"
    elif not mode and not force:
        fault = "it is a link that leads nowhere; force makes the file that it names"
    else:
        return check_target(target, force)
    raise ResultError(f"cannot write {link}: {fault}")


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
        ResultError: the path cannot be written to; also for an OSError of what writes.
    """
    target = check_target(path, force)
    part = reserve(target)
    try:
        try:
            yield part
        except OSError as error:
            if isinstance(error, ResultError):
                raise
            raise cannot("write", target, error) from error
        check_target(path, force)
        put_in_place(part, target, force)
    finally:
        part.unlink(missing_ok=True)
