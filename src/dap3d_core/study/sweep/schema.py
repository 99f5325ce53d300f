"""Layout of a sweep in its file: definitions, and locations of the points of a grid."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result.file.schema import write_attributes
from dap3d_core.study.study import PointStatus
from dap3d_core.study.sweep.dataset import ABOUT_NOTE, ABOUT_STATUS, SweepLayout

#: Bytes of a note in the file, allocated from the start.
NOTE = 200


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
        variable = _variable(dataset, coordinate.name, "f8", coordinate.dimensions, False)
        write_attributes(variable, coordinate.about)
        variable[...] = coordinate.values
    names = [c.name for c in layout.coordinates if c.name not in layout.sizes]
    last = (-1,) * len(layout.dimensions)
    for output in layout.outputs:
        variable = _variable(dataset, output.name, "f8", output.dimensions, np.nan)
        write_attributes(variable, output.about)
        if names and not any(" " in name for name in names):
            variable.setncattr_string("coordinates", " ".join(names))
        variable[(-1,) * len(output.dimensions)] = np.nan  # allocates it
    status = _variable(dataset, "status", "i1", layout.dimensions, False)
    write_attributes(status, ABOUT_STATUS)
    status[last] = PointStatus.OPEN
    note = _variable(dataset, "note", "S1", (*layout.dimensions, "note_length"), False)
    note.set_auto_chartostring(False)
    write_attributes(note, ABOUT_NOTE)
    note.setncattr("_Encoding", "utf-8")
    note[(*last, -1)] = b""
    write_attributes(dataset, layout.attributes)


def _variable(dataset: Any, name: str, kind: str, dimensions: tuple[str, ...], fill: Any) -> Any:
    return dataset.createVariable(name, kind, dimensions, fill_value=fill, contiguous=True)
