"""Even subsampling of the points of a study, where all are too many to be shown."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dap3d_core.kernels.array_types import Integers

if TYPE_CHECKING:
    import xarray


#: Variables of up to so many bytes are read whole: single values from a file take far longer.
READ_WHOLE = 2**30


def at_places(data: "xarray.Dataset", places: Mapping[str, Integers]) -> "xarray.Dataset":
    """A data set at some indices along its dimensions."""

    def subset(array: "xarray.DataArray") -> "xarray.DataArray":
        index = {axis: k for axis, k in places.items() if axis in array.dims}
        return (array.compute() if array.nbytes <= READ_WHOLE else array).isel(index)

    return data.map(subset, keep_attrs=True)


def evenly(shape: Sequence[int], most: int) -> list[Integers]:
    """Indices along each axis with at most ``most`` combinations (1 or more), (k,) rising.

    No axis keeps more indices than the longest that is shortened; the first and the last index of
    an axis are among them where it keeps two or more.
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
