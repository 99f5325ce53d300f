"""What tables of one argument and of two have in common: their arguments."""

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
