"""Some of the points of a study, evenly chosen: where all are too many to be shown."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


def evenly(shape: Sequence[int], most: int) -> list[Integers]:
    """Places along each axis of points whose combinations are so many at most.

    No axis keeps more places than the longest that is shortened; the first and the last place of
    an axis are among them where it keeps two or more.

    Args:
        shape: points along each axis.
        most: of all combinations, 1 or more.

    Returns:
        (k,) rising, for each axis.
    """
    low, high = 1, max(shape, default=1)
    while low < high:
        cap = (low + high + 1) // 2
        fits = math.prod(min(length, cap) for length in shape) <= most
        low, high = (cap, high) if fits else (low, cap - 1)
    return [
        np.unique(np.linspace(0, length - 1, min(length, low)).round().astype(np.int64))
        for length in shape
    ]
