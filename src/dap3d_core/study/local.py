"""The points of a study on the cores of this machine."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dap3d_core.study.ensemble import Batch, Ensemble

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Points that are run between two looks at the clock.
CHUNK = 16


def run_here(
    ensemble: Ensemble, points: Floats, places: Integers, threads: int | None = None
) -> Iterator[tuple[Integers, Batch]]:
    """Run points and give what came of them as it comes.

    Args:
        ensemble: what runs them.
        points: (N, numbers) the values of the numbers at all points.
        places: which of them to run.
        threads: how many at once; by default one for each core.
    """
    for first in range(0, len(places), CHUNK):
        chunk = places[first : first + CHUNK]
        yield chunk, ensemble.run(points[chunk])
