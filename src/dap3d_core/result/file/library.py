"""The NetCDF library: one lock, and its errors in one sentence."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dap3d_core.result.file.atomic_write import cannot

#: The NetCDF library is not made for several threads; every use of it holds this lock.
NETCDF = threading.RLock()


def guarded(path: Path, *actions: Callable[[], Any]) -> Any:
    """Do something with the library; its errors become one sentence. Returns the last value.

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
