"""Tables of any length, which kernels read by ``lookup`` and ``item``.

A table is given to a kernel as (array, place, rows, sample of a row): its rows are stored in the
array from that place on; the first number of each row increases.
"""


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
    elif hasattr(x, "free_symbols"):
        raise TypeError("a table has no symbolic rows")
    else:
        at = find(array, int(place), int(rows), len(sample), getattr(x, "real", x))
    return tuple(array[at + k] for k in range(len(sample)))


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
