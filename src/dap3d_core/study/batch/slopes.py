"""Runs points of a study with the derivatives of their rows by the parameters.

The loop over points (driver.py) is differentiated as it stands: how numbers become those of the
model, how a start is corrected, references, the run. Derivatives of what a point gives to it,
numbers and a state, are differences, exact where parameters are copied.
"""

from collections.abc import Callable, Sequence

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.lanes import Differentiation
from dap3d_core.study.batch import driver
from dap3d_core.study.batch.compiled_batch import BatchRows, CompiledBatch, Starts
from dap3d_core.study.batch.initial_state import SIZE
from dap3d_core.study.differences import power_of_two, weighted, weights_of

#: Steps and offsets of differences: of numbers that are copied, and of models that are made anew,
#: to second order, whose error is some 1e-8.
COPIES = 2.0**-6, (tuple(k for k in range(-5, 6) if k),)
MODELS = 1e-4, ((-1, 1), (0, 1, 2), (0, -1, -2))
#: Starts of points (k, p); None where one of them cannot be run.
MakeStarts = Callable[[Floats], Starts | None]


def starts_with_slopes(
    make: MakeStarts, x: Floats, size: Floats, step: float, offsets: Sequence[tuple[int, ...]]
) -> tuple[Starts, Floats, Floats] | None:
    """The start of a point x (p,), derivatives (w, p) of its numbers and (n, p) of its state.

    Args:
        make: starts of points.
        x, size: (p,) the point; sizes of its parameters.
        step: of differences, over the size.
        offsets: of differences, in steps; later ones where points of earlier ones cannot be run.

    Returns:
        None where the point cannot be run, or none near it.
    """
    base = make(x[None])
    if base is None:
        return None
    of_numbers = np.zeros((base.table.shape[1], len(x)))
    of_state = np.zeros((base.y0.shape[1], len(x)))
    for j, length in enumerate(size):
        h = power_of_two(step * length)
        for some in offsets:
            points = np.repeat(x[None], len(some), axis=0)
            points[:, j] += h * np.array(some)
            if (starts := make(points)) is None:
                continue
            weights = (weights_of(some) / h).tolist()
            of_numbers[:, j] = weighted(list(zip(weights, starts.table, strict=True)))
            of_state[:, j] = weighted(list(zip(weights, starts.y0, strict=True)))
            break
        else:
            return None
    return base, of_numbers, of_state


class DifferentiatedBatch:
    """Runs points one by one, with derivatives by p parameters. Not for two threads at once."""

    def __init__(self, batch: CompiledBatch, count: int, lanes: int) -> None:
        """Args: what runs points alone; parameters; directions that code is compiled for."""
        self._batch, self._count = batch, count
        self._differentiation = Differentiation(1 + lanes)
        self._points: driver.Points | None = None

    def run(self, start: Starts, of_numbers: Floats, of_state: Floats) -> tuple[BatchRows, Floats]:
        """Rows of a point and (nt, width, p) their derivatives; arguments of one point."""
        batch, of = self._batch, self._differentiation
        if self._points is None or not np.array_equal(self._points.places, start.places):
            self._points = batch.points(start)
        points = self._points
        arguments = batch.arguments(points)
        for argument in arguments:
            of.wide(argument)
        points.at[: driver.START + 1] = 0, 0, start.start
        points.table[:], points.y0[:] = start.table, start.y0
        points.diagnostics[:, SIZE] = start.sizes
        of.take()
        of.slopes(points.table)[:, : self._count] = of_numbers
        of.slopes(points.y0)[:, : self._count] = of_state
        with np.errstate(all="ignore"):
            while points.at[driver.POINT] == 0:
                of.call(driver.run_points, *arguments)
        nt = len(points.rows)
        slopes = of.slopes(points.rows)[:, : self._count].reshape(nt, -1, self._count)
        return batch.rows_of(points, start.y0), slopes.copy()
