"""The NetCDF library: one lock, and one sentence for its errors."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import cannot

#: The NetCDF library is not thread-safe; every use of it holds this lock.
NETCDF = threading.RLock()


def guarded(path: Path, *actions: Callable[[], Any]) -> Any:
    """Calls actions that use the library to write a file, and returns the last value.

    Raises:
        ResultError: the library, or the system, refuses.
    """
    value = None
    try:
        for action in actions:
            value = action()
    except (OSError, RuntimeError, ValueError) as error:
        raise cannot("write", path, error) from error
    return value


def opened(path: Path, mode: Literal["w", "r+", "r"] = "r") -> Any:
    """A netCDF4.Dataset of a file."""
    import netCDF4

    dataset = netCDF4.Dataset(os.path.abspath(path), mode, format="NETCDF4")
    dataset.set_auto_maskandscale(False)
    return dataset


@contextmanager
def created(path: Path, target: Path) -> Iterator[Any]:
    """A netCDF4.Dataset of a new file, closed at the end.

    Args:
        path: the new file.
        target: name of the file in error messages.

    Raises:
        ResultError: the library, or the system, refuses.
    """
    with NETCDF:
        dataset = guarded(target, lambda: opened(path, "w"))
        try:
            yield dataset
        finally:
            guarded(target, dataset.close)


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
