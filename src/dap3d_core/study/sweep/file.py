"""Incrementally written sweep file: completed points survive if the process is killed."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Integers
from dap3d_core.result import ResultError
from dap3d_core.result.file.atomic_write import cannot, put_in_place, synchronise
from dap3d_core.result.file.checksum import WHOLE, check_checksums, check_signature, write_checksums
from dap3d_core.result.file.library import NETCDF, created, opened, reading, writing
from dap3d_core.result.file.schema import new_variable, write_attributes
from dap3d_core.result.file.write import GrowingFile
from dap3d_core.study.study import Batch, PointStatus
from dap3d_core.study.sweep.dataset import (
    ABOUT_NOTE,
    ABOUT_STATUS,
    SweepLayout,
    Variable,
    check_format,
    open_sweep,
)

if TYPE_CHECKING:
    import xarray

#: Seconds, and bytes of values, after which points are written.
EVERY, MOST_WAITING = 2.0, 2**26
#: Seconds after which writing that a reader has hindered is tried again.
SOON = 0.05
#: Seconds to wait, at the end, for a reader that has locked the file.
PATIENCE = 10.0
#: Attributes that identify the sweep of a part, and the difference that each shows.
IDENTITY = {
    "scene": "another scene or other settings",
    "varied": "other numbers that vary, or other values",
    "outputs": "other outputs",
    "design": "another design",
    "seed": "another seed",
    "types": "other formulas: the file of a type has changed since",
    "versions": "other versions of dap3d, numpy, llvmlite or python",
}

#: Bytes of a note in the file, allocated from the start.
NOTE = 200


class SweepFile(GrowingFile):
    """The points of a sweep in ``NAME.part``, which gets its name when all are complete.

    The status of a point is written once its values are on the disk. The file is open only while
    it is written: the library does not read a file that another process has open for writing.

    Attributes:
        layout: of the data set.
    """

    def __init__(
        self, layout: SweepLayout, output: str | os.PathLike[str], *, force: bool, resume: bool
    ) -> None:
        """Creates the part, or continues that of an interrupted sweep.

        Args:
            layout: of the data set.
            output: the requested file.
            force: True to overwrite ``output``, or a part of another sweep.
            resume: True to continue the part.

        Raises:
            ResultError: the file cannot be written, or another sweep is writing it; there is a part
                and ``resume`` is off; or it is on, and there is none, or one of another sweep.
        """
        super().__init__(output, force)
        self.layout, self._force = layout, force
        self._waiting: list[tuple[Integers, Batch]] = []
        self._is_empty = not resume
        self._due = time.monotonic() + EVERY
        self._claim, self._file = FileLock(self.target), self.part
        try:
            with NETCDF:
                if resume:
                    self._status = self._stored_status()
                else:
                    self._begin()
                    self._status = np.zeros(layout.count, dtype=np.int8)
        except BaseException:
            self._claim.release()
            raise

    @property
    def todo(self) -> Integers:
        """Indices of the points that are still to be run."""
        return np.flatnonzero(self._status == PointStatus.OPEN)

    def put(self, places: Integers, batch: Batch) -> None:
        """Stores results of some points; now and then everything is written.

        Raises:
            ResultError: it cannot be written.
        """
        self._waiting.append((places, batch))
        self._is_empty = False
        self._status[places] = batch.status
        late = time.monotonic() > self._due
        waiting = 8 * self.layout.width * sum(len(places) for places, _ in self._waiting)
        if late or waiting > MOST_WAITING:
            self._write(0.0)

    def finish(self) -> None:
        """Writes what is left and gives the file its name.

        Raises:
            ResultError: it cannot be written; or another has the name by now and ``force`` is off.
        """
        self._write(PATIENCE)
        # numbers lie between descriptions here: of a large file the first bytes are compared
        with writing(self.part):
            write_checksums(self.part, WHOLE, is_whole=True)
        put_in_place(self.part, self.target, self._force)
        self._file = self.target
        self._claim.release()

    def leave(self) -> None:
        """Writes what is left; the part remains if it holds a point.

        Raises:
            ResultError: it cannot be written.
        """
        try:
            self._write(PATIENCE)
            if self._is_empty:
                self.part.unlink(missing_ok=True)
        finally:
            self._claim.release()

    def dataset(self) -> "xarray.Dataset":
        """Content of the file; of its part before it is complete.

        Raises:
            ResultError: it cannot be read.
        """
        return open_sweep(self._file)

    def _write(self, patience: float) -> None:
        """Writes all stored results to the disk.

        Args:
            patience: seconds to wait for a reader; with 0 writing is postponed.

        Raises:
            ResultError: it cannot be written.
        """
        self._due = time.monotonic() + EVERY
        if not self._waiting:
            return
        with NETCDF, self._opened(patience) as dataset:
            if dataset is None:
                self._due = time.monotonic() + SOON
                return
            places = np.concatenate([places for places, _ in self._waiting])
            order = np.argsort(places)
            places = places[order]
            batches = [batch for _, batch in self._waiting]
            names = [output.name for output in self.layout.outputs]
            values = {n: np.concatenate([b.values[n] for b in batches])[order] for n in names}
            status = np.concatenate([batch.status for batch in batches])[order]
            notes = np.array([note for b in batches for note in b.notes], dtype=object)[order]
            noted = notes != ""
            with writing(self.part):
                for name in names:
                    self._write_at(dataset.variables[name], places, values[name])
                if noted.any():
                    letters = note_letters(notes[noted])
                    self._write_at(dataset.variables["note"], places[noted], letters)
                self._to_disk(dataset)
                self._write_at(dataset.variables["status"], places, status)
                self._to_disk(dataset)
        self._waiting.clear()

    def _to_disk(self, dataset: Any) -> None:
        dataset.sync()
        synchronise(self.part)

    @contextmanager
    def _opened(self, patience: float) -> Iterator[Any]:
        """The part, open for writing; None if a reader has locked it."""
        until = time.monotonic() + patience
        while True:
            try:
                dataset = opened(self.part, "r+")
                break
            except (OSError, RuntimeError) as error:
                if not patience:
                    yield None
                    return
                if time.monotonic() > until:
                    raise cannot("write", self.part, error) from error
                time.sleep(0.05)
        dataset.set_auto_chartostring(False)
        try:
            yield dataset
        finally:
            with writing(self.part):
                dataset.close()

    def _write_at(self, variable: Any, places: Integers, values: NDArray[Any]) -> None:
        """Writes values of points (k, ...) with rising indices."""
        breaks = np.flatnonzero(np.diff(places) != 1) + 1
        for run in np.split(np.arange(len(places)), breaks):
            first, done = int(places[run[0]]), int(run[0])
            for index, count in boxes(self.layout.shape, first, first + len(run)):
                lengths = [part.stop - part.start for part in index]
                block = values[done : done + count]
                variable[index] = block.reshape(*lengths, *values.shape[1:])
                done += count

    def _begin(self) -> None:
        """Creates the part; with ``force`` it replaces one of another sweep."""
        if os.path.lexists(self.part):
            if not self._force:
                raise ResultError(
                    f"cannot write {self.target}: {self.part.name} is there, of a sweep that was "
                    "ended or goes on; resume goes on with it, force begins anew"
                )
            self._check_part("cannot overwrite")
            self.part.unlink()
        wanted = self.part
        with self._new_part() as new, created(new, self.target) as dataset:
            define(dataset, self.layout)
        if self.part != wanted:  # another process was quicker
            self.part.unlink()
            raise ResultError(
                f"cannot write {self.target}: another sweep has just begun {wanted.name}"
            )

    def _stored_status(self) -> NDArray[np.int8]:
        """Status of all points in the part, which has to be of the same sweep."""
        if not os.path.lexists(self.part):
            raise ResultError(
                f"cannot resume: there is no {self.part}; without resume the sweep begins anew"
            )
        self._check_part("cannot resume")
        with reading(self.part), opened(self.part) as dataset:
            difference = self._difference(dataset)
            if difference:
                raise ResultError(
                    f"cannot resume: {self.part} is of another sweep: it has {difference}; ask for "
                    "the same, or begin anew with force"
                )
            return np.array(dataset.variables["status"][...], np.int8).ravel()

    def _check_part(self, verb: str) -> None:
        """Refuses a part that is not of a sweep."""
        try:
            check_signature(self.part, "sweep")
            check_checksums(self.part)
            with reading(self.part), opened(self.part) as dataset:
                check_format(self.part, dataset)
        except ResultError as error:
            raise ResultError(f"{verb}: {error}; move it away, or name another file") from error

    def _difference(self, dataset: Any) -> str:
        """The difference between the sweep of a part and this one, "" if they are equal."""
        there, here = dataset.ncattrs(), self.layout.attributes
        for name, difference in IDENTITY.items():
            if (dataset.getncattr(name) if name in there else None) != here.get(name):
                return difference
        for coordinate in self.layout.coordinates:
            variable = dataset.variables.get(coordinate.name)
            fits = variable is not None and variable.shape == coordinate.values.shape
            if not fits or not np.array_equal(variable[...], coordinate.values):
                return f"other values of {coordinate.name}"
        for output in self.layout.outputs:
            variable = dataset.variables.get(output.name)
            if variable is None or variable.shape != self.layout.shape_of(output):
                return IDENTITY["outputs"]
        if dataset.variables["status"].shape != self.layout.shape:
            return "another number of points"
        return ""


class FileLock:
    """A lock on ``NAME.lock`` next to a sweep's file, held from its first point to its end.

    The system lets go of it when the process ends, however it ends: a lock file that is left over
    blocks nobody. Where the system has no such locks nothing is held.
    """

    def __init__(self, target: Path) -> None:
        """Take it.

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


def boxes(shape: tuple[int, ...], first: int, last: int) -> Iterator[tuple[Any, int]]:
    """Splits points ``first`` to ``last`` (exclusive) of a grid in C order into blocks.

    Yields:
        Index of a block, and its number of points.
    """
    if first >= last:
        return
    inner = int(np.prod(shape[1:]))
    row, begin = divmod(first, inner)
    end_row, end = divmod(last, inner)
    if begin and row == end_row:
        yield from _rows(shape, row, begin, end)
        return
    if begin:
        yield from _rows(shape, row, begin, inner)
        row += 1
    if row < end_row:
        index = (slice(row, end_row), *(slice(0, length) for length in shape[1:]))
        yield index, (end_row - row) * inner
    if end:
        yield from _rows(shape, end_row, 0, end)


def _rows(shape: tuple[int, ...], row: int, first: int, last: int) -> Iterator[tuple[Any, int]]:
    """The same within one row of the first axis."""
    for index, count in boxes(shape[1:], first, last):
        yield (slice(row, row + 1), *index), count


def note_letters(notes: NDArray[Any]) -> NDArray[np.bytes_]:
    """(k, NOTE) bytes of notes in UTF-8, shortened where they are longer."""
    letters = np.zeros((len(notes), NOTE), dtype="S1")
    for row, note in zip(letters, notes, strict=True):
        text = str(note).encode("utf-8", "replace")
        if len(text) > NOTE:
            text = text[: NOTE - 4].decode("utf-8", "ignore").encode() + b" ..."
        row[: len(text)] = np.frombuffer(text, dtype="S1")
    return letters


def define(dataset: Any, layout: SweepLayout) -> None:
    """Defines a new file, each variable contiguous, and writes what is known.

    Outputs are NaN at first; absent notes take no space on a disk.
    """
    for name, length in layout.sizes.items():
        dataset.createDimension(name, length)
    dataset.createDimension("note_length", NOTE)
    for coordinate in layout.coordinates:
        variable = _variable(dataset, coordinate, "f8")
        variable[...] = coordinate.values
    names = [c.name for c in layout.coordinates if c.name not in layout.sizes]
    last = (-1,) * len(layout.dimensions)
    for output in layout.outputs:
        variable = _variable(dataset, output, "f8", np.nan)
        if names and not any(" " in name for name in names):
            variable.setncattr_string("coordinates", " ".join(names))
        variable[(-1,) * len(output.dimensions)] = np.nan  # allocates it
    status = _variable(dataset, Variable("status", layout.dimensions, ABOUT_STATUS), "i1")
    status[last] = PointStatus.OPEN
    dimensions = (*layout.dimensions, "note_length")
    note = _variable(dataset, Variable("note", dimensions, ABOUT_NOTE), "S1")
    note.set_auto_chartostring(False)
    note.setncattr("_Encoding", "utf-8")
    note[(*last, -1)] = b""
    write_attributes(dataset, layout.attributes)


def _variable(dataset: Any, variable: Variable, kind: str, fill: Any = False) -> Any:
    name, dimensions, about = variable.name, variable.dimensions, variable.about
    return new_variable(dataset, name, kind, dimensions, about, fill, contiguous=True)
