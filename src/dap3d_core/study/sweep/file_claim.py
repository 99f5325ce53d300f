"""The right to write a sweep's file, which one sweep has at a time."""

import os
from pathlib import Path

from dap3d_core.result import ResultError
from dap3d_core.result.file.atomic_write import cannot


class FileLock:
    """A lock on ``NAME.lock`` next to a sweep's file, held from its first point to its end.

    The system lets go of it when the process ends, however it ends: a lock file that is left over
    blocks nobody. Where the system has no such locks nothing is held.
    """

    def __init__(self, target: Path) -> None:
        """Take it.

        Args:
            target: the file that the sweep is to write.

        Raises:
            ResultError: another sweep has it; the folder cannot be written to.
        """
        self._path = target.with_name(f"{target.name}.lock")
        self._file: int | None = None
        try:
            import fcntl
        except ImportError:  # Windows
            return
        while self._file is None:
            try:
                file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            except OSError as error:
                raise cannot("write", target, error) from error
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                os.close(file)
                raise ResultError(
                    f"cannot write {target}: another sweep is writing it now; wait for its end, or "
                    "name another file"
                ) from error
            except OSError:  # a file system without locks
                os.close(file)
                return
            if self._is_at_its_path(file):
                self._file = file
            else:  # who had it has removed the file meanwhile
                os.close(file)

    def _is_at_its_path(self, file: int) -> bool:
        try:
            return os.path.samestat(os.fstat(file), self._path.stat())
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let others have it."""
        if self._file is None:
            return
        if not os.fstat(self._file).st_size:  # else somebody's own file has this name
            self._path.unlink(missing_ok=True)
        os.close(self._file)
        self._file = None
