"""Bounds that a number is kept within."""

from dap3d_core.kernels import where

#: Bounds that are none.
UNLIMITED = 1e100


def bounds(element, *names):
    """NAME_min and NAME_max of an element by name, as numbers where they are left out.

    Raises:
        ValueError: one lies above the other.
    """
    numbers = {}
    for name in names:
        low, high = (getattr(element, f"{name}_{end}") for end in ("min", "max"))
        low = -UNLIMITED if low is None else low
        high = UNLIMITED if high is None else high
        if low > high:
            raise ValueError(f"{name}_min lies above {name}_max")
        numbers |= {f"{name}_min": low, f"{name}_max": high}
    return numbers


def within(value, least, most):
    """The value, no less than one bound and no more than the other."""
    return where(value < least, least, where(value > most, most, value))
