"""Writing results to NetCDF-4 files: whole, or growing with the run."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

import attrs

from dap3d_core.result.arrays import Arrays
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import (
    check_target,
    check_utf8,
    named_part,
    reserve,
    synchronise,
    whole_file,
)
from dap3d_core.result.file.checksum import write_seal
from dap3d_core.result.file.library import NETCDF, guarded
from dap3d_core.result.file.schema import define, take_places, write_rows, write_times
from dap3d_core.result.metadata import RUNNING, Record

if TYPE_CHECKING:
    from dap3d_core.result.model_summary import Subject
    from dap3d_core.result.result import Result


def save(result: "Result", path: str | os.PathLike[str], force: bool = False) -> None:
    """Write a result to a file, whole or not at all, block by block.

    Raises:
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    check_utf8("write", path)
    arrays = result.arrays
    # killed now it leaves nothing that is called a part and is none
    with whole_file(path, force) as part, NETCDF:
        dataset = guarded(Path(path), lambda: _opened(part))

        def write() -> int:
            nt = len(arrays)
            rows = define(dataset, result.subject, result.record, nt, with_error=arrays.has_error)
            first = 0
            for block in arrays.blocks():
                write_rows(dataset, block, first)
                write_times(dataset, block, first)
                first += len(block)
            return rows

        try:
            rows = guarded(Path(path), write)
        finally:
            guarded(Path(path), dataset.close)
        guarded(Path(path), lambda: write_seal(part, rows, is_whole=True))


class ResultWriter:
    """A result file that grows with the run: a killed run leaves what it had reported.

    Its places are fixed from the start (layout.take_places), so that it is whole at any moment. As
    a context manager it closes the file at the end of the block.

    Attributes:
        path: the result file that is wanted in the end, which ``save`` makes.
        part: the file that grows, ``NAME.part`` in the same folder.
        count: rows written so far.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        subject: "Subject",
        record: Record,
        most: int,
        *,
        force: bool = False,
    ) -> None:
        """Make the file and write all but the rows.

        Args:
            path: the file that is wanted in the end.
            subject: whose rows will come.
            record: what is known of the run as it starts; its status is not used.
            most: how many rows will come at most.
            force: whether ``path`` may exist.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        self.path = check_target(path, force)
        self.part = reserve(self.path)  # killed now it leaves nothing that is half a part
        self.count = 0
        self._dataset: Any = None
        started = attrs.evolve(record, status=RUNNING)
        try:
            with NETCDF:
                self._dataset = guarded(self.path, lambda: _opened(self.part))
                rows = self._do(lambda: define(self._dataset, subject, started, most))
                self.leave()  # what describes the file lies before the rows and is not shared
                self._dataset = guarded(self.path, lambda: _opened(self.part, "r+"))
                self._do(lambda: take_places(self._dataset), self._sync)
                if most:
                    guarded(self.path, lambda: write_seal(self.part, rows, is_whole=False))
            self.part = named_part(self.part, self.path)
        except BaseException:
            self.discard()
            raise

    def append(self, arrays: Arrays) -> None:
        """Write what was reported, and hand it to the system.

        Raises:
            ResultError: it cannot be written. The writer is then closed: the part holds what
                came before, and takes no later rows, which would leave a gap.
        """
        with NETCDF:
            try:
                self._do(
                    lambda: write_rows(self._dataset, arrays, self.count),
                    self._sync,
                    lambda: write_times(self._dataset, arrays, self.count),
                    self._sync,
                )
            except ResultError:
                with suppress(ResultError):
                    self.leave()
                raise
        self.count += len(arrays)

    def to_disk(self) -> None:
        """Wait until all rows are on the disk, so that they outlast a loss of power.

        Raises:
            ResultError: the system refuses.
        """
        guarded(self.part, lambda: synchronise(self.part))

    def leave(self) -> None:
        """Close the part as it is."""
        with NETCDF:
            dataset, self._dataset = self._dataset, None
            if dataset is not None:
                guarded(self.part, dataset.close)

    def discard(self) -> None:
        """Close the part and remove it."""
        with suppress(ResultError):
            self.leave()
        self.part.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.leave()

    def _sync(self) -> None:
        self._dataset.sync()

    def _do(self, *actions: Callable[[], object]) -> Any:
        if self._dataset is None:
            raise ResultError(f"cannot write {self.path}: the writer is closed")
        return guarded(self.part, *actions)


def _opened(path: Path, mode: Literal["w", "r+"] = "w") -> Any:
    import netCDF4

    return netCDF4.Dataset(os.path.abspath(path), mode, format="NETCDF4")
