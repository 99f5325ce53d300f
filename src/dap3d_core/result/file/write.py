"""Writing of NetCDF-4 files: results as a whole, and files that grow with a run or a sweep."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.result.arrays import Arrays, ModelSummary
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file import atomic_write
from dap3d_core.result.file.checksum import write_checksums
from dap3d_core.result.file.library import NETCDF, created, opened, writing
from dap3d_core.result.file.schema import allocate_rows, define, write_rows, write_times
from dap3d_core.result.metadata import RUNNING, RunMetadata


def save(
    summary: ModelSummary,
    record: RunMetadata,
    arrays: Arrays,
    path: str | os.PathLike[str],
    force: bool = False,
) -> None:
    """Writes a result to a file, whole or not at all, block by block.

    Raises:
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    atomic_write.check_utf8("write", path)
    target = Path(path)
    with atomic_write.whole_file(path, force) as part:
        with created(part, target) as dataset:
            rows = define(dataset, summary, record, len(arrays), with_error=arrays.has_error)
            first = 0
            for block in arrays.blocks():
                write_rows(dataset, block, first)
                write_times(dataset, block, first)
                first += len(block)
        with writing(target):
            write_checksums(part, rows, is_whole=True)


class GrowingFile:
    """A NetCDF-4 file ``NAME.part`` that grows with a computation, readable at any moment.

    All numbers have fixed locations from the start, and a mark (time, status) is written after the
    values that it represents: a killed process leaves what it had written.

    Attributes:
        target: the requested file.
        part: the file that grows, in the same folder.
    """

    def __init__(self, path: str | os.PathLike[str], force: bool) -> None:
        atomic_write.check_utf8("write", path)
        self.target = atomic_write.check_target(path, force)
        self.part = self.target.with_name(f"{self.target.name}.part")

    @contextmanager
    def _new_part(self) -> Iterator[Path]:
        """A temporary file to define; at the end its name is ``NAME.part`` or the next free one.

        A process that is killed meanwhile leaves no half-defined part.
        """
        new = atomic_write.reserve(self.target)
        try:
            yield new
            self.part = atomic_write.named_part(new, self.target)
        except BaseException:
            new.unlink(missing_ok=True)
            raise


class ResultWriter(GrowingFile):
    """A result file that grows with the run.

    ``save`` writes the final file anew: its times may be fewer, its attributes longer, and a
    process killed while those of the part are changed would lose all rows.

    Attributes:
        count: rows written so far.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        summary: ModelSummary,
        record: RunMetadata,
        most: int,
        *,
        force: bool = False,
    ) -> None:
        """Creates the file and writes all but the rows.

        Args:
            path: the requested file.
            summary: model of the rows.
            record: metadata at the start of the run; its status is ignored.
            most: largest number of rows.
            force: True if ``path`` may exist.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        super().__init__(path, force)
        self.count = 0
        self._dataset: Any = None
        started = attrs.evolve(record, status=RUNNING)
        with NETCDF:
            try:
                with self._new_part() as new, writing(self.target):
                    with created(new, self.target) as dataset:
                        rows = define(dataset, summary, started, most)
                    # opened again: the description of the file shares no block with the rows
                    self._dataset = opened(new, "r+")
                    allocate_rows(self._dataset)
                    self._dataset.sync()
                    if most:
                        write_checksums(new, rows, is_whole=False)
            except BaseException:
                with suppress(ResultError):
                    self.close()
                raise

    def append(self, arrays: Arrays) -> None:
        """Writes rows, and hands them to the system.

        Raises:
            ResultError: they cannot be written. The writer is then closed: the part holds the
                earlier rows, and accepts no later ones, which would leave a gap.
        """
        if self._dataset is None:
            raise ResultError(f"cannot write {self.target}: the writer is closed")
        with NETCDF:
            try:
                with writing(self.part):
                    write_rows(self._dataset, arrays, self.count)
                    self._dataset.sync()
                    write_times(self._dataset, arrays, self.count)
                    self._dataset.sync()
            except ResultError:
                with suppress(ResultError):
                    self.close()
                raise
        self.count += len(arrays)

    def to_disk(self) -> None:
        """Waits until all rows are on the disk, so that they outlast a loss of power.

        Raises:
            ResultError: the system refuses.
        """
        with writing(self.part):
            atomic_write.synchronise(self.part)

    def close(self) -> None:
        """Closes the part."""
        with NETCDF:
            dataset, self._dataset = self._dataset, None
            if dataset is not None:
                with writing(self.part):
                    dataset.close()

    def discard(self) -> None:
        """Closes the part and removes it."""
        with suppress(ResultError):
            self.close()
        self.part.unlink(missing_ok=True)
