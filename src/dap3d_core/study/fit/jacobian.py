"""What runs predict at the times of measurements, and how it changes with the parameters."""

from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.simulation import SimulationError
from dap3d_core.study.fit.fit_parameters import Parameter
from dap3d_core.study.fit.interpolation import Sampling
from dap3d_core.study.fit.measured_data import Measured
from dap3d_core.study.study import Ensemble
from dap3d_core.study.workers.threads import run_here

Floats = NDArray[np.float64]

Stencil = tuple[tuple[float, ...], tuple[float, ...]]

#: Two runs beside the point, in steps, and the weights of point, first and second in the
#: derivative: central, and of the same order to either side.
STENCILS: tuple[Stencil, ...] = (
    ((-1.0, 1.0), (0.0, -0.5, 0.5)),
    ((1.0, 2.0), (-1.5, 2.0, -0.5)),
    ((-1.0, -2.0), (1.5, -2.0, 0.5)),
)
#: Steps are shortened so much where runs fail beside a point.
SHORTER = (1.0, 0.1)
#: A step is as long as this part of the scale although the parameter is nearer to 0.
LEAST = 0.1


class Predictor:
    """Runs points and gives what they predict, weighted as the data are.

    Attributes:
        ensemble, measured, sampling: what runs; what with; at which times.
        runs: how many there were.
        note: what the last run that failed said.
    """

    def __init__(
        self, ensemble: Ensemble, measured: Measured, sampling: Sampling, threads: int | None
    ) -> None:
        self.ensemble, self.measured, self.sampling = ensemble, measured, sampling
        self.threads, self.runs, self.note = threads, 0, ""

    def series(self, points: Floats) -> dict[str, Floats]:
        """Output -> (k, n) its reported series at points (k, d); NaN where a run has none."""
        places = np.arange(len(points))
        n = len(self.ensemble.times)
        found = {o.name: np.full((len(points), n), np.nan) for o in self.ensemble.outputs}
        for chunk, batch in run_here(self.ensemble, points, places, self.threads):
            for name, values in batch.values.items():
                found[name][chunk] = values
            self.note = next((note for note in batch.notes if note), self.note)
        self.runs += len(points)
        return found

    def __call__(self, points: Floats) -> Floats:
        """(k, m) predictions for the m measured numbers at points (k, d); NaN where one fails."""
        found = self.series(points)
        return self.measured.weighted({name: self.sampling(v) for name, v in found.items()})


@attrs.frozen(eq=False)
class Differences:
    """Derivatives of predictions by differences, of which all runs are one batch.

    Attributes:
        predict: runs points.
        low, high: (d,) the points stay between them.
        scale: (d,) changes that matter.
        relative: the step over the scale, or over the parameter.
        names: of the parameters.
    """

    predict: Predictor
    low: Floats
    high: Floats
    scale: Floats
    relative: float
    names: Sequence[str]

    @classmethod
    def of(cls, predict: Predictor, parameters: Sequence[Parameter], rtol: float) -> "Differences":
        """Steps as fit the tolerance of the integration.

        The error of a central difference is some h**2 of the curve and rtol / h of the runs: least
        for h about the cube root of rtol.
        """
        names = [number.name for number in predict.ensemble.numbers]
        low, high = (np.array([getattr(p, n) for p in parameters]) for n in ("low", "high"))
        scale = np.array([p.size for p in parameters])
        return cls(predict, low, high, scale, float(np.cbrt(max(rtol, 1e-13))), names)

    def steps(self, x: Floats, base: Floats, slopes: Floats | None) -> Floats:
        """(d,) steps at a point.

        Where parameters are known to move the predictions fast, such as a stiffness the phase of
        many oscillations, steps are shorter: they change predictions by ``relative`` of their size.
        """
        length = np.maximum(np.abs(x), LEAST * self.scale)
        if slopes is not None:
            size, speed = _rms(base), np.array([_rms(column) for column in slopes.T])
            fast = (speed * length > size) & (size > 0.0)
            length[fast] = size / speed[fast]
        return np.minimum(self.relative * length, (self.high - self.low) / 5.0)

    def __call__(self, x: Floats, base: Floats, steps: Floats) -> Floats:
        """The derivatives (m, d) at a point x (d,) where base (m,) is predicted.

        Raises:
            SimulationError: no run on either side of the point succeeds.
        """
        found = np.full((len(base), len(x)), np.nan)
        for shorter in SHORTER:
            for stencil in STENCILS:
                open_ = np.flatnonzero(np.isnan(found).any(axis=0))
                self._fill(found, open_, x, base, shorter * steps, stencil)
        bad = np.flatnonzero(np.isnan(found).any(axis=0))
        if len(bad):
            name, value = self.names[bad[0]], x[bad[0]]
            raise SimulationError(
                f"no run on either side of {name} = {value:g} succeeds, so that it is not known "
                f"how the data change with it: {self.predict.note}"
            )
        return found

    def _fill(
        self, found: Floats, which: NDArray[np.int64], x: Floats, base: Floats, steps: Floats,
        stencil: Stencil,
    ) -> None:  # fmt: skip
        """Columns of these parameters, as far as runs within the bounds succeed."""
        offsets, (w, *weights) = stencil
        inside = [
            j
            for j in which
            if all(self.low[j] <= x[j] + o * steps[j] <= self.high[j] for o in offsets)
        ]
        if not inside:
            return
        points = np.repeat(x[None], 2 * len(inside), axis=0)
        for k, j in enumerate(inside):
            points[2 * k : 2 * k + 2, j] += np.multiply(offsets, steps[j])
        predicted = self.predict(points)
        for k, j in enumerate(inside):
            # what was added to the number, which is rounded
            exact = (points[2 * k + 1, j] - points[2 * k, j]) / (offsets[1] - offsets[0])
            pair = weights[0] * predicted[2 * k] + weights[1] * predicted[2 * k + 1]
            found[:, j] = (w * base + pair) / exact


def _rms(values: Floats) -> float:
    """The size of values about their mean."""
    return float(np.sqrt(np.mean((values - values.mean()) ** 2)))
