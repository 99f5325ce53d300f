"""Numbers of a scene from measured data: nonlinear least squares whose runs are a study."""

import os
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.registry import load_registry
from dap3d_core.scene import (
    MISSING,
    Mistake,
    Scene,
    SceneError,
    check,
    check_simulation,
    load,
)
from dap3d_core.simulation import SimulationError
from dap3d_core.study.fit.fit_parameters import Parameter, read_parameters
from dap3d_core.study.fit.fit_result import Fit
from dap3d_core.study.fit.identifiability import (
    Resolution,
    correlation_of,
    determine,
    intervals,
    steadied,
)
from dap3d_core.study.fit.interpolation import MOST_INSTANTS, Sampling, common_step
from dap3d_core.study.fit.jacobian import Differences, Predictor
from dap3d_core.study.fit.measured_data import Measured, read_measured
from dap3d_core.study.outputs import Output
from dap3d_core.study.parameters import with_values
from dap3d_core.study.study import Ensemble, Study

Floats = NDArray[np.float64]
Announce = Callable[[str], None]
#: Called as progress(iteration, cost) when the derivatives are asked for.
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
#: A run reports at least so often, that its curves can be drawn.
PARTS = 100
#: Errors of the spline above this, over the size of an output, are too large for good data.
GOOD = 1e-5
#: A fit explains little where it leaves more than this part of the squares of an output about its
#: mean; or where chi-square is so many standard deviations above 1.
LITTLE, LARGE = 0.5, 6.0
#: A bound that is nearer than this, in scales, is tried itself.
AT_BOUND = 1e-3


def fit(
    scene: Scene | str | os.PathLike[str],
    parameters: Any,
    measured: Any,
    outputs: Any = None,
    *,
    sigma: Any = None,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    integrator: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    correct: bool | None = None,
    project: bool | None = None,
    correct_metric: str | None = None,
    allow_code: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    announce: Announce | None = None,
) -> Fit:
    """Find numbers of a scene with which its run explains measured data best.

    The sum of the squares of (measured - predicted) / sigma is made least within the bounds, by a
    trust region; derivatives are central differences whose runs are one batch.

    Args:
        scene: a Scene, or what ``load`` takes.
        parameters: dotted name -> start, (start, low, high) or a ``Parameter``; names alone start
            from what the scene has. ``forces.spring.k``, ``points.A.sPp.x``.
        measured: {"t": times, "mass.r.x": values}, an xarray.Dataset, or the path of a CSV file
            with a header (units in brackets are left out). Any times from 0 in any order, s; SI
            units; NaN, in a file nothing, where a quantity was not measured.
        outputs: columns that are used, or column -> name of its quantity; by default all.
        sigma: standard deviation of the data: a number, or for each output one or (nt,). Without
            it all data are equally sure, and how sure is estimated from the residuals; outputs of
            different units need it.
        t_end, dt: of the runs, s; by default the last time measured, and a step of which the times
            are multiples. Where there is none, a spline goes between instants, which a note says.
        method, integrator, rtol, atol, step, correct, project, correct_metric, allow_code: as
            ``simulate`` has them; announce as well.
        threads: runs at once; by default one for each core.
        progress: called as progress(iteration, cost) with each new derivative.

    Raises:
        SceneError, PluginError: all that is wrong in the arguments, or in the scene.
        SimulationError: the run at the start fails, or all runs on both sides of a point.
    """
    task = _read(scene, parameters, measured, outputs, sigma, allow_code, announce, dict(
        t_end=t_end, dt=dt, method=method, integrator=integrator, rtol=rtol, atol=atol, step=step,
        correct=correct, project=project, correct_metric=correct_metric))  # fmt: skip
    predict = _predictor(task, threads, announce)
    search = _Search(task, predict, progress)
    return _told(task, search, *search.go())


@attrs.frozen(eq=False)
class _Task:
    """What is asked for, checked: the scene, the study of its runs, parameters, data."""

    scene: Scene
    study: Study
    parameters: list[Parameter]
    data: Measured
    dt: float | None

    @property
    def start(self) -> Floats:
        return np.array([p.start for p in self.parameters], dtype=np.float64)


def _read(
    scene: Any, parameters: Any, measured: Any, outputs: Any, sigma: Any,
    allow_code: bool, announce: Announce | None, settings: dict[str, Any],
) -> _Task:  # fmt: skip
    """All arguments; a SceneError tells all that is wrong with them."""
    own = scene.copy() if isinstance(scene, Scene) else load(scene)
    checked = check(own, load_registry(), allow_code=allow_code)
    numbers, found, mistakes = read_parameters(checked, parameters)
    data, quantities, wrong = read_measured(measured, outputs, sigma)
    mistakes += wrong
    t_end = settings["t_end"]
    given = {k: v for k, v in settings.items() if v is not None}
    simulation = attrs.evolve(own.simulation, **given)
    try:
        check_simulation(simulation, list(own.bodies))
    except SceneError as error:
        mistakes += error.mistakes
    kept = tuple(Output(label, of, "series") for label, of in quantities.items())
    mistakes += _of_outputs(own, kept, allow_code, announce, has_sigma=sigma is not None)
    if data is not None:
        last = float(data.t.max())
        if isinstance(t_end, (int, float)) and t_end < last:
            what = f"the run ends before the last measured time, {last:g} s"
            mistakes.append(Mistake("t_end", t_end, what))
        if data.count < len(found):
            what = f"{data.count} measured numbers cannot determine {len(found)} parameters"
            mistakes.append(Mistake("measured", MISSING, what))
        simulation = attrs.evolve(simulation, t_end=last if t_end is None else t_end)
    if mistakes or data is None:
        raise SceneError(mistakes)
    running = own.copy()
    running.simulation = simulation
    study = Study(running, tuple(n.name for n in numbers), kept, allow_code)
    return _Task(own, study, found, data, settings["dt"])


def _of_outputs(
    scene: Scene,
    outputs: tuple[Output, ...],
    allow_code: bool,
    announce: Announce | None,
    *,
    has_sigma: bool,
) -> list[Mistake]:
    """What is wrong with the quantities that were measured."""
    probed = scene.copy()
    probed.simulation = attrs.evolve(probed.simulation, t_end=1.0, dt=1.0)
    try:
        ensemble = Ensemble(Study(probed, (), outputs, allow_code), announce)
    except SceneError as error:
        return [attrs.evolve(m, key="measured" if m.key == "outputs" else m.key)
                for m in error.mistakes]  # fmt: skip
    whole = {output.name for output in outputs} - {output.name for output in ensemble.outputs}
    found = [Mistake("measured", name, "a column is one number: name a component of this vector",
                     f"{next(o.of for o in outputs if o.name == name)}.x")
             for name in sorted(whole)]  # fmt: skip
    units = sorted(set(ensemble.units.values()))
    if not found and len(units) > 1 and not has_sigma:
        what = f"outputs in {', '.join(units)} are weighed by their standard deviations"
        remedy = "give sigma, a number for each output"
        found.append(Mistake("sigma", MISSING, what, remedy=remedy))
    return found


def _predictor(task: _Task, threads: int | None, announce: Announce | None) -> Predictor:
    """What runs the scene, reporting at the measured times, or finely enough between them.

    Raises:
        SimulationError: the run at the start fails.
    """
    t, last = task.data.t, task.study.scene.simulation.t_end or 0.0
    common = common_step(np.append(t, last))
    dt = task.dt or (common / -(-PARTS // round(last / common)) if common else last / PARTS) or None
    while True:
        scene = task.study.scene.copy()
        scene.simulation = attrs.evolve(scene.simulation, dt=dt)
        ensemble = Ensemble(attrs.evolve(task.study, scene=scene), announce=announce)
        predict = Predictor(ensemble, task.data, Sampling.of(ensemble.times, t), threads)
        series = predict.series(task.start[None])
        if any(np.isnan(v).any() for v in series.values()):
            values = zip(task.study.names, task.start, strict=True)
            where = ", ".join(f"{name} = {value:g}" for name, value in values)
            raise SimulationError(f"the run at the start of the fit, {where}, fails: "
                                  f"{predict.note or 'it does not reach the data'}")  # fmt: skip
        fine = max(_blur(predict.sampling, v[0]) for v in series.values()) <= scene.simulation.rtol
        if task.dt or fine or last / (dt or last) * 2 > MOST_INSTANTS:
            return predict
        dt = (dt or last) / 2.0


def _blur(sampling: Sampling, series: Floats) -> float:
    """The error of the interpolation over the size of a series."""
    size = float(np.ptp(series))
    error = sampling.error(series)
    return error / size if size else 0.0


class _Search:
    """The way of ``least_squares``, in parameters over their scales.

    Attributes:
        predict, differences: what runs; how derivatives are made.
        data: (m,) weighted.
        iterations: how often derivatives were asked for.
    """

    def __init__(self, task: _Task, predict: Predictor, progress: Progress | None) -> None:
        self.task, self.predict, self.progress = task, predict, progress
        rtol = task.study.scene.simulation.rtol
        self.differences = Differences.of(predict, task.parameters, rtol)
        self.data = task.data.weighted(task.data.values)
        self.resolution = Resolution.of(rtol, self.data)
        self.iterations = 0
        self._known: dict[bytes, Floats] = {}
        self._slopes: Floats | None = None
        self._largest = 0.0

    def go(self) -> tuple[Floats, str, bool]:
        """The best parameters, why the search ended, and whether it came to an end."""
        from scipy.optimize import least_squares

        of = self.differences
        found = least_squares(
            lambda z: np.append(self._residual(z * of.scale), np.zeros(len(z))),
            self.task.start / of.scale,
            jac=lambda z: np.vstack(self._steadied(z * of.scale)),
            bounds=(of.low / of.scale, of.high / of.scale),
            method="trf", ftol=FTOL, xtol=XTOL, gtol=None,
        )  # fmt: skip
        x = self._at_bounds(np.clip(found.x * of.scale, of.low, of.high))
        return x, ENDS[found.status], found.status > 0

    def predicted(self, x: Floats) -> Floats:
        """(m,) predictions at a point; NaN where its run fails."""
        key = x.tobytes()
        if key not in self._known:
            self._known[key] = self.predict(x[None])[0]
        return self._known[key]

    def _residual(self, x: Floats) -> Floats:
        """Predictions less data; of a run that fails so large that the point is not taken."""
        residual = self.predicted(x) - self.data
        if np.isfinite(residual).all():
            self._largest = max(self._largest, float(np.linalg.norm(residual)))
            return np.asarray(residual)
        return np.full(len(residual), 10.0 * self._largest + 1.0)

    def _steadied(self, x: Floats) -> tuple[Floats, Floats]:
        """Derivatives over the scales, and what holds parameters that they do not determine."""
        self.iterations += 1
        base = self.predicted(x)
        self._known = {x.tobytes(): base}  # points that lie behind are not asked for again
        if self.progress is not None:
            self.progress(self.iterations, 0.5 * float(np.sum((base - self.data) ** 2)))
        steps = self.differences.steps(x, base, self._slopes)
        self._slopes = self.differences(x, base, steps)
        return steadied(self._slopes * self.differences.scale, self.resolution)

    def _at_bounds(self, x: Floats) -> Floats:
        """The point with parameters beside a bound on it, where that is no worse."""
        of = self.differences
        for bound in (of.low, of.high):
            for j in np.flatnonzero(np.abs(x - bound) < AT_BOUND * of.scale):
                there = x.copy()
                there[j] = bound[j]
                before, after = (np.sum(self._residual(p) ** 2) for p in (x, there))
                if after <= before * (1.0 + FTOL):
                    x = there
        return x

    def final(self, x: Floats) -> tuple[Floats, Floats]:
        """Derivatives at the optimum from two lengths of steps, and how wrong one alone is."""
        base = self.predicted(x)
        short = self.differences.steps(x, base, self._slopes)
        one, two = (self.differences(x, base, f * short) for f in (1.0, 2.0))
        return (4.0 * one - two) / 3.0, one - two


def _told(task: _Task, search: _Search, x: Floats, message: str, converged: bool) -> Fit:
    """What came of a search."""
    data, of, predict = task.data, search.differences, search.predict
    base = search.predicted(x)
    jacobian, error = search.final(x)
    held = (x <= of.low) | (x >= of.high)
    said = determine(of.names, x, of.scale, jacobian, error, held, search.resolution)
    cost = 0.5 * float(np.sum((base - search.data) ** 2))
    degrees = data.count - said.rank
    covariance, interval = intervals(said, x, cost, degrees, known=bool(data.sigma))
    result = predict.ensemble.result(x.tolist())
    series = {label: result.quantity(name).values for label, name in data.quantities.items()}
    fitted = {label: predict.sampling(values) for label, values in series.items()}
    blur = max(_blur(predict.sampling, values) for values in series.values())
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
            *said.words,
            *_misfit(task.data, fitted, cost, degrees),
            *_notes(task, search, x, degrees, blur),
        ),
        scene=with_values(task.scene, predict.ensemble.numbers, x.tolist()),
        result=result,
    )


def _misfit(data: Measured, fitted: dict[str, Floats], cost: float, degrees: int) -> Iterator[str]:
    """What is to be said of a run that does not explain the data."""
    remedy = "the scene lacks something, or the search began too far away"
    chi_square = 2.0 * cost / degrees if degrees else 1.0
    if data.sigma and chi_square > 1.0 + LARGE * np.sqrt(2.0 / degrees):
        yield f"residuals are larger than sigma, chi-square is {chi_square:.3g}: {remedy}"
        return
    for label, values in data.values.items():
        there = np.isfinite(values)
        if there.any():
            left = np.sum((values - fitted[label])[there] ** 2)
            if left > LITTLE * np.sum((values[there] - values[there].mean()) ** 2) > 0.0:
                yield (f"less than half of the variation of {label} is explained: {remedy}, or it "
                       "is noise")  # fmt: skip


def _notes(task: _Task, search: _Search, x: Floats, degrees: int, blur: float) -> Iterator[str]:
    """What is to be known besides what the data do not determine."""
    of = search.differences
    for name, value, low, high in zip(of.names, x, of.low, of.high, strict=True):
        if value in (low, high):
            side = "lower" if value == low else "upper"
            yield (f"{name} stands at its {side} bound, {value:g}; the intervals of the others "
                   "take it as known")  # fmt: skip
    if not degrees and not task.data.sigma:
        yield "there are as many measured numbers as parameters: no interval is known"
    if search.predict.sampling.places is None:
        told = "whose error is not known" if np.isinf(blur) else (
            f"with an error of up to {blur:.1g} of the size of an output")  # fmt: skip
        remedy = "; a smaller dt, or none, would be better" if blur > GOOD else ""
        yield f"between reported instants goes a spline of degree 5, {told}{remedy}"
