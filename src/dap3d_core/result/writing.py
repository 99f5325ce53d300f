"""Writing results to NetCDF-4 files: whole, or growing with the run."""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import attrs

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import arrays_of
from dap3d_core.result.errors import ResultError
from dap3d_core.result.files import cannot, check_target, put_in_place, reserve, whole_file
from dap3d_core.result.layout import attributes, define, write_attributes, write_rows
from dap3d_core.result.record import RUNNING, Record
from dap3d_core.result.subject import subject_of

if TYPE_CHECKING:
    from dap3d_core.result.result import Result

#: The NetCDF library is not made for several threads; every use of it holds this lock.
NETCDF = threading.RLock()


def save(result: "Result", path: str | os.PathLike[str], force: bool = False) -> None:
    """Write a result to a file, whole or not at all.

    Raises:
        ResultError: the file cannot be written, or exists and ``force`` is off.
    """
    with whole_file(path, force) as part, NETCDF:
        dataset = _guarded(Path(path), lambda: _create(part))
        try:
            _guarded(
                Path(path),
                lambda: define(
                    dataset,
                    result.subject,
                    result.record,
                    len(result.t),
                    with_error=result.arrays.u_error is not None,
                ),
                lambda: write_rows(dataset, result.arrays, 0),
            )
        finally:
            _guarded(Path(path), dataset.close)


class ResultWriter:
    """A result file that grows with the run: a killed run leaves what it had reported.

    Rows go to ``part``, a file beside the one that is wanted; ``close`` gives it its name. As a
    context manager it closes the part without renaming it where an error leaves the block.

    Attributes:
        path: the file that is wanted.
        part: the file that grows, ``NAME.part`` in the same folder.
        count: rows written so far.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        model: Model,
        record: Record,
        *,
        force: bool = False,
    ) -> None:
        """Make the file and write all but the rows.

        Args:
            path: the file that is wanted.
            model: whose rows will come.
            record: what is known of the run as it starts; its status is not used.
            force: whether an existing file is overwritten in the end.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        self.path = check_target(path, force)
        self.part = reserve(self.path)
        self.count = 0
        self._force = force
        self._subject = subject_of(model)
        self._dataset: Any = None
        started = attrs.evolve(record, status=RUNNING)
        try:
            with NETCDF:
                self._dataset = _guarded(self.path, lambda: _create(self.part))
                self._do(lambda: define(self._dataset, self._subject, started, None), self._sync)
        except BaseException:
            with suppress(ResultError):
                self.leave()
            self.part.unlink(missing_ok=True)
            raise

    def append(self, rows: Floats) -> None:
        """Write rows as the integrator delivers them (k, width), and hand them to the system.

        Raises:
            ResultError: they cannot be written. The writer is then closed: the part holds what
                came before, and takes no later rows, which would leave a gap.
            ValueError: they have the wrong width.
        """
        arrays = arrays_of(rows, self._subject)
        with NETCDF:
            try:
                self._do(lambda: write_rows(self._dataset, arrays, self.count), self._sync)
            except ResultError:
                with suppress(ResultError):
                    self.leave()
                raise
        self.count += len(arrays.t)

    def close(self, record: Record) -> Path:
        """Write how the run ended, close the file and give it its name; returns the path.

        Raises:
            ResultError: it cannot be written; the part stays where it is.
        """
        with NETCDF:
            self._do(lambda: write_attributes(self._dataset, attributes(self._subject, record)))
            self.leave()
        check_target(self.path, self._force)
        put_in_place(self.part, self.path)
        return self.path

    def leave(self) -> None:
        """Close the part as it is, unfinished."""
        with NETCDF:
            dataset, self._dataset = self._dataset, None
            if dataset is not None:
                _guarded(self.part, dataset.close)

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

    def _do(self, *actions: Callable[[], object]) -> None:
        if self._dataset is None:
            raise ResultError(f"cannot write {self.path}: the writer is closed")
        _guarded(self.part, *actions)


def _create(path: Path) -> Any:
    import netCDF4

    return netCDF4.Dataset(os.path.abspath(path), "w", format="NETCDF4")


def _guarded(path: Path, *actions: Callable[[], Any]) -> Any:
    """Do something with the library; its errors become one sentence. Returns the last value."""
    value = None
    try:
        for action in actions:
            value = action()
    except (OSError, RuntimeError, ValueError) as error:
        raise cannot("write", path, error) from error
    return value
