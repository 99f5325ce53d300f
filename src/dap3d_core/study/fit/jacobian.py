"""Predictions of the data of a fit, and their derivatives: those of one run, or differences.

What they say of the parameters: their covariance, and those that the data do not determine.
"""

from collections.abc import Sequence
from fractions import Fraction

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.result.quantities.measured_data import MeasuredData
from dap3d_core.simulation import SimulationError
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.fit.fit_parameters import Parameter
from dap3d_core.study.fit.interpolation import SeriesInterpolator
from dap3d_core.study.workers.threads import run_here

#: A direction is lost if its singular value of the scaled Jacobian, over the largest, is below the
#: first, or below the second times the error of a central difference at the tolerance.
MIN_SINGULAR_VALUE, DIFFERENCE_ERRORS = 1e-6, 5.0
#: ... or below so many times the error of the Jacobian, where it is known.
JACOBIAN_ERRORS = 3.0
#: Changes of the predictions below so many tolerances of the integration are noise.
TOLERANCES = 100.0
#: Least component of a parameter in a lost direction.
MIN_COMPONENT = 1e-3
#: Largest integer in a message on a combination, and the tolerance of being one.
MAX_INTEGER, NEAR = 3, 1e-3
#: The quantile of the normal distribution that leaves 95 % between it and its negative.
NORMAL_95 = 1.959963984540054


@attrs.frozen(eq=False)
class Identifiability:
    """Parameters and combinations of them that the data determine at the optimum.

    Attributes:
        covariance: (d, d) with a standard deviation of 1 for the weighted data; rows of parameters
            that are not determined are inf on the diagonal and NaN else; NaN for those at a bound.
        rank: number of combinations that the data determine.
        messages: on parameters that are not determined, a sentence each.
    """

    covariance: Floats
    rank: int
    messages: tuple[str, ...]


@attrs.frozen
class NoiseFloor:
    """Noise of runs with a tolerance.

    Attributes:
        singular_value: of the scaled Jacobian, over the largest, of a lost direction.
        change: of the predictions, (m,) as a vector, that is noise.
    """

    singular_value: float
    change: float

    @classmethod
    def of(cls, rtol: float, predicted: Floats) -> "NoiseFloor":
        """That of runs with a tolerance, which predict (m,) numbers."""
        singular_value = max(MIN_SINGULAR_VALUE, DIFFERENCE_ERRORS * rtol ** (2.0 / 3.0))
        return cls(singular_value, TOLERANCES * rtol * float(np.linalg.norm(predicted)))


def regularised(jacobian: Floats, floor: NoiseFloor) -> tuple[Floats, Floats]:
    """A Jacobian (m, d) without lost directions, and (d, d) rows that hold parameters along them.

    With these rows below it, and zeros below the residuals, no step goes where nothing is gained
    and only the errors of the derivatives lead. Parameters are over their scales.
    """
    size = np.linalg.norm(jacobian, axis=0)
    idle = size <= floor.change
    free = np.flatnonzero(~idle)
    rows = np.diag(np.where(idle, max(size.max(), 1.0), 0.0))
    reduced = np.where(idle, 0.0, jacobian)
    if len(free):
        u, s, vt = np.linalg.svd(jacobian[:, free] / size[free], full_matrices=False)
        lost = s <= floor.singular_value * s[0]
        reduced[:, free] = (u * np.where(lost, 0.0, s)) @ vt * size[free]
        held = s[0] * vt[lost] * size[free]
        rows[np.ix_(free[: len(held)], free)] = held
    return reduced, rows


def identify(
    names: Sequence[str], x: Floats, scale: Floats, jacobian: Floats, error: Floats,
    held: NDArray[np.bool_], floor: NoiseFloor,
) -> Identifiability:  # fmt: skip
    """Identifiability of parameters by a Jacobian.

    Args:
        names: (d,) of the parameters.
        x, scale: (d,) their values; changes of them that matter.
        jacobian, error: (m, d) derivatives of the weighted predictions, and their errors.
        held: (d,) those at a bound, which are taken as known.
        floor: noise of the runs.
    """
    d = len(names)
    size, error_size = np.linalg.norm(jacobian, axis=0), np.linalg.norm(error, axis=0)
    noisy = (size <= JACOBIAN_ERRORS * error_size) | (size * scale <= floor.change)
    idle = ~held & noisy
    free = np.flatnonzero(~held & ~idle)
    covariance = np.full((d, d), np.nan)
    covariance[idle, idle] = np.inf
    messages = [f"{n} has no effect on these data" for n, i in zip(names, idle, strict=True) if i]
    if not len(free):
        return Identifiability(covariance, 0, tuple(messages))
    relative_error = np.linalg.norm(error[:, free] / size[free], ord=2)
    _, s, vt = np.linalg.svd(jacobian[:, free] / size[free], full_matrices=False)
    lost = s <= max(floor.singular_value * s[0], JACOBIAN_ERRORS * relative_error)
    inverse = np.where(lost, 0.0, 1.0 / np.where(lost, 1.0, s) ** 2)
    inner = (vt.T * inverse) @ vt / np.outer(size[free], size[free])
    for relation in _relations(vt[lost]):
        part = np.flatnonzero(relation)
        messages.append(_message([names[free[j]] for j in part], x[free[part]],
                                 relation[part] / size[free[part]]))  # fmt: skip
    unknown = (np.abs(vt[lost]) > MIN_COMPONENT).any(axis=0)
    inner[unknown, :] = inner[:, unknown] = np.nan
    inner[unknown, unknown] = np.inf
    covariance[np.ix_(free, free)] = inner
    return Identifiability(covariance, int((~lost).sum()), tuple(messages))


def intervals(
    covariance: Floats, x: Floats, cost: float, degrees: int, *, known: bool
) -> tuple[Floats, list[tuple[float, float]]]:
    """Covariance and 95 % intervals: normal where sigma is known, else by Student's t."""
    from scipy.special import stdtrit

    covariance, quantile = covariance.copy(), NORMAL_95
    finite = np.isfinite(covariance)
    if not known and degrees:
        covariance[finite] *= 2.0 * cost / degrees
        quantile = float(stdtrit(degrees, 0.975))
    elif not known:  # as many numbers as parameters leave nothing to estimate a deviation from
        covariance[finite] = np.nan
        covariance[np.diag_indices(len(x))] = np.where(finite.diagonal(), np.inf, np.nan)
    half = quantile * np.sqrt(np.diag(covariance))
    return covariance, [(float(v - h), float(v + h)) for v, h in zip(x, half, strict=True)]


def correlation_of(covariance: Floats) -> Floats:
    """(d, d) of a covariance, NaN where that is not finite."""
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviation, deviation)
    return np.asarray(np.where(np.isfinite(correlation), correlation, np.nan))


def _relations(directions: Floats) -> Floats:
    """Lost directions (n, d) of few parameters each: by elimination with the largest pivots."""
    left = directions.copy()
    for k in range(len(left)):
        pivot = np.unravel_index(np.argmax(np.abs(left[k:])), left[k:].shape)
        row, column = k + int(pivot[0]), int(pivot[1])
        left[[k, row]] = left[[row, k]]
        left[k] /= left[k, column]
        for other in range(len(left)):
            if other != k:
                left[other] -= left[other, column] * left[k]
    left[np.abs(left) < MIN_COMPONENT] = 0.0
    return left


def _message(names: list[str], x: Floats, direction: Floats) -> str:
    """The sentence on parameters that change together along a direction without effect."""
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    begin = f"{listed} cannot be told apart by these data"
    if len(names) == 2:
        return f"{begin}: only {_combination(names, x, direction)} is determined"
    relative = direction / x if (x != 0.0).all() else None
    if relative is not None and np.ptp(relative) < NEAR * np.abs(relative).max():
        return f"{begin}: only their ratios are determined"
    change = direction / np.abs(direction).max()
    shown = ", ".join(f"{n} by {c:+.3g}" for n, c in zip(names, change, strict=True))
    return f"{begin}: changing {shown} together, in this proportion, leaves the predictions"


def _combination(names: list[str], x: Floats, direction: Floats) -> str:
    """The invariant of a direction of two parameters: a product of powers, or a sum."""
    if (x != 0.0).all():
        powers = _integers(direction[1] / x[1], -direction[0] / x[0])
        if powers:
            first, second = (name if abs(p) == 1 else f"{name}^{abs(p)}"
                             for name, p in zip(names, powers, strict=True))  # fmt: skip
            return f"{first} {'*' if powers[1] > 0 else '/'} {second}"
    a, b = _integers(direction[1], -direction[0]) or (1.0, -direction[0] / direction[1])
    first = names[0] if a == 1 else f"{a:.4g} {names[0]}"
    second = names[1] if abs(b) == 1 else f"{abs(b):.4g} {names[1]}"
    return f"{first} {'-' if b < 0 else '+'} {second}"


def _integers(a: float, b: float) -> tuple[int, int] | None:
    """Small integers, the first above zero, in the ratio a : b."""
    if not a or not b:
        return None
    ratio = Fraction(b / a).limit_denominator(MAX_INTEGER)
    if not 0 < abs(ratio.numerator) <= MAX_INTEGER or abs(float(ratio) * a / b - 1.0) > NEAR:
        return None
    return ratio.denominator, ratio.numerator


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
