"""Predictions of the data of a fit, and their derivatives: those of one run, or differences."""

from collections.abc import Sequence

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.quantities.measured_data import MeasuredData
from dap3d_core.simulation import SimulationError
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.fit.fit_parameters import Parameter
from dap3d_core.study.fit.interpolation import SeriesInterpolator
from dap3d_core.study.workers.threads import run_here

Stencil = tuple[tuple[float, ...], tuple[float, ...]]

#: Offsets of two runs, in steps, and weights of point, first and second run in the derivative:
#: central, and of the same order to either side.
STENCILS: tuple[Stencil, ...] = (
    ((-1.0, 1.0), (0.0, -0.5, 0.5)),
    ((1.0, 2.0), (-1.5, 2.0, -0.5)),
    ((-1.0, -2.0), (1.5, -2.0, 0.5)),
)
#: Factors of steps, the second where runs near a point fail.
STEP_FACTORS = (1.0, 0.1)
#: Least size of a parameter near 0, over its scale, in the length of its step.
MIN_SIZE = 0.1


class Predictor:
    """Runs points and returns their predictions of the data.

    Attributes:
        ensemble, data, interpolator: runs points; the measured data; takes series at their times.
        runs: number of runs so far.
        note: of the last run that failed.
    """

    def __init__(
        self,
        ensemble: Ensemble,
        data: MeasuredData,
        interpolator: SeriesInterpolator,
        threads: int | None,
    ) -> None:
        self.ensemble, self.data, self.interpolator = ensemble, data, interpolator
        self.threads, self.runs, self.note = threads, 0, ""

    def series(self, points: Floats) -> dict[str, Floats]:
        """Output -> (k, n) its reported series at points (k, d); NaN where a run has none."""
        shape = len(points), len(self.ensemble.times)
        series = {o.name: np.full(shape, np.nan) for o in self.ensemble.outputs}
        for chunk, batch in run_here(self.ensemble, points, np.arange(len(points)), self.threads):
            for name, values in batch.values.items():
                series[name][chunk] = values
            self.note = next((note for note in batch.notes if note), self.note)
        self.runs += len(points)
        return series

    def with_slopes(self, x: Floats, size: Floats) -> tuple[Floats, Floats] | None:
        """(m,) weighted predictions at a point x (d,) and (m, d) their derivatives, of one run.

        size: (d,) of the parameters. None where predictions have no derivatives.
        """
        found = self.ensemble.series_with_slopes(x, size)
        if found is None:
            return None
        self.runs += 1
        parts = {
            name: self.interpolator(np.vstack([values, slopes.T]))
            for name, (values, slopes) in found.items()
        }
        weighted = self.data.weighted(parts)
        return weighted[0], weighted[1:].T

    def __call__(self, points: Floats) -> Floats:
        """(k, m) weighted predictions of the m data at points (k, d); NaN where a run fails."""
        series = self.series(points)
        return self.data.weighted({name: self.interpolator(v) for name, v in series.items()})


@attrs.frozen(eq=False)
class Differences:
    """Derivatives of predictions by differences, all runs of which are one batch.

    Attributes:
        predict: runs points.
        low, high: (d,) bounds of the points.
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
        """Differences with steps for a tolerance of the integration.

        The error of a central difference is about h**2 of the curve and rtol / h of the runs: least
        for h about the cube root of rtol.
        """
        names = [parameter.name for parameter in predict.ensemble.parameters]
        low, high = (np.array([getattr(p, n) for p in parameters]) for n in ("low", "high"))
        scale = np.array([p.size for p in parameters])
        return cls(predict, low, high, scale, float(np.cbrt(max(rtol, 1e-13))), names)

    def lengths(self, x: Floats) -> Floats:
        """(d,) sizes of parameters at a point."""
        return np.maximum(np.abs(x), MIN_SIZE * self.scale)

    def steps(self, x: Floats, base: Floats, slopes: Floats | None) -> Floats:
        """(d,) steps at a point x where base (m,) is predicted, with derivatives so far.

        Where a parameter changes predictions fast, such as a stiffness the phase of many
        oscillations, its step changes them by ``relative`` of their size.
        """
        length = self.lengths(x)
        if slopes is not None:
            size, speed = _deviation(base), np.array([_deviation(column) for column in slopes.T])
            fast = (speed * length > size) & (size > 0.0)
            length[fast] = size / speed[fast]
        return np.minimum(self.relative * length, (self.high - self.low) / 5.0)

    def __call__(self, x: Floats, base: Floats, steps: Floats) -> Floats:
        """The derivatives (m, d) at a point x (d,) where base (m,) is predicted.

        Raises:
            SimulationError: no run on either side of the point succeeds.
        """
        jacobian = np.full((len(base), len(x)), np.nan)
        for factor in STEP_FACTORS:
            for stencil in STENCILS:
                missing = np.flatnonzero(np.isnan(jacobian).any(axis=0))
                self._fill(jacobian, missing, x, base, factor * steps, stencil)
        bad = np.flatnonzero(np.isnan(jacobian).any(axis=0))
        if len(bad):
            name, value = self.names[bad[0]], x[bad[0]]
            raise SimulationError(
                f"no run on either side of {name} = {value:g} succeeds, so that it is not known "
                f"how the data change with it: {self.predict.note}"
            )
        return jacobian

    def _fill(
        self, jacobian: Floats, which: Integers, x: Floats, base: Floats, steps: Floats,
        stencil: Stencil,
    ) -> None:  # fmt: skip
        """Fill columns of these parameters, as far as runs within the bounds succeed."""
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
            # the step as it was added, after rounding
            exact = (points[2 * k + 1, j] - points[2 * k, j]) / (offsets[1] - offsets[0])
            pair = weights[0] * predicted[2 * k] + weights[1] * predicted[2 * k + 1]
            jacobian[:, j] = (w * base + pair) / exact


def _deviation(values: Floats) -> float:
    """Root mean square of values about their mean."""
    return float(np.sqrt(np.mean((values - values.mean()) ** 2)))
