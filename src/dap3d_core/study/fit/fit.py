"""Fits parameters of a scene to measured data by nonlinear least squares."""

import os
from collections.abc import Callable, Iterator
from typing import Any, Unpack

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.registry import load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.result.quantities.measured_data import MeasuredData, read_measured
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError, check, check_simulation, load
from dap3d_core.settings import RunSettings
from dap3d_core.simulation import SimulationError
from dap3d_core.study.ensemble import Ensemble
from dap3d_core.study.fit.fit_parameters import Parameter, read_parameters
from dap3d_core.study.fit.fit_result import Fit
from dap3d_core.study.fit.interpolation import MAX_INSTANTS, SeriesInterpolator, common_step
from dap3d_core.study.fit.jacobian import (
    Differences,
    NoiseFloor,
    Predictor,
    correlation_of,
    identify,
    intervals,
    regularised,
)
from dap3d_core.study.outputs import Output
from dap3d_core.study.parameters import with_values
from dap3d_core.study.study import Study

Announce = Callable[[str], None]
#: Called as progress(iteration, cost) with each new derivative.
Progress = Callable[[int, float], None]

#: The search ends where cost or parameters change by less than this, relatively.
FTOL, XTOL = 1e-10, 1e-9
#: Why it ended, by the status of ``least_squares``.
ENDS = {
    0: "the sum of squares still fell after so many runs",
    2: "the sum of squares falls no more",
    3: "the parameters move no more",
    4: "the sum of squares falls no more, the parameters move no more",
}
#: Least number of reporting steps of a run, so that its curves can be drawn.
MIN_STEPS = 100
#: Relative error of the spline above which a note gives the remedy.
LARGE_ERROR = 1e-5
#: A fit explains little where it leaves more than this fraction of the squares of an output about
#: its mean; or where chi-square is so many standard deviations above 1.
UNEXPLAINED, DEVIATIONS = 0.5, 6.0
#: A bound that is nearer than this, in scales, is tried itself.
AT_BOUND = 1e-3


@checked
def fit(
    scene: Scene | str | os.PathLike[str],
    parameters: Any,
    measured: Any,
    outputs: Any = None,
    *,
    sigma: Any = None,
    allow_code: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
    **settings: Unpack[RunSettings],
) -> Fit:
    """Find the values of parameters of a scene with which its run explains measured data best.

    The sum of the squares of (measured - predicted) / sigma is minimised within the bounds, by a
    trust region. A run gives predictions and their exact derivatives; where it has none, as where
    nothing is compiled, they are central differences, all runs of which are one batch.

    Args:
        scene: a Scene, or what ``load`` takes.
        parameters: dotted name -> start, (start, low, high) or a ``Parameter``; names alone start
            from the value in the scene. ``forces.spring.k``, ``points.A.sPp.x``.
        measured: {"t": times, "mass.r.x": values}, an xarray.Dataset, or the path of a CSV file
            with a header, whose units in brackets have to be those of the quantities. Any times
            from 0 in any order, s; SI units; NaN, in a file nothing, where one was not measured.
        outputs: columns that are used, or column -> name of its quantity; by default all.
        sigma: standard deviation of the data: a number, or for each output one or (nt,). Without
            it all data have the same one, which is estimated from the residuals; outputs of
            different units need it.
        t_end, dt: of the runs, s; by default the last time measured, and a step of which the times
            are multiples. Where there is none, a spline interpolates, which a note says.
        method, integrator, rtol, atol, step, correct, project, correct_metric, allow_code: as
            of ``simulate``; announce as well.
        threads: runs at once; by default one for each core.
        progress: called as progress(iteration, cost) with each new derivative.

    Raises:
        SceneError, PluginError: all mistakes of the arguments, or of the scene.
        SimulationError: the run at the start fails, or all runs on both sides of a point.
    """
    task = _read(scene, parameters, measured, outputs, sigma, allow_code, announce, dict(settings))
    predict = _predictor(task, threads, announce)
    search = _Search(task, predict, progress)
    return _result(task, search, *search.run())


@attrs.frozen(eq=False)
class _Task:
    """The checked arguments: the scene, the study of its runs, parameters, data."""

    scene: Scene
    study: Study
    parameters: list[Parameter]
    data: MeasuredData
    dt: float | None

    @property
    def start(self) -> Floats:
        return np.array([p.start for p in self.parameters], dtype=np.float64)


def _read(
    scene: Any, parameters: Any, measured: Any, outputs: Any, sigma: Any,
    allow_code: bool, announce: Announce | None, settings: dict[str, Any],
) -> _Task:  # fmt: skip
    """Check all arguments; a SceneError has all mistakes."""
    own = scene.copy() if isinstance(scene, Scene) else load(scene)
    checked = check(own, load_registry(), allow_code=allow_code)
    fitted, mistakes = read_parameters(checked, parameters)
    data, quantities, wrong = read_measured(measured, outputs, sigma)
    mistakes += wrong
    t_end = settings.get("t_end")
    given = {k: v for k, v in settings.items() if v is not None}
    simulation = attrs.evolve(own.simulation, **given)
    try:
        check_simulation(simulation, list(own.bodies))
    except SceneError as error:
        mistakes += error.mistakes
    series = tuple(Output(label, of, "series") for label, of in quantities.items())
    has_sigma = sigma is not None
    mistakes += _output_mistakes(own, series, data, allow_code, announce, has_sigma=has_sigma)
    if data is not None:
        last = float(data.t.max())
        if isinstance(t_end, (int, float)) and t_end < last:
            what = f"the run ends before the last measured time, {last:g} s"
            mistakes.append(Mistake("t_end", t_end, what))
        if data.count < len(fitted):
            what = f"{data.count} measured numbers cannot determine {len(fitted)} parameters"
            mistakes.append(Mistake("measured", MISSING, what))
        simulation = attrs.evolve(simulation, t_end=last if t_end is None else t_end)
    if mistakes or data is None:
        raise SceneError(mistakes)
    running = own.copy()
    running.simulation = simulation
    study = Study(running, tuple(fitted), series, allow_code)
    return _Task(own, study, list(fitted.values()), data, settings.get("dt"))


def _output_mistakes(
    scene: Scene,
    outputs: tuple[Output, ...],
    data: MeasuredData | None,
    allow_code: bool,
    announce: Announce | None,
    *,
    has_sigma: bool,
) -> list[Mistake]:
    """Mistakes of the measured quantities."""
    probed = scene.copy()
    probed.simulation = attrs.evolve(probed.simulation, t_end=1.0, dt=1.0)
    try:
        ensemble = Ensemble(Study(probed, (), outputs, allow_code), announce)
    except SceneError as error:
        named = "give outputs={COLUMN: QUANTITY} for columns of other names"
        return [attrs.evolve(m, key="measured", remedy=m.remedy or named)
                if m.key == "outputs" else m for m in error.mistakes]  # fmt: skip
    expanded = {output.name for output in ensemble.outputs}
    what = "a column is one number: name a component of this vector"
    mistakes = [
        Mistake("measured", o.name, what, f"{o.of}.x") for o in outputs if o.name not in expanded
    ]
    for label, unit in ensemble.units.items():
        if data is not None and (what := data.unlike(label, unit)):
            mistakes.append(Mistake(f"measured.{label}", MISSING, what))
    units = sorted(set(ensemble.units.values()))
    if not mistakes and len(units) > 1 and not has_sigma:
        what = f"outputs in {', '.join(units)} are weighed by their standard deviations"
        remedy = "give sigma, a number for each output"
        mistakes.append(Mistake("sigma", MISSING, what, remedy=remedy))
    return mistakes


def _predictor(task: _Task, threads: int | None, announce: Announce | None) -> Predictor:
    """A predictor with runs that report at the measured times, or finely enough between them."""
    t, last = task.data.t, task.study.scene.simulation.t_end or 0.0
    common = common_step(np.append(t, last))
    step = common / -(-MIN_STEPS // round(last / common)) if common else last / MIN_STEPS
    dt = task.dt or step or None
    while True:
        scene = task.study.scene.copy()
        scene.simulation = attrs.evolve(scene.simulation, dt=dt)
        ensemble = Ensemble(attrs.evolve(task.study, scene=scene), announce=announce)
        predict = Predictor(ensemble, task.data, SeriesInterpolator.of(ensemble.times, t), threads)
        series = predict.series(task.start[None])
        if any(np.isnan(v).any() for v in series.values()):
            values = zip(task.study.names, task.start, strict=True)
            where = ", ".join(f"{name} = {value:g}" for name, value in values)
            raise SimulationError(f"the run at the start of the fit, {where}, fails: "
                                  f"{predict.note or 'it does not reach the data'}")  # fmt: skip
        errors = [predict.interpolator.relative_error(v[0]) for v in series.values()]
        fine = max(errors) <= scene.simulation.rtol
        if task.dt or fine or last / (dt or last) * 2 > MAX_INSTANTS:
            return predict
        dt = (dt or last) / 2.0


class _Search:
    """The search by ``least_squares``, in parameters over their scales.

    Attributes:
        predict, differences: predictions and their derivatives.
        data: (m,) weighted.
        iterations: evaluations of the derivatives.
    """

    def __init__(self, task: _Task, predict: Predictor, progress: Progress | None) -> None:
        self.task, self.predict, self.progress = task, predict, progress
        rtol = task.study.scene.simulation.rtol
        self.differences = Differences.of(predict, task.parameters, rtol)
        self.data = task.data.weighted(task.data.values)
        self.floor = NoiseFloor.of(rtol, self.data)
        self.iterations = 0
        self._known: dict[bytes, Floats] = {}
        self._exact: dict[bytes, Floats] = {}
        self._is_exact = True
        self._slopes: Floats | None = None
        self._largest = 0.0

    def run(self) -> tuple[Floats, str, bool]:
        """The best parameters, why the search ended, and whether it converged."""
        from scipy.optimize import least_squares

        of = self.differences
        search = least_squares(
            lambda z: np.append(self._residual(z * of.scale), np.zeros(len(z))),
            self.task.start / of.scale,
            jac=lambda z: np.vstack(self._regularised(z * of.scale)),
            bounds=(of.low / of.scale, of.high / of.scale),
            method="trf", ftol=FTOL, xtol=XTOL, gtol=None,
        )  # fmt: skip
        x = self._at_bounds(np.clip(search.x * of.scale, of.low, of.high))
        return x, ENDS[search.status], search.status > 0

    def predicted(self, x: Floats) -> Floats:
        """(m,) predictions at a point; NaN where its run fails."""
        key = x.tobytes()
        if key not in self._known:
            found = None
            if self._is_exact:
                found = self.predict.with_slopes(x, self.differences.lengths(x))
            if found is None:
                self._known[key] = self.predict(x[None])[0]
                # a run that succeeds without derivatives will have none elsewhere
                self._is_exact &= not np.isfinite(self._known[key]).all()
            else:
                self._known[key], self._exact[key] = found
        return self._known[key]

    def _residual(self, x: Floats) -> Floats:
        """Predictions less data; so large for a run that fails that the point is rejected."""
        residual = self.predicted(x) - self.data
        if np.isfinite(residual).all():
            self._largest = max(self._largest, float(np.linalg.norm(residual)))
            return np.asarray(residual)
        return np.full(len(residual), 10.0 * self._largest + 1.0)

    def _regularised(self, x: Floats) -> tuple[Floats, Floats]:
        """Derivatives over the scales, and rows that hold parameters they do not determine."""
        self.iterations += 1
        base, key = self.predicted(x), x.tobytes()
        self._known = {key: base}  # earlier points are not needed again
        self._exact = {key: self._exact[key]} if key in self._exact else {}
        if self.progress is not None:
            self.progress(self.iterations, 0.5 * float(np.sum((base - self.data) ** 2)))
        if key in self._exact:
            self._slopes = self._exact[key]
        else:
            steps = self.differences.steps(x, base, self._slopes)
            self._slopes = self.differences(x, base, steps)
        return regularised(self._slopes * self.differences.scale, self.floor)

    def _at_bounds(self, x: Floats) -> Floats:
        """The point with parameters near a bound moved to it, where that is no worse."""
        of = self.differences
        for bound in (of.low, of.high):
            for j in np.flatnonzero(np.abs(x - bound) < AT_BOUND * of.scale):
                moved = x.copy()
                moved[j] = bound[j]
                before, after = (np.sum(self._residual(p) ** 2) for p in (x, moved))
                if after <= before * (1.0 + FTOL):
                    x = moved
        return x

    def final(self, x: Floats) -> tuple[Floats, Floats]:
        """Derivatives at the optimum, and their error.

        Of differences those from steps of two lengths, and the error of one alone.
        """
        base = self.predicted(x)
        if (exact := self._exact.get(x.tobytes())) is not None:
            return exact, np.zeros_like(exact)
        short = self.differences.steps(x, base, self._slopes)
        one, two = (self.differences(x, base, f * short) for f in (1.0, 2.0))
        return (4.0 * one - two) / 3.0, one - two


def _result(task: _Task, search: _Search, x: Floats, message: str, converged: bool) -> Fit:
    """The result of a search."""
    data, of, predict = task.data, search.differences, search.predict
    base = search.predicted(x)
    jacobian, error = search.final(x)
    held = (x <= of.low) | (x >= of.high)
    identified = identify(of.names, x, of.scale, jacobian, error, held, search.floor)
    cost = 0.5 * float(np.sum((base - search.data) ** 2))
    degrees = data.count - identified.rank
    covariance, interval = intervals(
        identified.covariance, x, cost, degrees, known=bool(data.sigma)
    )
    result = predict.ensemble.result(x.tolist())
    series = {label: result.quantity(name).values for label, name in data.quantities.items()}
    fitted = {label: predict.interpolator(values) for label, values in series.items()}
    spline_error = max(predict.interpolator.relative_error(v) for v in series.values())
    return Fit(
        values=dict(zip(of.names, x.tolist(), strict=True)),
        interval=dict(zip(of.names, interval, strict=True)),
        covariance=covariance,
        correlation=correlation_of(covariance),
        t=data.t,
        measured=data.values,
        fitted=fitted,
        residuals={label: v - fitted[label] for label, v in data.values.items()},
        sigma=data.sigma,
        units=predict.ensemble.units,
        quantities=data.quantities,
        cost=cost,
        degrees=degrees,
        chi_square=2.0 * cost / degrees if data.sigma and degrees else None,
        iterations=search.iterations,
        runs=predict.runs + 1,
        status="converged" if converged else "stopped",
        message=message,
        notes=(
            *identified.messages,
            *_misfit(task.data, fitted, cost, degrees),
            *_notes(task, search, x, degrees, spline_error),
        ),
        scene=with_values(task.scene, predict.ensemble.parameters, x.tolist()),
        result=result,
    )


def _misfit(
    data: MeasuredData, fitted: dict[str, Floats], cost: float, degrees: int
) -> Iterator[str]:
    """Notes on a run that does not explain the data."""
    remedy = "the scene lacks something, or the search began too far away"
    chi_square = 2.0 * cost / degrees if degrees else 1.0
    if data.sigma and chi_square > 1.0 + DEVIATIONS * np.sqrt(2.0 / degrees):
        yield f"residuals are larger than sigma, chi-square is {chi_square:.3g}: {remedy}"
        return
    for label, values in data.values.items():
        there = np.isfinite(values)
        if there.any():
            left = np.sum((values - fitted[label])[there] ** 2)
            if left > UNEXPLAINED * np.sum((values[there] - values[there].mean()) ** 2) > 0.0:
                yield (f"less than half of the variation of {label} is explained: {remedy}, or it "
                       "is noise")  # fmt: skip


def _notes(
    task: _Task, search: _Search, x: Floats, degrees: int, spline_error: float
) -> Iterator[str]:
    """Notes on bounds, degrees of freedom, and interpolation."""
    of = search.differences
    for name, value, low, high in zip(of.names, x, of.low, of.high, strict=True):
        if value in (low, high):
            side = "lower" if value == low else "upper"
            yield (f"{name} is at its {side} bound, {value:g}; the intervals of the others "
                   "take it as known")  # fmt: skip
    if not degrees and not task.data.sigma:
        yield "there are as many measured numbers as parameters: no interval is known"
    if search.predict.interpolator.index is None:
        error = "with an unknown error" if np.isinf(spline_error) else (
            f"with an error of up to {spline_error:.1g} of the size of an output")  # fmt: skip
        remedy = "; a smaller dt, or none, would be better" if spline_error > LARGE_ERROR else ""
        yield f"a spline of degree 5 interpolates between reported instants, {error}{remedy}"
