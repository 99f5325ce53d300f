"""Reading results from NetCDF-4 files."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.result.arrays import Arrays
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import beginning, check_utf8
from dap3d_core.result.file.checksum import check_seal
from dap3d_core.result.file.lazy_arrays import LARGE, FileArrays
from dap3d_core.result.file.library import NETCDF
from dap3d_core.result.file.schema import CONSTANTS, CONVENTIONS, FORMAT, SWEEP, record_of
from dap3d_core.result.file.validate import check_attributes, check_claims, check_subject
from dap3d_core.result.metadata import RUNNING, Record
from dap3d_core.result.model_summary import Subject, is_subject_of
from dap3d_core.result.result import Rebuild, Result

_HDF5 = b"\x89HDF\r\n\x1a\n"
_JSON = ("notes", "settings", "statistics", "versions", "events", "types")


def open_result(path: str | os.PathLike[str], rebuild: Rebuild | None = None) -> Result:
    """Read a result from a file; the file is closed again.

    Args:
        path: the file.
        rebuild: makes the model and a way to a machine from the text of a scene; used when the
            Jacobian or a reaction is asked for, without it these are refused.

    Returns:
        The result, its arrays equal to the saved ones bit for bit; those of a large file are read
        when they are asked for. Of a file whose writer was killed, what it had written: its status
        is "interrupted" and a note says so.

    Raises:
        ResultError: there is no such file, it is not a result, it is damaged, or it was written by
            a newer dap3d.
    """
    file = Path(path)
    check_signature(file)
    check_seal(file)
    with NETCDF:
        import netCDF4

        try:
            dataset = netCDF4.Dataset(os.path.abspath(file), "r")
        except Exception as error:  # whatever a damaged file makes of it
            raise unreadable(file, error) from error
        try:
            dataset.set_auto_maskandscale(False)
            _check_format(file, dataset)
            check_claims(file, dataset)
            subject, record, arrays = _read(dataset)
        except ResultError:
            dataset.close()
            raise
        except Exception as error:  # whatever a damaged file makes of it
            dataset.close()
            raise unreadable(file, error) from error
        if isinstance(arrays, Arrays):
            dataset.close()
    return Result.of_parts(subject, arrays, record, _origin(file, subject, record, rebuild))


def arrays_in(path: Path, subject: Subject, count: int) -> FileArrays:
    """The arrays of a file that this program has just written, read when they are asked for.

    Raises:
        ResultError: it cannot be read.
    """
    with NETCDF:
        import netCDF4

        try:
            dataset = netCDF4.Dataset(os.path.abspath(path), "r")
        except (OSError, RuntimeError) as error:
            raise unreadable(path, error) from error
        dataset.set_auto_maskandscale(False)
        return FileArrays(dataset, subject, count)


def check_signature(file: Path, kind: str = "result") -> None:
    """Refuse what does not begin like a NetCDF-4 file.

    Raises:
        ResultError: there is no such file, it cannot be read, or is another; no ``kind`` of ours.
    """
    check_utf8("read", file)
    begin = beginning(file, len(_HDF5))
    if begin != _HDF5:
        fault = "the file is empty" if not begin else "it is not a NetCDF-4 file"
        raise ResultError(f"cannot read {file}: {fault}, so no {kind} of dap3d")


def unreadable(file: Path, error: BaseException) -> ResultError:
    """The error for a file that the library cannot read."""
    words = getattr(error, "strerror", None) or str(error) or type(error).__name__
    words = " ".join(words.split())
    return ResultError(
        f"cannot read {file}: it is damaged, cut off or being written by another process ({words})"
    )


def _check_format(file: Path, dataset: Any) -> None:
    names = dataset.ncattrs()
    if SWEEP in names:
        raise ResultError(
            f"cannot read {file}: it holds the points of a sweep, not the result of one run; "
            "dap.open_sweep reads it, dap3d info tells of it"
        )
    if "Conventions" not in names or dataset.getncattr("Conventions") != CONVENTIONS:
        raise ResultError(f"cannot read {file}: a NetCDF-4 file, but no result of dap3d")
    found = int(dataset.getncattr("format"))
    if found > FORMAT:
        raise ResultError(
            f"cannot read {file}: {dataset.getncattr('source')} wrote it in format {found}, this "
            f"program reads up to {FORMAT}; install a newer dap3d"
        )


def _read(dataset: Any) -> tuple[Subject, Record, Arrays | FileArrays]:
    found = {name: dataset.getncattr(name) for name in dataset.ncattrs()}
    found = {"events": "[]", "run": "", "types": "null"} | found  # older files have none
    for name in _JSON:
        found[name] = json.loads(found[name])
    check_attributes(found)
    subject, record = _subject(dataset, found), record_of(found)
    check_subject(subject)
    count = len(dataset.dimensions["time"])
    if record.status == RUNNING:
        count = _complete(dataset, count)
        record = _unfinished(dataset, record, count)
    arrays = FileArrays(dataset, subject, count)
    large = 8 * count * arrays.width > LARGE
    return subject, record, arrays if large else arrays.part(slice(None))


def _subject(dataset: Any, found: dict[str, Any]) -> Subject:
    parts: dict[str, Any] = {}
    for kind in ("body", "joint", "point"):
        there = kind in dataset.dimensions
        parts[f"{kind}_names"] = tuple(map(str, dataset.variables[kind][:])) if there else ()
    for constant in CONSTANTS:
        if constant.dimensions[0] in dataset.dimensions:
            parts[constant.name] = np.asarray(dataset.variables[constant.name][:])
        else:
            shape = [0, *(3 for _ in constant.dimensions[1:])]
            kind = "i8" if constant.name in ("joint_rows", "point_body") else "f8"
            parts[constant.name] = np.zeros(shape, dtype=kind)
    if "angle" in dataset.dimensions:
        parts["angle_count"] = len(dataset.dimensions["angle"])
    for flag in ("has_potential", "is_isolated"):
        parts[flag] = bool(found[flag])
    return Subject(**parts)


def _complete(dataset: Any, count: int) -> int:
    """Rows of a file whose writer was killed that are there: what was not written is zero."""
    t = np.asarray(dataset.variables["t"][:count], dtype=float)
    if not count or not np.any(dataset.variables["u"][0]):
        return 0
    rising = t[1:] > t[:-1]
    return 1 + (len(rising) if rising.all() else int(np.argmin(rising)))


def _unfinished(dataset: Any, record: Record, count: int) -> Record:
    """The record of a run whose writer was killed."""
    last = "nothing was reported"
    if count:
        last = f"the last instant is t = {float(dataset.variables['t'][count - 1]):g} s"
    note = f"the run was killed, or is still being written: {last}"
    return attrs.evolve(record, status="interrupted", notes=(*record.notes, note))


def _origin(
    file: Path, subject: Subject, record: Record, rebuild: Rebuild | None
) -> Callable[[], Any]:
    def origin() -> Any:
        if rebuild is None:
            raise ResultError(f"the model of {file} is needed: open it with the way to rebuild it")
        model, machine_of = rebuild(record.scene_text)
        if not is_subject_of(subject, model):
            raise ResultError(
                f"the scene in {file} gives another model than was run; its types may have changed"
            )
        return model, machine_of

    return origin
