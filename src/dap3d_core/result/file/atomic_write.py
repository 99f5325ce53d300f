"""Files that are written whole or not at all, and replace another only on request."""

import errno
import os
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dap3d_core.registry.regular_files import kind_of, read_regular
from dap3d_core.result.errors import ResultError

#: A disk with less free space, bytes, counts as full: a block of a file no longer fits.
_NO_ROOM = 2**16
#: Largest number of unfinished files with one name.
_MOST_PARTS = 1000


def cannot(verb: str, path: Path, error: BaseException) -> ResultError:
    """The error for a file that the system or a library refuses."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    from_library = "HDF error" in reason
    if getattr(error, "errno", None) in (errno.EACCES, errno.EPERM):
        reason = "no permission"
        from_library = os.access(path.parent, os.W_OK)  # its word for all failures
    if verb == "write" and from_library and _is_full(path.parent):
        reason = os.strerror(errno.ENOSPC)
    elif verb == "write" and from_library and (limit := file_size_limit()) is not None:
        reason = f"files may have {limit // 1024:,} kB at most (ulimit -f)"
    elif "HDF error" in reason:
        reason = f"the library says {reason!r}; is the disk full?"
    return ResultError(f"cannot {verb} {path}: {reason}")


def file_size_limit() -> int | None:
    """The limit on the size of files that the process writes, bytes; None without one."""
    try:
        import resource
    except ImportError:  # not on every system
        return None
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _is_full(folder: Path) -> bool:
    """True if the disk of a folder is full."""
    try:
        return shutil.disk_usage(folder).free < _NO_ROOM
    except OSError:
        return False


def beginning(file: Path, count: int) -> bytes:
    """Up to ``count`` first bytes of a file.

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
    """The path of a file that may be written; a link is followed and remains.

    Raises:
        ResultError: its folder does not exist, it is no file, or it exists and ``force`` is off.
    """
    target = Path(path)
    try:
        mode = _mode_of(target)  # once: another process may create it meanwhile
        is_link = target.is_symlink()
        file = Path(os.path.realpath(target)) if is_link else target
        if os.fspath(path) == "-":
            fault = "what is written is a file, not the standard output; name one"
        elif mode and stat.S_ISDIR(mode):
            fault = "it is a folder; name a file in it"
        elif mode and not stat.S_ISREG(mode):
            fault = f"it is no regular file but {kind_of(mode)}"
        elif mode and is_link and not (file.exists() and file.samefile(target)):
            fault = "the file that it stands for has no name"  # as /dev/stdout may
        elif not mode and is_link and not force:
            fault = "it is a link that leads nowhere; force makes the file that it names"
        elif is_link:
            return check_target(file, force)
        elif mode:
            fault = "" if force else "the file exists; force overwrites it"
        else:
            fault = "" if target.parent.is_dir() else f"there is no folder {target.parent}"
    except ResultError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise cannot("write", target, error) from error
    if fault:
        raise ResultError(f"cannot write {target}: {fault}")
    return target


def check_utf8(verb: str, path: str | os.PathLike[str]) -> None:
    """Refuses to "read" or "write" a NetCDF file if its path is not UTF-8, such as Latin-1.

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
    """Mode of the file at a path as in ``stat``; 0 if there is none."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0


def reserve(target: Path) -> Path:
    """Creates an empty temporary file next to the target, ``NAME.new-`` and a random suffix.

    No other process ever uses its name: its creator may remove it at any time.

    Raises:
        ResultError: the folder cannot be written to.
    """

    def create(file: Path) -> None:
        os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))

    return _claim(target, (f".new-{os.urandom(6).hex()}" for _ in range(_MOST_PARTS)), create)


def named_part(file: Path, target: Path) -> Path:
    """Renames a temporary file, which may be open, to ``NAME.part`` or the next free name.

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
    """Waits until a file's content is on the disk; OSError if the system refuses."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def put_in_place(part: Path, target: Path, force: bool = True) -> None:
    """Gives a finished file its name, once its content is on the disk; ``force`` replaces another.

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
    """Gives a file a name that no other has; of two processes that try, one succeeds."""
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
    """A file to write into, which gets its name at the end; after an error it is removed.

    Args:
        path: the final name.
        force: True to overwrite an existing file.

    Raises:
        ResultError: the path cannot be written to; also in place of an OSError of the writer.
    """
    target = check_target(path, force)
    part = reserve(target)
    try:
        try:
            yield part
        except ResultError as error:  # of a writer that knows only the temporary name
            if str(part) not in str(error):
                raise
            raise ResultError(str(error).replace(str(part), str(target))) from error
        except OSError as error:
            raise cannot("write", target, error) from error
        check_target(path, force)
        put_in_place(part, target, force)
    finally:
        part.unlink(missing_ok=True)
