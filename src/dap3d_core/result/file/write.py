"""Writing of NetCDF-4 files: results as a whole, and files that grow with a run or a sweep."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.result.arrays import Arrays, ModelSummary
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import (
    check_target,
    check_utf8,
    named_part,
    reserve,
    synchronise,
    whole_file,
)
from dap3d_core.result.file.checksum import write_checksums
from dap3d_core.result.file.library import NETCDF, created, guarded, opened
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
    check_utf8("write", path)
    target = Path(path)
    with whole_file(path, force) as part:
        with created(part, target) as dataset:

            def write() -> int:
                rows = define(dataset, summary, record, len(arrays), with_error=arrays.has_error)
                first = 0
                for block in arrays.blocks():
                    write_rows(dataset, block, first)
                    write_times(dataset, block, first)
                    first += len(block)
                return rows

            rows = guarded(target, write)
        guarded(target, lambda: write_checksums(part, rows, is_whole=True))


class GrowingFile:
    """A NetCDF-4 file ``NAME.part`` that grows with a computation, readable at any moment.

    All numbers have fixed locations from the start, and a mark (time, status) is written after the
    values that it represents: a killed process leaves what it had written.

    Attributes:
        target: the requested file.
        part: the file that grows, in the same folder.
    """

    def __init__(self, path: str | os.PathLike[str], force: bool) -> None:
        check_utf8("write", path)
        self.target = check_target(path, force)
        self.part = self.target.with_name(f"{self.target.name}.part")

    def _create(
        self,
        definition: Callable[[Any], Any],
        completion: Callable[[Path, Any], None] = lambda new, value: None,
    ) -> Path:
        """Creates the file under a temporary name and names it ``NAME.part`` or the next free.

        Killed meanwhile it leaves no half-defined part.

        Args:
            definition: defines the data set.
            completion: receives the path of the closed file, and what ``definition`` returned.
        """
        new = reserve(self.target)
        try:
            with created(new, self.target) as dataset:
                value = guarded(self.target, lambda: definition(dataset))
            completion(new, value)
            return named_part(new, self.target)
        except BaseException:
            new.unlink(missing_ok=True)
            raise

    def _append(
        self, dataset: Any, values: Callable[[], None], marks: Callable[[], None], *, durable: bool
    ) -> None:
        """Writes values, then their marks, and hands both to the system, or to the disk."""

        def flush() -> None:
            dataset.sync()
            if durable:
                synchronise(self.part)

        guarded(self.part, values, flush, marks, flush)


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

        def allocate(new: Path, rows: int) -> None:
            # opened again, so that the description of the file shares no block with the rows
            self._dataset = guarded(self.target, lambda: opened(new, "r+"))
            guarded(self.target, lambda: allocate_rows(self._dataset), self._dataset.sync)
            if most:
                guarded(self.target, lambda: write_checksums(new, rows, is_whole=False))

        with NETCDF:
            try:
                self.part = self._create(lambda d: define(d, summary, started, most), allocate)
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
                self._append(
                    self._dataset,
                    lambda: write_rows(self._dataset, arrays, self.count),
                    lambda: write_times(self._dataset, arrays, self.count),
                    durable=False,
                )
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
        guarded(self.part, lambda: synchronise(self.part))

    def close(self) -> None:
        """Closes the part."""
        with NETCDF:
            dataset, self._dataset = self._dataset, None
            if dataset is not None:
                guarded(self.part, dataset.close)

    def discard(self) -> None:
        """Closes the part and removes it."""
        with suppress(ResultError):
            self.close()
        self.part.unlink(missing_ok=True)
