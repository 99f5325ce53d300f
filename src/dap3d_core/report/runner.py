"""Makes a report: the reference, a first run of each rung, then timings in turns."""

import copy
import math
import os
import statistics
import time
from collections.abc import Iterator, Sequence
from typing import Any

import attrs

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.integrators import INTEGRATORS
from dap3d_core.registry.arguments import checked
from dap3d_core.report.measurement import (
    Announce,
    Bench,
    Failed,
    MeasuredRun,
    Progress,
    measures_of,
)
from dap3d_core.report.reference import (
    PARTED,
    Reference,
    final_position_error,
    find_reference,
    trajectory_error,
)
from dap3d_core.report.report import Report, front
from dap3d_core.report.settings_ladder import (
    ADAPTIVE,
    MEASURED,
    QUICK_TOLERANCES,
    TOLERANCES,
    Setting,
    chosen,
    controlled,
    ladder,
    ladder_of_steps,
)
from dap3d_core.result import Computed, Result
from dap3d_core.scene import Mistake, Scene, SceneError, check_simulation, load
from dap3d_core.simulation import report_times

#: Time limit of all timings of one rung, s: longer runs are repeated less.
CAP_S = 5.0
#: Time limit of a run, s.
LIMIT_S = 30.0
#: Expected duration of a rung, relative to the previous one.
GROWTH = 1.6
_STEP_LEFT_OUT = (
    "the scene's step of {:g} s is left out where the integrator chooses its step; take it out of "
    "the scene to run so"
)


@checked
def report(
    scene: Scene | str | os.PathLike[str],
    *,
    target_error: float | None = None,
    methods: Sequence[str] | None = None,
    integrators: Sequence[str] | None = None,
    tolerances: Sequence[float] | None = None,
    steps: Sequence[float] | None = None,
    repeat: int | None = None,
    quick: bool = False,
    t_end: float | None = None,
    dt: float | None = None,
    correct: bool | None = None,
    project: bool | None = None,
    limit_s: float = LIMIT_S,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Announce | None = None,
) -> Report:
    """Measure speed against error of every method and integrator that fits a scene.

    Args:
        scene: a Scene, or what ``load`` takes; as it is, but for its step, method and integrator.
        target_error: the error e (reference.py) that ``Report.recommended`` takes by default.
        methods, integrators: the ones to measure; by default all.
        tolerances: ladder of rtol (atol = rtol / 100); by default 1e-3, 1e-4 ... 1e-12.
        steps: ladder of fixed steps, s; by default from the mean step of a coarse run down.
        repeat: timings of each rung, 5 by default; the median is reported.
        quick: three rungs, timed once, unless the arguments above are given.
        t_end, dt, correct, project: as of ``simulate``.
        limit_s: wall time, s, after which a run is ended; it is then listed with this reason.
        progress: called as progress(done, total, words), s of work.
        allow_code, announce: as of ``compile``.

    Returns:
        the report. A run that fails is listed with its reason. An exception from outside (Ctrl-C,
        an exception of ``progress``) carries the measurements so far as ``.report``.

    Raises:
        SceneError, PluginError: the scene or a setting has mistakes.
        AssemblyError: the initial positions cannot be assembled.
        SimulationError: no run was completed, so that there is no reference.
        ValueError: ``repeat``, ``limit_s`` or ``target_error`` is not positive.
    """
    repeat = (1 if quick else 5) if repeat is None else repeat
    for name, value in dict(repeat=repeat, limit_s=limit_s, target_error=target_error).items():
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{name} is {value}; it must be a positive number")
    given = scene if isinstance(scene, Scene) else load(scene)
    requested = dict(t_end=t_end, dt=dt, correct=correct, project=project)
    used = _prepared(given, requested, methods, integrators, tolerances, steps)
    bench = Bench(used, limit_s=limit_s, allow_code=allow_code, announce=announce)
    rtols = tolerances or (QUICK_TOLERANCES if quick else TOLERANCES)
    maker = _Measurement(bench, chosen(methods, tuple(FORMULATIONS)), repeat, progress)
    if given.simulation.step is not None:
        maker.notes.append(_STEP_LEFT_OUT.format(given.simulation.step))
    return maker.make(chosen(integrators, MEASURED), rtols, steps, target_error, quick=quick)


def _prepared(
    scene: Scene,
    requested: dict[str, Any],
    methods: Sequence[str] | None,
    integrators: Sequence[str] | None,
    tolerances: Sequence[float] | None,
    steps: Sequence[float] | None,
) -> Scene:
    """A copy of the scene with the requested settings, all of them checked."""
    copied = copy.deepcopy(scene)
    changes = {name: value for name, value in requested.items() if value is not None}
    changes |= {"step": None, "integrator": ADAPTIVE[0], "method": "auto"}
    settings = attrs.evolve(scene.simulation, **changes)
    fixed_step = {name for name, one in INTEGRATORS.items() if not one.adaptive}
    variants: list[dict[str, Any]] = [{}]
    variants += [{"method": name} for name in methods or ()]
    variants += [
        {"integrator": name, "step": 1.0 if name in fixed_step else None}
        for name in integrators or ()
    ]
    variants += [{"rtol": rtol} for rtol in tolerances or ()]
    variants += [{"step": step} for step in steps or ()]
    for variant in variants:
        check_simulation(attrs.evolve(settings, **variant), scene.bodies)
    report_times(settings.t_end, settings.dt)  # refuses a scene without a final time
    if settings.t_end == 0.0:
        remedy = "give a final time above zero"
        raise SceneError([Mistake("t_end", 0.0, "there is no motion to measure", remedy=remedy)])
    copied.simulation = settings
    return copied


@attrs.define(eq=False)
class _Rung:
    """A setting with its measures, or the reason of its failure, and its timings, s."""

    setting: Setting
    measures: dict[str, Any] = attrs.Factory(dict)
    failed: str = ""
    times: list[float] = attrs.Factory(list)

    def timings(self, repeat: int) -> int:
        """Number of timings to take."""
        if not self.measures:
            return len(self.times)
        return max(1, min(repeat, int(CAP_S / max(self.times[0], 1e-9))))

    def run(self, uncertainty: float | None) -> MeasuredRun:
        """The completed run."""
        return MeasuredRun(
            setting=self.setting,
            time_s=statistics.median(self.times),
            time_min_s=min(self.times),
            time_max_s=max(self.times),
            repeats=len(self.times),
            below_uncertainty=uncertainty is not None and self.measures["error"] < uncertainty,
            **self.measures,
        )


class _Measurement:
    """Measures one report."""

    def __init__(
        self, bench: Bench, methods: tuple[str, ...], repeat: int, progress: Progress | None
    ) -> None:
        self.bench, self.methods, self.repeat, self.progress = bench, methods, repeat, progress
        self.series: list[list[_Rung]] = []
        self.notes: list[str] = []
        self.begun = time.perf_counter()

    def make(
        self,
        integrators: tuple[str, ...],
        rtols: Sequence[float],
        steps: Sequence[float] | None,
        target_error: float | None,
        *,
        quick: bool,
    ) -> Report:
        settings = self.bench.scene.simulation
        times = report_times(settings.t_end, settings.dt)
        t_end, dt = float(times[-1]), float(times[1] - times[0]) if len(times) > 1 else 0.0
        count = self._coarse_steps() if steps is None else 0
        rungs = steps or ladder_of_steps(t_end, dt or 1.0, count, quick=quick)
        reference = find_reference(self.bench, self._fine_steps(rungs), self._tick)
        header = dict(
            scene=self.bench.scene.name or "", t_end=t_end, dt=dt, reference=reference,
            target_error=target_error,
        )  # fmt: skip
        try:
            for method in (name for name in self.methods if name in self.bench.models):
                for integrator in integrators:
                    every = ladder(method, integrator, rtols, rungs)
                    if every:
                        self.series.append([_Rung(setting) for setting in every])
                    else:
                        self.notes.append(f"{integrator} does not fit method {method}")
            self._measure(reference)
            self._time()
        except BaseException as error:
            Computed(report=self._report(header, "interrupted")).attach(error)
            raise
        return self._report(header, "done")

    def _coarse_steps(self) -> int:
        """Steps of the first completed run at the coarsest tolerance."""
        for method in tuple(self.bench.models):
            for integrator in ADAPTIVE:
                if method in self.bench.models:
                    setting = controlled(method, integrator, TOLERANCES[0])
                    self._tick(f"looking for a step: {setting}")
                    result = self.bench.run(setting, lambda: None)
                    if isinstance(result, Result):
                        return result.stats.steps
        return 100

    def _fine_steps(self, steps: Sequence[float]) -> list[Setting]:
        """Fixed steps below the ladder, for a reference where no tolerance can be met."""
        names = [name for name in MEASURED if not INTEGRATORS[name].adaptive]
        return [
            Setting(method, name, step=min(steps) / 2.0)
            for name in names
            for method in self.bench.models
        ]

    def _in_turns(self) -> Iterator[tuple[list[_Rung], int]]:
        """All rungs, by series and index, the coarse ones of every series first."""
        for k in range(max(map(len, self.series), default=0)):
            for series in self.series:
                if k < len(series):
                    yield series, k

    def _measure(self, reference: Reference) -> None:
        """Run each rung once for its errors, each series after a run that is not timed."""
        for series, k in self._in_turns():
            rung = series[k]
            if rung.setting.method not in self.bench.models:
                rung.failed = "its method was refused"
            elif k and series[k - 1].failed.startswith(("ended after", "left out")):
                rung.failed = f"left out: {series[k - 1].setting.control} took too long"
            else:
                if not k:
                    self._once(rung.setting)
                result = self._once(rung.setting)
                if isinstance(result, str):
                    rung.failed = result
                    continue
                rung.times.append(result.stats.wall_time_s)
                u = result.u[: len(reference.t)]
                rung.measures = measures_of(result) | {
                    "error": trajectory_error(u, reference.u),
                    "final_position_error": final_position_error(u, reference.u),
                }

    def _time(self) -> None:
        """Further timings in turns, so that the noise of the machine affects all alike."""
        for number in range(1, self.repeat):
            for series, k in self._in_turns():
                rung = series[k]
                if number < rung.timings(self.repeat):
                    result = self._once(rung.setting)
                    if isinstance(result, Result):
                        rung.times.append(result.stats.wall_time_s)

    def _once(self, setting: Setting) -> Result | str:
        activity = str(setting)
        self._tick(activity)
        return self.bench.run(setting, lambda: self._tick(activity))

    def _tick(self, activity: str) -> None:
        if self.progress is not None:
            done = time.perf_counter() - self.begun
            self.progress(done, done + self._remaining(), activity)

    def _remaining(self) -> float:
        """Expected remaining work, s."""
        remaining = 0.0
        for series in self.series:
            before = 0.0
            for rung in series:
                if rung.times:
                    before = rung.times[0]
                    remaining += before * max(rung.timings(self.repeat) - len(rung.times), 0)
                elif not rung.failed:
                    before = min(before * GROWTH, self.bench.limit_s)
                    remaining += before * min(self.repeat, max(1.0, CAP_S / max(before, 1e-9)))
        return remaining

    def _report(self, header: dict[str, Any], status: str) -> Report:
        """The report of the measurements so far."""
        every = [rung for series in self.series for rung in series]
        uncertainty = header["reference"].uncertainty
        runs = [rung.run(uncertainty) for rung in every if rung.measures]
        best = front(runs, uncertainty)
        if header["reference"].meaningless_from is not None and all(r.error > PARTED for r in runs):
            self.notes.append(
                "no setting follows the reference up to there: a shorter final time shows more"
            )
        refused = {each.method for each in self.bench.refused}
        failed = [
            Failed(rung.setting, rung.failed)
            for rung in every
            if rung.failed and rung.setting.method not in refused
        ]
        if any(run.repeats < self.repeat for run in runs):
            self.notes.append(
                f"runs of more than {CAP_S / self.repeat:.3g} s, or cut short, were timed less "
                f"than {self.repeat} times: see repeats"
            )
        return Report(
            runs=tuple(attrs.evolve(run, on_front=k in best) for k, run in enumerate(runs)),
            failed=tuple(failed),
            refused=tuple(each for each in self.bench.refused if each.method in self.methods),
            status=status,
            notes=tuple(self.notes),
            **header,
        )
