"""Grid function: a smooth surface through points over a rectangular grid."""

from dap3d_core.interface import Function, choice, hookimpl, table
from dap3d_core.kernels import lookup
from dap3d_functions.points import increasing, pieces, wrapped

interface_version = 1

#: Values at both ends of a period that differ by no more than this part of the largest are equal.
EQUAL = 1e-12


class Grid(Function):
    """The bicubic spline f(x, y) through z_km at (x_k, y_m): tables of two arguments.

    The natural cubic spline of ``spline`` in x of those in y: f and its derivatives up to the
    second are continuous everywhere. At the edges f_xx, or f_yy, is zero, and beyond them f goes on
    along straight lines. In the cell (k, m), u = x - x_k and v = y - y_m:

        f = sum_pq c_pq u^p v^q,  p and q from 0 to 3

    z has a row for each x, of one number for each y; two x and two y or more. With ``periodic_x``
    the first row of z comes again as the last, and f repeats itself with the period x_n - x_1, its
    derivatives continuous; with ``periodic_y`` the same in y.
    """

    keyword, arguments, smooth = "grid", 2, True
    x: tuple = table(doc="places of the rows, increasing")
    y: tuple = table(doc="places of the columns, increasing")
    z: tuple = table(by_rows=True, doc="values, a row for each x of a number for each y")
    periodic_x: bool = choice((False, True), False, doc="f repeats itself in x")
    periodic_y: bool = choice((False, True), False, doc="f repeats itself in y")
    rows: tuple = table(columns=2, given=False)
    columns: tuple = table(columns=2, given=False)
    cells: tuple = table(columns=17, given=False)

    def prepare(self, bodies):
        import numpy as np

        x, y, z = points_of(self)
        starts_x, of_x = pieces(x, z, periodic=self.periodic_x)
        starts_y, c = pieces(y, of_x.transpose(2, 0, 1), periodic=self.periodic_y)
        cells = c.transpose(3, 1, 2, 0).reshape(-1, 16)  # by x, y, power of u, power of v
        number = np.arange(len(cells))
        first = len(starts_y) * np.arange(len(starts_x))
        return {
            "rows": np.stack([starts_x, first], axis=1),
            "columns": np.stack([starts_y, np.arange(len(starts_y))], axis=1),
            "cells": np.hstack([number[:, None], cells]),
            "first_x": x[0],
            "first_y": y[0],
            "period_x": x[-1] - x[0],
            "period_y": y[-1] - y[0],
        }

    def value(x, y, rows, columns, cells):
        return surface(x, y, rows, columns, cells)


class PeriodicInX(Grid, periodic_x=True, periodic_y=False):
    """It repeats itself in x."""

    def value(x, y, rows, columns, cells, first_x, period_x):
        return surface(wrapped(x, first_x, period_x), y, rows, columns, cells)


class PeriodicInY(Grid, periodic_x=False, periodic_y=True):
    """It repeats itself in y."""

    def value(x, y, rows, columns, cells, first_y, period_y):
        return surface(x, wrapped(y, first_y, period_y), rows, columns, cells)


class Periodic(Grid, periodic_x=True, periodic_y=True):
    """It repeats itself in both."""

    def value(x, y, rows, columns, cells, first_x, period_x, first_y, period_y):
        x, y = wrapped(x, first_x, period_x), wrapped(y, first_y, period_y)
        return surface(x, y, rows, columns, cells)


def surface(x, y, rows, columns, cells):
    """The value of a surface and its partial derivatives: (f, f_x, f_y, f_xx, f_xy, f_yy)."""
    start_x, first = lookup(rows, x)
    start_y, column = lookup(columns, y)
    cell = lookup(cells, first + column)
    u, v = x - start_x, y - start_y
    by_y = [powers(cell[k : k + 4], v) for k in (1, 5, 9, 13)]  # of u^0 to u^3
    f, f_x, f_xx = powers([c for c, _, _ in by_y], u)
    f_y, f_xy, _ = powers([c for _, c, _ in by_y], u)
    f_yy, _, _ = powers([c for _, _, c in by_y], u)
    return f, f_x, f_y, f_xx, f_xy, f_yy


def powers(c, u):
    """A cubic of coefficients c_0 to c_3 and its first two derivatives."""
    f = c[0] + u * (c[1] + u * (c[2] + u * c[3]))
    return f, c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]), 2.0 * c[2] + u * 6.0 * c[3]


def points_of(grid):
    """The points of a grid as arrays x, y and z.

    Raises:
        ValueError: x or y does not increase or is too short, z has not as many rows and columns, or
            its ends differ over a period.
    """
    import numpy as np

    x, y = increasing("x", grid.x, "grid"), increasing("y", grid.y, "grid")
    z = np.array(grid.z)
    if z.shape != (len(x), len(y)):
        raise ValueError(
            f"z has {z.shape[0]} rows of {z.shape[1]} numbers; give {len(x)} rows, one for each x, "
            f"of {len(y)} numbers, one for each y"
        )
    ends = ("row", z[0], z[-1], "x"), ("column", z[:, 0], z[:, -1], "y")
    for (line, first, last, name), wanted in zip(
        ends, (grid.periodic_x, grid.periodic_y), strict=True
    ):
        if wanted and np.max(np.abs(last - first)) > EQUAL * np.max(np.abs(z)):
            raise ValueError(
                f"the last {line} of z is not its first one; with periodic_{name} = true both are "
                "the same place: give them the same values"
            )
        last[:] = first if wanted else last  # but for rounding
    return x, y, z


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Grid]
