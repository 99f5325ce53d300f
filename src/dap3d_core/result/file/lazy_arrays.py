"""Arrays of a large result: each is read from the file when it is first used."""

from typing import Any

import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.arrays import COLUMNS, U_ERROR, Arrays, column_sizes, joined
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.library import NETCDF, OpenFile
from dap3d_core.result.file.validate import check_numbers
from dap3d_core.result.model_summary import ModelSummary


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
            check_numbers(file, name, values)
        values.flags.writeable = False
        return values
