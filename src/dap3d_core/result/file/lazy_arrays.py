"""Arrays of a result that is too large for memory: they stay in its file until asked for."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.arrays import COLUMNS, Arrays, arrays_from, block_rows, column_sizes, joined
from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.library import NETCDF
from dap3d_core.result.file.validate import check_numbers
from dap3d_core.result.model_summary import Subject
from dap3d_core.result.post.global_error import U_ERROR

#: Results of more bytes are not read as a whole, and long runs keep no more in memory.
LARGE = 2**26


class FileArrays:
    """Has the face of ``Arrays``; each array is read, whole, when it is first asked for.

    ``blocks``, ``part`` and ``at`` read what they give and keep nothing. The file stays open: one
    that takes its name meanwhile is another file, and changes nothing here.
    """

    def __init__(self, dataset: Any, subject: Subject, count: int) -> None:
        """Args: an open netCDF4.Dataset, whose it is, and how many instants are complete."""
        self._dataset, self._count = dataset, count
        self._sizes = {"": None, **column_sizes(subject)}
        optional = (U_ERROR,) if U_ERROR.name in dataset.variables else ()
        self._columns = {c.name: c for c in (*COLUMNS, *optional)}
        self._kept: dict[str, Floats] = {}

    def __len__(self) -> int:
        return self._count

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self._columns:
            if name == U_ERROR.name:
                return None
            raise AttributeError(name)
        if name not in self._kept:
            self._kept[name] = self._read(name, slice(self._count))
        return self._kept[name]

    @property
    def width(self) -> int:
        """As ``Arrays.width``."""
        return sum(size for size in self._sizes.values() if size)

    def part(self, rows: slice) -> Arrays:
        """As ``Arrays.part``, without a step and without what lies behind the last instant."""
        first, last, step = rows.indices(self._count)
        error = self._read(U_ERROR.name, slice(first, last)) if self.has_error else None
        whole = arrays_from((self._read(c.name, slice(first, last)) for c in COLUMNS), error)
        return whole if step == 1 else whole.part(slice(None, None, step))

    def at(self, places: Integers) -> Arrays:
        """As ``Arrays.at``."""
        found, first = [], 0
        for block in self.blocks():
            inside = places[(places >= first) & (places < first + len(block))]
            if len(inside):
                found.append(block.at(inside - first))
            first += len(block)
        return joined(found)

    def blocks(self) -> Iterator[Arrays]:
        """As ``Arrays.blocks``."""
        for rows in block_rows(self._count, len(COLUMNS) + self.width):
            yield self.part(rows)

    def with_error(self, u_error: Floats) -> Arrays:
        """As ``Arrays.with_error``; in memory."""
        return arrays_from((getattr(self, column.name) for column in COLUMNS), u_error)

    @property
    def has_error(self) -> bool:
        """Whether there is an estimate of the error of u."""
        return U_ERROR.name in self._columns

    def _read(self, name: str, rows: slice) -> Floats:
        size = self._sizes[self._columns[name].dimension]
        count = len(range(*rows.indices(self._count)))
        shape = (count,) if size is None else (count, size)
        if size == 0:
            return np.zeros(shape)
        with NETCDF:
            values: Floats = np.asarray(self._dataset.variables[name][rows], dtype=float)
        if values.shape != shape:
            file = self._dataset.filepath()
            raise ResultError(
                f"cannot read {file}: {name} has the shape {values.shape}, not {shape}"
            )
        if name != U_ERROR.name:  # an estimate may be missing
            check_numbers(self._dataset.filepath(), name, values)
        values.flags.writeable = False
        return values
