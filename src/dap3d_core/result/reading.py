"""Reading results from NetCDF-4 files."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.result.arrays import COLUMNS, Arrays, column_sizes
from dap3d_core.result.errors import ResultError
from dap3d_core.result.estimate import U_ERROR
from dap3d_core.result.files import cannot
from dap3d_core.result.layout import CONSTANTS, CONVENTIONS, FORMAT, record_of
from dap3d_core.result.record import RUNNING, Record
from dap3d_core.result.result import Rebuild, Result
from dap3d_core.result.subject import Subject
from dap3d_core.result.writing import NETCDF

if TYPE_CHECKING:
    from dap3d_core.model.groups import Floats

_HDF5 = b"\x89HDF\r\n\x1a\n"
_JSON = ("notes", "settings", "statistics", "versions", "events")


def open_result(path: str | os.PathLike[str], rebuild: Rebuild | None = None) -> Result:
    """Read a result from a file; the file is closed again.

    Args:
        path: the file.
        rebuild: makes the model and a way to a machine from the text of a scene; used when the
            Jacobian or a reaction is asked for, without it these are refused.

    Returns:
        The result, its arrays equal to the saved ones bit for bit. Of a file whose writer was
        killed, what it had written: its status is "interrupted" and a note says so.

    Raises:
        ResultError: there is no such file, it is not a result, it is damaged, or it was written by
            a newer dap3d.
    """
    file = Path(path)
    _check_signature(file)
    with NETCDF:
        import netCDF4

        try:
            dataset = netCDF4.Dataset(os.path.abspath(file), "r")
        except (OSError, RuntimeError) as error:
            raise _unreadable(file, error) from error
        try:
            dataset.set_auto_maskandscale(False)
            _check_format(file, dataset)
            subject, record, arrays = _read(dataset)
        except ResultError:
            raise
        except Exception as error:  # whatever a damaged file makes of it
            raise _unreadable(file, error) from error
        finally:
            dataset.close()
    if record.status == RUNNING:
        arrays, record = _unfinished(arrays, record)
    return Result.of_parts(subject, arrays, record, _origin(file, subject, record, rebuild))


def _check_signature(file: Path) -> None:
    try:
        with file.open("rb") as stream:
            begin = stream.read(len(_HDF5))
    except FileNotFoundError as error:
        raise ResultError(f"cannot read {file}: there is no such file") from error
    except IsADirectoryError as error:
        raise ResultError(f"cannot read {file}: it is a folder, not a result file") from error
    except (OSError, ValueError) as error:
        raise cannot("read", file, error) from error
    if begin != _HDF5:
        fault = "the file is empty" if not begin else "it is not a NetCDF-4 file"
        raise ResultError(f"cannot read {file}: {fault}, so no result of dap3d")


def _unreadable(file: Path, error: BaseException) -> ResultError:
    words = getattr(error, "strerror", None) or str(error) or type(error).__name__
    words = " ".join(words.split())
    return ResultError(
        f"cannot read {file}: it is damaged, cut off or being written by another process ({words})"
    )


def _check_format(file: Path, dataset: Any) -> None:
    names = dataset.ncattrs()
    if "Conventions" not in names or dataset.getncattr("Conventions") != CONVENTIONS:
        raise ResultError(f"cannot read {file}: a NetCDF-4 file, but no result of dap3d")
    found = int(dataset.getncattr("format"))
    if found > FORMAT:
        raise ResultError(
            f"cannot read {file}: {dataset.getncattr('source')} wrote it in format {found}, this "
            f"program reads up to {FORMAT}; install a newer dap3d"
        )


def _read(dataset: Any) -> tuple[Subject, Record, Arrays]:
    found = {name: dataset.getncattr(name) for name in dataset.ncattrs()}
    found.setdefault("events", "[]")  # older files have none
    for name in _JSON:
        found[name] = json.loads(found[name])
    subject = _subject(dataset, found)
    nt = len(dataset.dimensions["time"])
    width = {"": None, **column_sizes(subject)}
    columns: list[Floats] = []
    optional = (U_ERROR,) if U_ERROR.name in dataset.variables else ()
    for column in (*COLUMNS, *optional):
        size = width[column.dimension]
        shape = (nt,) if size is None else (nt, size)
        if size == 0:
            columns.append(np.zeros(shape))
            continue
        values = np.asarray(dataset.variables[column.name][:], dtype=float)
        if values.shape != shape:
            raise ValueError(f"{column.name} has the shape {values.shape}, not {shape}")
        columns.append(values)
    return subject, record_of(found), Arrays(*columns)


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
    for flag in ("has_potential", "is_isolated"):
        parts[flag] = bool(found[flag])
    return Subject(**parts)


def _unfinished(arrays: Arrays, record: Record) -> tuple[Arrays, Record]:
    """Of a file whose writer was killed: the rows that are complete, and a note."""
    complete = np.ones(len(arrays.t), dtype=bool)
    for column in COLUMNS:
        values = getattr(arrays, column.name).reshape(len(arrays.t), -1)
        complete &= np.isfinite(values).all(axis=1)
    count = int(np.argmin(complete)) if not complete.all() else len(complete)
    kept = Arrays(*(getattr(arrays, column.name)[:count] for column in COLUMNS))
    last = f"the last instant is t = {kept.t[-1]:g} s" if count else "nothing was reported"
    note = f"the run was killed, or is still being written: {last}"
    return kept, attrs.evolve(record, status="interrupted", notes=(*record.notes, note))


def _origin(
    file: Path, subject: Subject, record: Record, rebuild: Rebuild | None
) -> Callable[[], Any]:
    def origin() -> Any:
        if rebuild is None:
            raise ResultError(f"the model of {file} is needed: open it with the way to rebuild it")
        model, machine_of = rebuild(record.scene_text)
        same = model.body_names == subject.body_names and np.array_equal(
            model.joint_rows, subject.joint_rows
        )
        if not same:
            raise ResultError(
                f"the scene in {file} gives another model than was run; its types may have changed"
            )
        return model, machine_of

    return origin
