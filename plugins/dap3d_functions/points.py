"""What tables of one argument and of two have in common: their arguments, and cubic splines."""

from dap3d_core.kernels import atan2, cos, sin

PI = 3.141592653589793


def increasing(name, x, what):
    """Arguments of points as an array.

    Args:
        name: of the field.
        x: the arguments.
        what: the function, for errors.

    Raises:
        ValueError: they are fewer than two, or do not increase.
    """
    import numpy as np

    x = np.array(x)
    if len(x) < 2:
        raise ValueError(f"a {what} takes two points or more; {name} has {len(x)}")
    if (back := np.flatnonzero(np.diff(x) <= 0.0)).size:
        k = int(back[0]) + 1
        raise ValueError(
            f"{name} must increase; number {k + 1}, {x[k]:g}, is not beyond the one before it, "
            f"{x[k - 1]:g}"
        )
    return x


def wrapped(x, first, period):
    """An argument taken back to the first period, by its angle."""
    angle = 2.0 * PI * ((x - first) / period - 0.5)
    return first + period * (0.5 + atan2(sin(angle), cos(angle)) / (2.0 * PI))


def pieces(x, values, *, periodic):
    """Pieces of cubic splines of x through columns of values, without a period with straight ends.

    Args:
        x: (n,) places, increasing.
        values: (n, ...), the first again as the last where they are periodic.

    Returns:
        (k,) where the pieces begin, and (4, k, ...) their coefficients, of powers 0 to 3.
    """
    import numpy as np

    h = np.diff(x)
    steps = h.reshape(-1, *[1] * (values.ndim - 1))
    slopes = np.diff(values, axis=0) / steps
    c = half_curvatures(h, slopes, periodic=periodic)
    a, b = values[:-1], slopes - steps * (2.0 * c[:-1] + c[1:]) / 3.0
    inner = np.stack([a, b, c[:-1], np.diff(c, axis=0) / (3.0 * steps)])
    if periodic:
        return x[:-1], inner
    straight = np.zeros((4, 2, *values.shape[1:]))  # before and behind
    straight[0] = a[0] - b[0] * h[-1], values[-1]
    straight[1] = b[0], b[-1] + h[-1] * (c[-1] + c[-2])
    starts = np.array([x[0] - h[-1], *x])
    return starts, np.concatenate([straight[:, :1], inner, straight[:, 1:]], axis=1)


def half_curvatures(h, slopes, *, periodic):
    """Half the second derivatives (n, ...) of cubic splines at points with steps h (n - 1,).

    slopes: (n - 1, ...) of the lines between the points. At the ends they are zero, or one number
    s, where that closes the period: what is inside is linear in it.
    """
    import numpy as np

    c = np.zeros((len(h) + 1, *slopes.shape[1:]))
    if len(h) < 2:
        return c
    c[1:-1] = tridiagonal(h, 3.0 * np.diff(slopes, axis=0))
    if periodic:
        side = np.zeros((len(h) - 1, *[1] * (c.ndim - 1)))
        side[0] -= h[0]
        side[-1] -= h[-1]
        by_s = tridiagonal(h, side)
        left = 3.0 * (slopes[0] - slopes[-1]) - h[0] * c[1] - h[-1] * c[-2]
        s = left / (2.0 * (h[0] + h[-1]) + h[0] * by_s[0] + h[-1] * by_s[-1])
        c[1:-1] += by_s * s
        c[0] = c[-1] = s
    return c


def tridiagonal(h, side):
    """The solution of h_k c_(k-1) + 2 (h_k + h_(k+1)) c_k + h_(k+1) c_(k+1) = side_k."""
    c, diagonal = side.copy(), 2.0 * (h[:-1] + h[1:])
    for k in range(1, len(c)):
        part = h[k] / diagonal[k - 1]
        diagonal[k] -= part * h[k]
        c[k] -= part * c[k - 1]
    c[-1] /= diagonal[-1]
    for k in range(len(c) - 2, -1, -1):
        c[k] = (c[k] - h[k + 1] * c[k + 1]) / diagonal[k]
    return c
