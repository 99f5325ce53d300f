"""Tables of any length, which kernels read by ``lookup``.

A table stands in an instance's numbers as (array, place, rows, sample of a row): its rows lie in
the array from the place on, the first number of each row increasing.
"""


def lookup(table, x):
    """The row of a table that x belongs to: the last one whose first number is not above x.

    Before the first row, the first one. Returns the row's numbers, a tuple.
    """
    array, place, rows, sample = table
    if hasattr(array, "tracer"):  # while it is compiled
        at = array.tracer.row_of(_row, array, place, rows, len(sample), x)
    elif hasattr(x, "free_symbols"):
        raise TypeError("a table has no symbolic rows")
    else:
        at = _row(array, int(place), int(rows), len(sample), getattr(x, "real", x))
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
