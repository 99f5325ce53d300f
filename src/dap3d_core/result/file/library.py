"""The NetCDF library: one lock, and one sentence for its errors."""

import os
import threading
import weakref
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import cannot


class Lock:
    """A re-entrant lock; while nobody holds it, the files that were dropped are closed.

    The garbage collector drops a file at any moment and in any thread, also in the midst of a call
    of the library.
    """

    def __init__(self) -> None:
        self._lock, self._depth = threading.RLock(), 0
        self._dropped: deque[Any] = deque()

    def __enter__(self) -> None:
        self._lock.acquire()
        if not self._depth:
            self._close_dropped()
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if not self._depth:
            self._close_dropped()
        self._lock.release()

    def drop(self, dataset: Any) -> None:
        """Close a file that nobody uses any more: now, or when the lock is free."""
        self._dropped.append(dataset)
        if self._lock.acquire(blocking=False):
            if not self._depth:
                self._close_dropped()
            self._lock.release()

    def _close_dropped(self) -> None:
        while self._dropped:
            with suppress(RuntimeError):  # it is closed, or cannot be
                self._dropped.popleft().close()


#: Ends of names that promise what is not written.
OTHER_FORMATS = (".csv", ".json", ".mat", ".toml", ".txt", ".xlsx")
#: The NetCDF library is not thread-safe; every use of it holds this lock.
NETCDF = Lock()


class OpenFile:
    """A file that stays open while one of the results that share it lasts."""

    def __init__(self, dataset: Any) -> None:
        """Args: an open netCDF4.Dataset."""
        self.dataset = dataset
        weakref.finalize(self, NETCDF.drop, dataset)


_OPEN: weakref.WeakValueDictionary[tuple[int, ...], OpenFile] = weakref.WeakValueDictionary()


def shared(path: Path) -> OpenFile:
    """A file, opened only if no result of this process has it open; NETCDF is held.

    HDF5 2.2 crashes where a file with strings is open three times, two of them are closed, and it
    is opened again.
    """
    about = os.stat(path)
    key = about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
    file = _OPEN.get(key)
    if file is None:
        _OPEN[key] = file = OpenFile(opened(path))
    return file


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Whatever the library, or the system, raises while a file is written becomes one sentence.

    Raises:
        ResultError: it refuses.
    """
    try:
        yield
    except ResultError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise cannot("write", path, error) from error


def opened(path: Path, mode: Literal["w", "r+", "r"] = "r") -> Any:
    """A netCDF4.Dataset of a file."""
    import netCDF4

    dataset = netCDF4.Dataset(os.path.abspath(path), mode, format="NETCDF4")
    dataset.set_auto_maskandscale(False)
    return dataset


@contextmanager
def created(path: Path, target: Path) -> Iterator[Any]:
    """A netCDF4.Dataset of a new file to write, closed at the end.

    target: name of the file in error messages.

    Raises:
        ResultError: the library, or the system, refuses; or the name promises another format.
    """
    if target.suffix.lower() in OTHER_FORMATS:
        raise ResultError(
            f"cannot write {target}: what is written is a NetCDF file, such as {target.stem}.nc; "
            "dap3d post and dap3d export make others of it"
        )
    with NETCDF, writing(target):
        dataset = opened(path, "w")
        try:
            yield dataset
        finally:
            dataset.close()


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Holds the lock; whatever a damaged file raises in the library becomes one sentence.

    Raises:
        ResultError: the library cannot read the file.
    """
    with NETCDF:
        try:
            yield
        except ResultError:
            raise
        except Exception as error:
            raise unreadable(path, error) from error


def unreadable(path: Path, error: BaseException) -> ResultError:
    """The error for a file that the library cannot read."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    reason = " ".join(reason.split())
    return ResultError(
        f"cannot read {path}: it is damaged, cut off or being written by another process ({reason})"
    )
