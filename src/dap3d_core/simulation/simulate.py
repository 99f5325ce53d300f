"""The loop of a run: initial conditions, method, integration in chunks, and what is left behind."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.friction import PASSES
from dap3d_core.integrators import METHODS, Integration, Status
from dap3d_core.kernels.cache import driver_is_cached
from dap3d_core.result import Record, Result, ResultWriter, Statistics, check_target
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError, Simulation, check_simulation
from dap3d_core.simulation.compiled import CompiledModel
from dap3d_core.simulation.elsewhere import redundancy_elsewhere
from dap3d_core.simulation.errors import RedundantError, SimulationError
from dap3d_core.simulation.implicit import implicit_integration
from dap3d_core.simulation.initial import correction_notes, violation
from dap3d_core.simulation.offender import find_offender, find_switch
from dap3d_core.simulation.redundancy import Redundancy
from dap3d_core.simulation.second_run import Again, add_error

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]

#: Seconds that a compiled chunk should take: Ctrl-C and the progress bar wait for its end.
CHUNK_SECONDS = 0.1
#: A run that lasts longer writes its rows to disk as they come, so that it may be killed.
SHORT_SECONDS = 1.0
#: Numbers that wait in the row buffer at most.
BUFFER_NUMBERS = 4_000_000
#: A start this far off the constraints, left uncorrected, gets a note.
OFF_CONSTRAINTS = 1e-6


def simulate(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    integrator: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    step: float | None = None,
    correct: bool | None = None,
    project: bool | None = None,
    progress: Progress | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    output: str | os.PathLike[str] | None = None,
    force: bool = False,
    correct_metric: str | None = None,
    estimate_error: bool = False,
) -> Result:
    """Simulate a scene from t = 0 to t_end.

    What is left out is taken from the scene's [simulation], and there by default method "auto",
    integrator "dop853", rtol 1e-8, atol 1e-10, correct and project on.

    Args:
        scene: a Scene, what ``load`` takes, or a model that was compiled before.
        t_end: final time, s; 0 solves once at t = 0.
        dt: reporting step, s; t_end / 100 when nobody gives one. When it does not divide t_end,
            t_end is reported too.
        method: "auto", "unconstrained", "standard", "penalty" or "lsq".
        integrator: "dopri5", "dop853", "radau" (implicit) or "rk4" (which needs ``step``).
        rtol, atol: tolerances of the step's error.
        step: fixed step, s, without error control.
        correct: bring the initial conditions onto the constraints first.
        project: bring every accepted step and reported state onto the constraints.
        progress: called as progress(t, t_end) between chunks of some 0.1 s.
        allow_code, announce: as ``compile`` has them.
        output: result file to write. While a run of more than a second goes on its rows stand in
            ``NAME.part``, synced after every chunk: readable also when the run is killed.
        force: whether an existing output is overwritten.
        correct_metric: "unit" or "mass": the least correction in m and rad, or by masses.
        estimate_error: estimate ``result.error`` by a second, finer run (second_run.py).

    Returns:
        the result. Any exception that ends the integration carries what was computed until then as
        ``.result``; KeyboardInterrupt and exceptions of ``progress`` come out as they are.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; settings or an output that won't do.
        RedundantError, AssemblyError: dependent constraints; positions that cannot be assembled.
        SimulationError: the run stopped; ``.result`` is what was computed.
    """
    compiled = _compiled(scene, method, allow_code, announce)
    settings = _settings(compiled, t_end=t_end, dt=dt, method=method, integrator=integrator,
                         rtol=rtol, atol=atol, step=step, correct=correct, project=project,
                         correct_metric=correct_metric)  # fmt: skip
    run = _Run(compiled, settings, announce)
    return run.go(progress, output, force=force, estimate_error=estimate_error)


def _settings(compiled: CompiledModel, **asked: Any) -> Simulation:
    """The scene's settings with what is given (not None) in their places.

    Raises:
        SceneError: they make no sense.
    """
    given = {k: v for k, v in asked.items() if v is not None}
    settings = attrs.evolve(compiled.scene.simulation, **given)
    check_simulation(settings, compiled.model.body_names)
    return settings


def _compiled(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    method: str | None,
    allow_code: bool,
    announce: Callable[[str], None] | None,
) -> CompiledModel:
    """The compiled model of a scene; one that was compiled before must have the method asked for.

    Raises:
        SimulationError: it has another.
    """
    if not isinstance(scene, CompiledModel):
        return CompiledModel(scene, method=method, allow_code=allow_code, announce=announce)
    if method is not None and scene.choice(method)[0] != scene.method:
        words = f"the model was compiled for method {scene.method}; compile it for {method}"
        raise SimulationError(words)
    return scene


def report_times(t_end: float | None, dt: float | None) -> Floats:
    """Reporting times (nt,): multiples of dt, and t_end where it is none of them.

    Raises:
        SceneError: no final time.
    """
    if t_end is None:
        remedy = "give t_end in the scene's [simulation], or --t-end"
        raise SceneError([Mistake("t_end", MISSING, "a run needs a final time", remedy=remedy)])
    if t_end == 0.0:
        return np.zeros(1)
    dt = t_end / 100.0 if dt is None else dt
    count = int(np.floor(t_end / dt * (1.0 + 1e-12) + 1e-9))
    times = dt * np.arange(count + 1, dtype=np.float64)
    if t_end - times[-1] > 1e-9 * dt:
        return np.append(times, t_end)
    times[-1] = t_end
    return times


class _Run:
    """One run of a compiled model."""

    def __init__(
        self, compiled: CompiledModel, settings: Any, announce: Callable[[str], None] | None
    ) -> None:
        self.announce = announce
        self.compiled = compiled
        self.machine = compiled.machine
        self.settings = settings
        self.times = report_times(settings.t_end, settings.dt)
        self.notes = [*compiled.notes, f"method {compiled.method}: {compiled.reason}"]
        self.rows: list[Floats] = []
        self.output: Path | None = None
        self.force = False
        self.writer: ResultWriter | None = None
        self.started = self.compile_time = 0.0
        self.rank = 0
        self.first_step: float | None = None

    def go(
        self,
        progress: Progress | None,
        output: str | os.PathLike[str] | None,
        *,
        force: bool,
        estimate_error: bool = False,
    ) -> Result:
        self.started = time.perf_counter()
        u0 = self._start()
        integration = self._integration(u0)
        self._compile(integration)
        if output is not None:
            self.output = check_target(output, force)
            self.force = force
        try:
            self._advance(integration, progress)
        except BaseException as error:
            if isinstance(error, OSError):  # the disk: what is there stays as it is
                raise
            self._take_rows(integration)
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "stopped"
            error.result = self._kept(integration, status)  # type: ignore[attr-defined]
            raise
        if integration.status is not Status.FINISHED:
            raise self._stopped(integration)
        result = self._kept(integration, "done")
        assert result is not None
        if estimate_error:
            add_error(result, self.settings, self._again(progress), output)
        return result

    def _again(self, progress: Progress | None) -> Again:
        """Makes a run with other settings and another first step, in memory."""

        def again(settings: Simulation, first_step: float | None) -> Result:
            run = _Run(self.compiled, settings, self.announce)
            run.first_step = first_step
            return run.go(progress, None, force=False)

        return again

    def _start(self) -> Floats:
        """The initial state, corrected if asked for; its rank must suit the method."""
        settings, scene = self.settings, self.compiled.scene
        metric = str(settings.correct_metric)
        start = self.compiled.start(bool(settings.correct), settings.hold, metric)
        if start.initial is not None:
            self.notes += correction_notes(start.initial, self.machine, scene)
        elif max(violation(self.machine, start.u)) > OFF_CONSTRAINTS:
            position, velocity = violation(self.machine, start.u)
            self.notes.append(
                f"the initial conditions violate the constraints (position {position:.2g}, "
                f"velocity {velocity:.2g}) and were not corrected; switch correct on"
            )
        self.rank = start.redundancy.rank.rank
        if start.redundancy.rank.redundant:
            self._judge_redundancy(start.redundancy, start.u)
        return start.u

    def _judge_redundancy(self, redundancy: Redundancy, u: Floats) -> None:
        """Refuse redundant rows, or note what they leave open."""
        words = redundancy.describe()
        if self.compiled.method == "standard":
            elsewhere = redundancy_elsewhere(self.machine, u, redundancy).describe(redundancy)
            raise RedundantError(
                f"{words}; {elsewhere}. The standard method needs independent rows"
            )
        if redundancy.contradictions:
            raise RedundantError(f"{words}. No motion satisfies them all")
        least = " (reported are those of least |lambda|)" if self.compiled.method == "lsq" else ""
        self.notes.append(
            f"{words}. Accelerations are unique; reactions in these joints are not{least}"
        )

    def _integration(self, u0: Floats) -> Integration:
        machine, settings = self.machine, self.settings
        machine.watch_pivots(0.0, u0)
        machine.start(0.0, u0)
        y0 = machine.integrated(u0)
        width = 1 + len(y0) + machine.report_size
        options: dict[str, Any] = dict(
            rtol=settings.rtol,
            atol=settings.atol,
            step=settings.step,
            first_step=self.first_step,
            project_on=settings.project,
            error_size=len(y0) - 1,  # the work does not steer the step
            report_size=machine.report_size,
            buffer_rows=max(1, min(len(self.times), BUFFER_NUMBERS // width)),
        )
        try:
            if settings.integrator == "radau":
                return implicit_integration(machine, y0, self.times, options)
            return Integration(
                METHODS[settings.integrator],
                machine.functions,
                machine.system,
                machine.loops,
                y0,
                self.times,
                length_count=machine.length_count,
                watched=machine.watched,
                **options,
            )
        except ValueError as error:
            raise SceneError([Mistake("step", settings.step, str(error))]) from error

    def _compile(self, integration: Integration) -> None:
        """Compile the integrator before the clock of the run goes on."""
        if self.announce is not None and not driver_is_cached("integrators"):
            self.announce("the integrator")
        before = time.perf_counter()
        integration.compile()
        self.compile_time = time.perf_counter() - before
        self.started += self.compile_time

    def _advance(self, integration: Integration, progress: Progress | None) -> None:
        """Advance in chunks whose length in right-hand sides follows the clock."""
        budget, t_end = 100, float(self.times[-1])
        while integration.status is Status.RUNNING:
            before, clock = integration.statistics.rhs, time.perf_counter()
            integration.advance(budget)
            self._take_rows(integration)
            done, seconds = integration.statistics.rhs - before, time.perf_counter() - clock
            if progress is not None:
                progress(integration.t, t_end)
            if done and seconds > 0.0:
                budget = int(min(max(1.0, done * CHUNK_SECONDS / seconds), 4.0 * budget, 1e9))

    def _take_rows(self, integration: Integration) -> None:
        """Take what was reported since the last chunk; in a long run, also onto disk."""
        rows = integration.rows()
        if not len(rows):
            return
        self.rows.append(rows)
        if self.writer is not None:
            self.writer.append(rows)
        elif self.output and time.perf_counter() - self.started > SHORT_SECONDS:
            record, model = self._record(integration, "done"), self.machine.model
            self.writer = ResultWriter(self.output, model, record, force=self.force)
            self.writer.append(np.concatenate(self.rows))

    def _stopped(self, integration: Integration) -> SimulationError:
        """Why the integration ended early, with what was computed."""
        t = integration.t
        t_stop = integration.t_stop if integration.t_stop is not None else t
        culprit = find_offender(self.machine, t, integration.y, t_stop)
        reason = {
            Status.STEP_FLOOR: "the step size fell to the resolution of time",
            Status.NOT_FINITE: "a number became infinite or not a number",
            Status.PROJECTION_FAILED: "the state could not be projected onto the constraints",
            Status.SWITCHED: "",
        }[integration.status]
        if integration.status is Status.SWITCHED:
            culprit = find_switch(self.machine, t, integration.y)
        message = f"the run stopped at t = {t:.9g} s{': ' if reason else ''}{reason}"
        if culprit:
            message += f": {culprit}"
        self.notes.append(message)
        return SimulationError(message, self._kept(integration, "stopped"))

    def _kept(self, integration: Integration, status: str) -> Result | None:
        """The result of what was computed, whole on disk if asked for; None where nothing was."""
        if not self.rows:
            return None
        if count := self.machine.unsettled:
            self.notes.append(
                f"friction: the multipliers did not settle in {PASSES} passes, {count} times of "
                f"{integration.statistics.rhs} or more; the last ones were used. Motion there is "
                "uncertain: a high mu may lock the joint by itself"
            )
        record = self._record(integration, status)
        result = Result.of_run(
            self.machine.model, np.concatenate(self.rows), record, lambda: self.machine
        )
        if self.writer is not None:
            self.writer.leave()
        if self.output is not None:
            result.save(self.output, force=self.force)
        if self.writer is not None:
            self.writer.part.unlink(missing_ok=True)
        return result

    def _record(self, integration: Integration, status: str) -> Record:
        counts = integration.statistics
        return Record(
            scene_text=self.compiled.scene_text,
            stats=Statistics(
                steps=counts.steps,
                rejected=counts.rejected,
                rhs=counts.rhs,
                projections=counts.projections,
                wall_time_s=time.perf_counter() - self.started,
                compile_time_s=self.compiled.compile_time + self.compile_time,
            ),
            status=status,
            method=self.compiled.method,
            integrator=self.settings.integrator,
            notes=self.notes,
            settings={
                "t_end": float(self.times[-1]),
                "dt": self.settings.dt,
                "rtol": self.settings.rtol,
                "atol": self.settings.atol,
                "step": self.settings.step,
                "project": bool(self.settings.project),
                "correct": bool(self.settings.correct),
                "rank": self.rank,
                "conservative": self.compiled.is_conservative,
                "correct_metric": str(self.settings.correct_metric),
            },
        )
