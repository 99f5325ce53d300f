"""A sweep's file that grows with it: whoever kills the sweep leaves the points that were run."""

import os
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result import ResultError, check_target
from dap3d_core.result.file.atomic_write import (
    cannot,
    check_utf8,
    named_part,
    put_in_place,
    reserve,
    synchronise,
)
from dap3d_core.result.file.checksum import WHOLE, check_seal, write_seal
from dap3d_core.result.file.library import NETCDF, guarded
from dap3d_core.result.open import check_signature, unreadable
from dap3d_core.study.study import Batch, PointStatus
from dap3d_core.study.sweep.dataset import Layout, check_format
from dap3d_core.study.sweep.file_claim import Claim
from dap3d_core.study.sweep.schema import NOTE, boxes, cut, define

Integers = NDArray[np.int64]

#: Seconds, and bytes of values, after which points are written.
EVERY, MOST_WAITING = 2.0, 2**26
#: Seconds to wait, at the end, for a reader who has locked the file.
PATIENCE = 10.0
#: Attributes by which a part is known to be of the same sweep, and what each is.
IDENTITY = {
    "scene": "another scene or other settings",
    "varied": "other numbers that vary, or other values",
    "outputs": "other outputs",
    "design": "another design",
    "seed": "another seed",
    "pack": "packs of another size",
    "types": "other formulas: the file of a type has changed since",
    "versions": "other versions of dap3d, numpy, llvmlite or python",
}


class Growing:
    """The points of a sweep in ``NAME.part``, which gets its name when all are run.

    The place of every number is fixed from the start, and a point's status is written once its
    values are on the disk: the file is whole at any moment. It is open only while it is written,
    for the library lets nobody read a file that another process has open for writing.

    Attributes:
        layout: of the data set.
        target: the file that is wanted in the end.
        part: the file that grows, in the same folder.
    """

    def __init__(
        self, layout: Layout, output: str | os.PathLike[str], *, force: bool, resume: bool
    ) -> None:
        """Make the part, or go on with that of a sweep that was ended.

        Args:
            layout: of the data set.
            output: the file that is wanted in the end.
            force: whether ``output``, or a part of another sweep, may be overwritten.
            resume: whether to go on with the part that is there.

        Raises:
            ResultError: the file cannot be written, or another sweep is writing it; there is a part
                and ``resume`` is off; or it is on, and there is none, or one of another sweep.
        """
        self.layout, self._force = layout, force
        check_utf8("write", output)
        self.target = check_target(output, force)
        self.part = self.target.with_name(f"{self.target.name}.part")
        self._waiting: list[tuple[Integers, Batch]] = []
        self._is_empty = not resume
        self._written = time.monotonic()
        self._claim = Claim(self.target)
        try:
            with NETCDF:
                if resume:
                    self._status = self._again()
                else:
                    self._new()
                    self._status = np.zeros(layout.count, dtype=np.int8)
        except BaseException:
            self._claim.release()
            raise

    @property
    def todo(self) -> Integers:
        """The points that are still to be run."""
        return np.flatnonzero(self._status == PointStatus.OPEN)

    def put(self, places: Integers, batch: Batch) -> None:
        """Keep what came of some points; now and then everything is written.

        Raises:
            ResultError: it cannot be written.
        """
        self._waiting.append((places, batch))
        self._is_empty = False
        self._status[places] = batch.status
        late = time.monotonic() - self._written > EVERY
        waiting = 8 * self.layout.width * sum(len(places) for places, _ in self._waiting)
        if late or waiting > MOST_WAITING:
            self._write(0.0)

    def finish(self) -> None:
        """Write what is left and give the file its name.

        Raises:
            ResultError: it cannot be written; or another has the name by now and ``force`` is off.
        """
        self._write(PATIENCE)
        # numbers stand between descriptions here, so the beginning is what a large one is known by
        guarded(self.part, lambda: write_seal(self.part, WHOLE, is_whole=True))
        put_in_place(self.part, self.target, self._force)
        self._claim.release()

    def leave(self) -> None:
        """Write what is left; the part stays where it holds a point.

        Raises:
            ResultError: it cannot be written.
        """
        try:
            self._write(PATIENCE)
            if self._is_empty:
                self.part.unlink(missing_ok=True)
        finally:
            self._claim.release()

    def _write(self, patience: float) -> None:
        """Write what was kept, and wait until it is on the disk.

        Args:
            patience: seconds to wait for a reader; with 0 it is put off.

        Raises:
            ResultError: it cannot be written.
        """
        self._written = time.monotonic()
        if not self._waiting:
            return
        places = np.concatenate([places for places, _ in self._waiting])
        order = np.argsort(places)
        batches = [batch for _, batch in self._waiting]
        with NETCDF:
            dataset = self._open(patience)
            if dataset is None:
                return
            try:
                guarded(
                    self.part,
                    lambda: self._write_values(dataset, places[order], batches, order),
                    lambda: self._to_disk(dataset),
                    lambda: self._write_status(dataset, places[order], batches, order),
                    lambda: self._to_disk(dataset),
                )
            finally:
                guarded(self.part, dataset.close)
        self._waiting.clear()

    def _open(self, patience: float) -> Any:
        """The part, open for writing; None where a reader has it."""
        import netCDF4

        until = time.monotonic() + patience
        while True:
            try:
                dataset = netCDF4.Dataset(os.path.abspath(self.part), "r+")
            except (OSError, RuntimeError) as error:
                if not patience:
                    return None
                if time.monotonic() > until:
                    raise cannot("write", self.part, error) from error
                time.sleep(0.05)
            else:
                dataset.set_auto_maskandscale(False)
                dataset.set_auto_chartostring(False)
                return dataset

    def _write_values(
        self, dataset: Any, places: Integers, batches: list[Batch], order: NDArray[np.intp]
    ) -> None:
        variables = dataset.variables
        for output in self.layout.outputs:
            values = np.concatenate([batch.values[output.name] for batch in batches])[order]
            self._write_at(variables[output.name], places, values)
        notes = np.array([note for batch in batches for note in batch.notes], dtype=object)[order]
        told = notes != ""
        if told.any():
            letters = np.zeros((int(told.sum()), NOTE), dtype="S1")
            for row, note in zip(letters, notes[told], strict=True):
                words = cut(str(note))
                row[: len(words)] = np.frombuffer(words, dtype="S1")
            self._write_at(variables["note"], places[told], letters)

    def _write_status(
        self, dataset: Any, places: Integers, batches: list[Batch], order: NDArray[np.intp]
    ) -> None:
        status = np.concatenate([batch.status for batch in batches])[order]
        self._write_at(dataset.variables["status"], places, status)

    def _write_at(self, variable: Any, places: Integers, values: NDArray[Any]) -> None:
        """Write values of points (k, ...) whose places rise."""
        shape = self.layout.shape
        breaks = np.flatnonzero(np.diff(places) != 1) + 1
        for run in np.split(np.arange(len(places)), breaks):
            first, done = int(places[run[0]]), int(run[0])
            for index, count in boxes(shape, first, first + len(run)):
                block = values[done : done + count]
                lengths = [part.stop - part.start for part in index]
                variable[index] = block.reshape(*lengths, *values.shape[1:])
                done += count

    def _to_disk(self, dataset: Any) -> None:
        dataset.sync()
        synchronise(self.part)

    def _new(self) -> None:
        """A new part; one of another sweep makes way where that is wanted."""
        import netCDF4

        if os.path.lexists(self.part):
            if not self._force:
                raise ResultError(
                    f"cannot write {self.target}: {self.part.name} is there, of a sweep that was "
                    "ended or goes on; resume goes on with it, force begins anew"
                )
            self._check_part("cannot overwrite")
            self.part.unlink()
        new = reserve(self.target)  # killed now it leaves nothing that is half a part
        try:
            dataset = guarded(
                self.target, lambda: netCDF4.Dataset(os.path.abspath(new), "w", format="NETCDF4")
            )
            try:
                guarded(self.target, lambda: define(dataset, self.layout))
            finally:
                guarded(self.target, dataset.close)
            part = named_part(new, self.target)
            if part != self.part:  # another process was quicker
                part.unlink()
                raise ResultError(
                    f"cannot write {self.target}: another sweep has just begun {self.part.name}"
                )
        except BaseException:
            new.unlink(missing_ok=True)
            raise

    def _again(self) -> NDArray[np.int8]:
        """The status of all points in the part that is there, when it is of the same sweep."""
        import netCDF4

        if not os.path.lexists(self.part):
            raise ResultError(
                f"cannot resume: there is no {self.part}; without resume the sweep begins anew"
            )
        self._check_part("cannot resume")
        try:
            with netCDF4.Dataset(os.path.abspath(self.part), "r") as dataset:
                dataset.set_auto_maskandscale(False)
                self._check_same(dataset)
                return np.array(dataset.variables["status"][...], np.int8).ravel()
        except ResultError:
            raise
        except Exception as error:  # whatever a damaged file makes of it
            raise unreadable(self.part, error) from error

    def _check_part(self, verb: str) -> None:
        """Refuse a part that is no sweep's."""
        import netCDF4

        try:
            check_signature(self.part, "sweep")
            check_seal(self.part)
            with netCDF4.Dataset(os.path.abspath(self.part), "r") as dataset:
                check_format(self.part, dataset)
        except Exception as error:  # whatever a damaged file makes of it
            if not isinstance(error, ResultError):
                error = unreadable(self.part, error)
            raise ResultError(f"{verb}: {error}; move it away, or name another file") from error

    def _check_same(self, dataset: Any) -> None:
        """Refuse a part of another sweep; says in what it differs."""
        there, here = dataset.ncattrs(), self.layout.attributes
        for name, what in IDENTITY.items():
            found = dataset.getncattr(name) if name in there else None
            if found != here.get(name):
                raise self._another(what)
        for coordinate in self.layout.coordinates:
            variable = dataset.variables.get(coordinate.name)
            fits = variable is not None and variable.shape == coordinate.values.shape
            if not fits or not np.array_equal(variable[...], coordinate.values):
                raise self._another(f"other values of {coordinate.name}")
        for output in self.layout.outputs:
            variable = dataset.variables.get(output.name)
            if variable is None or variable.shape != self.layout.shape_of(output):
                raise self._another(IDENTITY["outputs"])
        if dataset.variables["status"].shape != self.layout.shape:
            raise self._another("another number of points")

    def _another(self, what: str) -> ResultError:
        return ResultError(
            f"cannot resume: {self.part} is of another sweep: it has {what}; ask for the same, or "
            "begin anew with force"
        )
