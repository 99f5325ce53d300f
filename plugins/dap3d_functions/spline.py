"""Spline function: a smooth curve through points."""

from dap3d_core.interface import Function, choice, hookimpl, table
from dap3d_core.kernels import lookup
from dap3d_functions.points import increasing, pieces, wrapped

interface_version = 1

#: Three points between which the slope changes by less than this part of the largest are in line.
STRAIGHT = 1e-9


class Spline(Function):
    """The cubic spline through the points (x_k, y_k), x increasing; two points or more.

    f, f' and f'' are continuous inside. At both ends f'' = 0 (natural spline), and beyond them f
    goes on as the straight line that touches the curve there, so that f, f' and f'' are continuous
    everywhere. In piece k, u = x - x_k:

        f = y_k + u (b_k + u (c_k + u d_k))

    Give y(x) so that it is at rest at the ends where a driver is to stop there.

    With ``periodic`` the curve repeats itself with the period x_n - x_1, f' and f'' continuous;
    where y_n is not y_1 it advances by y_n - y_1 in each. It has no breaks: where it dwells for
    long, a run that is otherwise at rest takes a ``step`` shorter than what comes between.
    """

    keyword = "spline"
    synonyms = ("table", "interpolation")
    x: tuple = table(doc="arguments of the points, increasing")
    y: tuple = table(doc="values of the points, as many")
    periodic: bool = choice((False, True), False, doc="the curve repeats itself")
    pieces: tuple = table(columns=5, given=False)

    def prepare(self, bodies):
        starts, c = pieces(*points_of(self.x, self.y), periodic=False)
        return {"pieces": [list(piece) for piece in zip(starts, *c, strict=True)]}

    def breaks(self):
        """Both ends, and where a straight line begins to bend or ends it: a bump between them."""
        import numpy as np

        x, y = np.array(self.x), np.array(self.y)
        slope = np.diff(y) / np.diff(x)
        bends = np.abs(np.diff(slope)) > STRAIGHT * np.max(np.abs(slope))  # points 2 to n - 1
        bends = np.pad(bends, 2)
        changes = np.flatnonzero(bends[1:] != bends[:-1])  # between points k and k + 1, or beyond
        near = np.concatenate([[0, len(x) - 1], changes - 1, changes, changes + 1])
        return x[np.unique(np.clip(near, 0, len(x) - 1))]

    def value(x, pieces):
        start, a, b, c, d = lookup(pieces, x)
        u = x - start
        f = a + u * (b + u * (c + u * d))
        return f, b + u * (2.0 * c + u * 3.0 * d), 2.0 * c + u * 6.0 * d, 6.0 * d


class Periodic(Spline, periodic=True):
    """The curve repeats itself: f(x) = g(x) + m (x - x_1), g periodic, m the mean slope.

    g is the periodic cubic spline; its argument is taken back to the first period by its angle.
    """

    def prepare(self, bodies):
        x, y = points_of(self.x, self.y)
        period = x[-1] - x[0]
        slope = (y[-1] - y[0]) / period
        rest = y - slope * (x - x[0])
        rest[-1] = rest[0]  # but for rounding
        starts, c = pieces(x, rest, periodic=True)
        return {"pieces": [list(piece) for piece in zip(starts, *c, strict=True)],
                "first": x[0], "period": period, "slope": slope}  # fmt: skip

    def breaks(self):
        """None: it would have as many as periods."""
        return ()

    def value(x, pieces, first, period, slope):
        place = wrapped(x, first, period)
        start, a, b, c, d = lookup(pieces, place)
        u = place - start
        f = a + u * (b + u * (c + u * d)) + slope * (x - first)
        return f, b + u * (2.0 * c + u * 3.0 * d) + slope, 2.0 * c + u * 6.0 * d, 6.0 * d


def points_of(x, y):
    """The points as arrays.

    Raises:
        ValueError: x and y are not as many, fewer than two, or x does not increase.
    """
    import numpy as np

    if len(x) != len(y):
        raise ValueError(f"x has {len(x)} numbers and y has {len(y)}; give as many of each")
    return increasing("x", x, "spline"), np.array(y)


@hookimpl
def dap3d_functions():
    """The function types of this module."""
    return [Spline]
