"""Tables of any length, which kernels read by ``lookup`` and ``item``.

A table is given to a kernel as (array, place, rows, sample of a row): its rows are stored in the
array from that place on; the first number of each row increases.
"""

from dap3d_core.kernels.scalar_math import where

#: Rows of a table at most among which a straight-line program chooses.
MOST_CHOSEN = 32


def lookup(table, x):
    """The last row of a table with a first number not above x, or the first row; a tuple."""
    return _read(table, _row, x)


def item(table, k):
    """The row of a table with the index k, from 0; a tuple.

    Of an index that is not whole it is that of the whole one below; outside of the table, the first
    or the last row.
    """
    return _read(table, _item, k)


def _read(table, find, x):
    """The row of a table that ``find`` finds for x."""
    array, place, rows, sample = table
    if hasattr(array, "tracer"):  # in a trace
        at = array.tracer.row_of(find, array, place, rows, len(sample), x)
    elif hasattr(x, "tracer"):  # of a table whose numbers are known
        return _chosen(array, int(place), int(rows), len(sample), x, find)
    elif hasattr(x, "free_symbols"):
        raise TypeError("a table has no symbolic rows")
    else:
        at = find(array, int(place), int(rows), len(sample), getattr(x, "real", x))
    return tuple(array[at + k] for k in range(len(sample)))


def _chosen(array, place, rows, width, x, find):
    """The row itself, chosen among all of them without a branch."""
    if rows > MOST_CHOSEN:
        raise TypeError(f"a table of {rows} rows is searched, which branches on a number")
    found = tuple(array[place + k] for k in range(width))
    for row in range(1, rows):
        first = place + row * width
        here = (array[first] if find is _row else float(row)) <= x
        found = tuple(where(here, array[first + k], found[k]) for k in range(width))
    return found


def _row(array, place, rows, width, x):
    low, high = 0, rows
    while high - low > 1:
        middle = (low + high) // 2
        if array[place + middle * width] <= x:
            low = middle
        else:
            high = middle
    return place + low * width


def _item(array, place, rows, width, k):
    if not k >= 1.0:
        return place
    if k >= rows:
        return place + (rows - 1) * width
    return place + int(k) * width
