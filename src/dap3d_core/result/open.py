"""Reading of results from NetCDF-4 files."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.arrays import (
    COLUMNS,
    LARGE,
    U_ERROR,
    Arrays,
    ModelSummary,
    column_sizes,
    is_summary_of,
    joined,
)
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file import schema, validate
from dap3d_core.result.file.checksum import check_checksums, check_signature
from dap3d_core.result.file.library import NETCDF, OpenFile, reading, shared
from dap3d_core.result.metadata import RUNNING, RunMetadata
from dap3d_core.result.result import Origin, Rebuild, Result

_JSON = ("notes", "settings", "statistics", "versions", "events", "types", "actuation")


def open_result(path: str | os.PathLike[str], rebuild: Rebuild | None = None) -> Result:
    """Reads a result from a file.

    Args:
        path: the file.
        rebuild: makes the model, and access to an evaluator, from the text of a scene; needed for
            the Jacobian and reactions.

    Returns:
        The result, its arrays equal to the saved ones bit for bit; those of a large file are read
        on first use. If the writer was killed, what it had written, with status "interrupted" and
        a note.

    Raises:
        ResultError: there is no such file, it is not a result, it is damaged, or it was written by
            a newer dap3d.
    """
    file = Path(path)
    check_signature(file)
    check_checksums(file)
    with reading(file):
        content = shared(file)
        _check_format(file, content.dataset)
        validate.check_claims(file, content.dataset)
        summary, record, count = _read(content.dataset)
        arrays: Arrays = LazyArrays(content, summary, count)
        if 8 * count * arrays.width <= LARGE:
            arrays = arrays.part(slice(None))
    return Result(summary, arrays, record, _origin(file, summary, record, rebuild))


def arrays_in(path: Path, summary: ModelSummary, count: int) -> "LazyArrays":
    """Arrays of a file that this process has just written, read on first use.

    Raises:
        ResultError: it cannot be read.
    """
    with reading(path):
        return LazyArrays(shared(path), summary, count)


def _check_format(file: Path, dataset: Any) -> None:
    names = dataset.ncattrs()
    if schema.SWEEP in names:
        raise ResultError(
            f"cannot read {file}: it holds the points of a sweep, not the result of one run; "
            "dap.open_sweep reads it, dap3d info describes it"
        )
    if "Conventions" not in names or dataset.getncattr("Conventions") != schema.CONVENTIONS:
        raise ResultError(f"cannot read {file}: a NetCDF-4 file, but no result of dap3d")
    version = int(dataset.getncattr("format"))
    if version > schema.FORMAT:
        raise ResultError(
            f"cannot read {file}: {dataset.getncattr('source')} wrote it in format {version}, this "
            f"program reads up to {schema.FORMAT}; install a newer dap3d"
        )


def _read(dataset: Any) -> tuple[ModelSummary, RunMetadata, int]:
    # absent in files of older programs, or where there is none
    older = {"events": "[]", "run": "", "types": "null", "actuation": "{}"}
    values = older | {name: dataset.getncattr(name) for name in dataset.ncattrs()}
    for name in _JSON:
        values[name] = json.loads(values[name])
    validate.check_forms(values, validate.FORMS)
    summary = _subject(dataset, values)
    record = schema.record_of(values, schema.contacts_of(dataset))
    validate.check_subject(summary)
    count = len(dataset.dimensions["time"])
    if record.status == RUNNING:
        count, last = _complete_count(dataset, count), "nothing was reported"
        if count:
            last = f"the last instant is t = {float(dataset.variables['t'][count - 1]):g} s"
        note = f"the run was killed, or is still being written: {last}"
        record = attrs.evolve(record, status="interrupted", notes=(*record.notes, note))
    return summary, record, count


def _subject(dataset: Any, values: dict[str, Any]) -> ModelSummary:
    parts: dict[str, Any] = {}
    for kind in ("body", "joint", "point", "input"):
        names = dataset.variables[kind][:] if kind in dataset.dimensions else ()
        parts[f"{kind}_names"] = tuple(map(str, names))
    for constant in schema.CONSTANTS:
        if constant.dimensions[0] in dataset.dimensions:
            parts[constant.name] = np.asarray(dataset.variables[constant.name][:])
        else:
            shape = [0, *(3 for _ in constant.dimensions[1:])]
            kind = "i8" if constant.name in ("joint_rows", "point_body") else "f8"
            parts[constant.name] = np.zeros(shape, dtype=kind)
    if "element_state" in dataset.dimensions:
        parts["state_names"] = tuple(map(str, dataset.variables["element_state"][:]))
    if "angle" in dataset.dimensions:
        parts["angle_count"] = len(dataset.dimensions["angle"])
        if "angle" in dataset.variables:
            parts["angle_names"] = tuple(map(str, dataset.variables["angle"][:]))
    for flag in ("has_potential", "is_isolated"):
        parts[flag] = bool(values[flag])
    return ModelSummary(**parts)


def _complete_count(dataset: Any, count: int) -> int:
    """Number of complete rows in a file of a killed writer: unwritten rows are zero."""
    t = np.asarray(dataset.variables["t"][:count], dtype=float)
    if not count or not np.any(dataset.variables["u"][0]):
        return 0
    rising = t[1:] > t[:-1]
    return 1 + (len(rising) if rising.all() else int(np.argmin(rising)))


def _origin(
    file: Path, summary: ModelSummary, record: RunMetadata, rebuild: Rebuild | None
) -> Callable[[], Origin]:
    def origin() -> Origin:
        if rebuild is None:
            raise ResultError(f"the model of {file} is needed: open it with the way to rebuild it")
        model, evaluator_of = rebuild(record.scene_text)
        if not is_summary_of(summary, model):
            raise ResultError(
                f"the scene in {file} gives another model than was run; its types may have changed"
            )
        return model, evaluator_of

    return origin


class LazyArrays(Arrays):
    """Arrays in a file, read on first use; ``blocks``, ``part`` and ``at`` read without caching.

    The file stays open: another file that takes its name meanwhile changes nothing here.
    """

    def __init__(self, file: OpenFile, summary: ModelSummary, count: int) -> None:
        """Args: the file, its model, and the number of complete instants."""
        self._file, self._count = file, count
        self._sizes = {"": None, **column_sizes(summary)}
        optional = (U_ERROR,) if U_ERROR.name in file.dataset.variables else ()
        self._columns = {c.name: c for c in (*COLUMNS, *optional)}

    def __len__(self) -> int:
        return self._count

    def __getattr__(self, name: str) -> Any:
        """Reads a column on its first use."""
        if name == U_ERROR.name and not self.has_error:
            return None
        if name.startswith("_") or name not in self._columns:
            raise AttributeError(name)
        values = self._read(name, slice(self._count))
        setattr(self, name, values)
        return values

    @property
    def has_error(self) -> bool:
        """As in ``Arrays``, without reading it."""
        return U_ERROR.name in self._columns

    @property
    def width(self) -> int:
        """As in ``Arrays``, without reading them."""
        return sum(size for size in self._sizes.values() if size)

    def part(self, rows: slice) -> Arrays:
        """Some of the instants, read from the file."""
        first, last, step = rows.indices(self._count)
        whole = Arrays(*(self._read(c.name, slice(first, last)) for c in COLUMNS))
        if self.has_error:
            whole = whole.with_error(self._read(U_ERROR.name, slice(first, last)))
        return whole if step == 1 else whole.part(slice(None, None, step))

    def at(self, indices: Integers) -> Arrays:
        """Single instants, read block by block."""
        found, first = [], 0
        for block in self.blocks():
            inside = indices[(indices >= first) & (indices < first + len(block))]
            if len(inside):
                found.append(block.at(inside - first))
            first += len(block)
        return joined(found)

    def _read(self, name: str, rows: slice) -> Floats:
        size = self._sizes[self._columns[name].dimension]
        count = len(range(*rows.indices(self._count)))
        shape = (count,) if size is None else (count, size)
        if size == 0:
            return np.zeros(shape)
        with NETCDF:
            dataset = self._file.dataset
            values: Floats = np.asarray(dataset.variables[name][rows], dtype=float)
            file = dataset.filepath()
        if values.shape != shape:
            raise ResultError(
                f"cannot read {file}: {name} has the shape {values.shape}, not {shape}"
            )
        if name != U_ERROR.name:  # an estimate may hold NaN
            validate.check_numbers(file, name, values)
        values.flags.writeable = False
        return values
