"""The loop of a run: initial conditions, method, integration in chunks, and what is left behind."""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.friction import PASSES
from dap3d_core.integrators import METHODS, Integration, Status, make_adams
from dap3d_core.integrators.integration import Statistics as Counts
from dap3d_core.kernels.cache import driver_is_cached
from dap3d_core.result import Occurrence, Record, Result, Statistics
from dap3d_core.scene import Mistake, Scene, SceneError, Simulation
from dap3d_core.simulation.asked import compiled_for, refuse_adams, report_times, settings_of
from dap3d_core.simulation.compiled import CompiledModel
from dap3d_core.simulation.elsewhere import redundancy_elsewhere
from dap3d_core.simulation.ending import event_notes, occurrences, why_stopped
from dap3d_core.simulation.errors import RedundantError, SimulationError
from dap3d_core.simulation.event import Event
from dap3d_core.simulation.implicit import (
    EXPLICIT,
    implicit_integration,
    implicit_rest,
    stiffness_notes,
)
from dap3d_core.simulation.initial import correction_notes, violation
from dap3d_core.simulation.keeping import Keeper
from dap3d_core.simulation.redundancy import Redundancy
from dap3d_core.simulation.second_run import Again, add_error
from dap3d_core.simulation.standing import Observer, Standing
from dap3d_core.simulation.watcher import Watcher

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]

#: Seconds that a compiled chunk should take: Ctrl-C and the progress bar wait for its end.
CHUNK_SECONDS = 0.1
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
    events: Sequence[Event] = (),
    watch: Callable[[Standing], None] | None = None,
) -> Result:
    """Simulate a scene from t = 0 to t_end.

    What is left out is the scene's [simulation]'s, by default method "auto", integrator "dop853",
    rtol 1e-8, atol 1e-10, correct and project on.

    Args:
        scene: a Scene, what ``load`` takes, or a model that was compiled before.
        t_end: final time, s; 0 solves once at t = 0.
        dt: reporting step, s; by default t_end / 100. t_end is reported in any case.
        method: "auto", "unconstrained", "standard", "penalty" or "lsq".
        integrator: "dopri5", "dop853", "adams", "rk4" (needs ``step``), "radau" (implicit), "auto".
        rtol, atol, step: tolerances of the step's error; a fixed step, s, without error control.
        correct, project: bring the start, and then every state, onto the constraints.
        progress: called as progress(t, t_end) between chunks of some 0.1 s.
        allow_code, announce: as ``compile`` has them.
        output, force: file to write, and whether over an existing one. While a run of more than a
            second goes on its rows stand in ``NAME.part``, synced: readable also when it is killed.
        correct_metric: "unit" or "mass": the least correction in m and rad, or by masses.
        estimate_error: estimate ``result.error`` by a second, finer run.
        events: what to look out for (``Event``).
        watch: called between chunks with how the run stands: t, t_end, steps, step, energy drift.

    Returns:
        the result. Any exception that ends the integration carries what was computed until then as
        ``.result``; KeyboardInterrupt and those of ``progress``, ``watch`` come out as they are.

    Raises:
        SceneError, PluginError, ResultError: as ``compile``; settings or an output that won't do.
        RedundantError, AssemblyError: dependent constraints; positions that cannot be assembled.
        SimulationError: the run stopped; ``.result`` is what was computed.
    """
    compiled = compiled_for(scene, method, allow_code, announce)
    settings = settings_of(compiled, t_end=t_end, dt=dt, method=method, integrator=integrator,
                         rtol=rtol, atol=atol, step=step, correct=correct, project=project,
                         correct_metric=correct_metric)  # fmt: skip
    run = _Run(compiled, settings, announce, events, watch)
    return run.go(progress, output, force=force, estimate_error=estimate_error)


class _Run:
    """One run of a compiled model."""

    def __init__(
        self,
        compiled: CompiledModel,
        settings: Any,
        announce: Callable[[str], None] | None,
        events: Sequence[Event] = (),
        watch: Callable[[Standing], None] | None = None,
    ) -> None:
        self.announce = announce
        self.compiled = compiled
        self.machine = compiled.machine
        self.settings = settings
        self.times = report_times(settings.t_end, settings.dt)
        self.notes = [*compiled.notes, f"method {compiled.method}: {compiled.reason}"]
        self.keeper: Keeper | None = None
        self.started = self.compile_time = 0.0
        self.rank = 0
        self.first_step: float | None = None
        self.watcher = Watcher(compiled, events) if events else None
        self.watch, end = watch, float(self.times[-1])
        self.observer = None if watch is None else Observer(self.machine.model, end, watch)
        #: The integrations, one after the other: "auto" may take a second one.
        self.runs: list[Integration] = []
        self.options: dict[str, Any] = {}

    def go(
        self,
        progress: Progress | None,
        output: str | os.PathLike[str] | None,
        *,
        force: bool,
        estimate_error: bool = False,
    ) -> Result:
        self.started = time.perf_counter()
        integration = self._integration(self._start())
        if self.settings.integrator != "radau":  # which evaluates its stages otherwise
            integration.beside = self.machine.second_thread
        self._begin(integration)
        self.keeper = Keeper(self.machine, output, len(self.times) + 1, force=force)
        try:
            self._advance(progress)
            if self.runs[-1].status is Status.STIFF:
                self._begin(implicit_rest(self.machine, self.runs[-1], self.times, self.options))
                self._advance(progress)
        except BaseException as error:
            if isinstance(error, OSError):  # the disk: what is there stays as it is
                raise
            self._take_rows()
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "stopped"
            error.result = self._kept(status)  # type: ignore[attr-defined]
            raise
        finally:
            if self.watcher:
                self.watcher.numbers.put_back()
        ended = self.runs[-1].status
        if ended not in (Status.FINISHED, Status.ENDED):
            raise self._stopped()
        result = self._kept("done" if ended is Status.FINISHED else "stopped")
        assert result is not None
        if estimate_error:
            add_error(result, self.settings, self._again(progress), output)
        return result

    def _again(self, progress: Progress | None) -> Again:
        """Makes a run with other settings and another first step, in memory."""

        def again(settings: Simulation, first_step: float | None) -> Result:
            events = self.watcher.events if self.watcher else ()
            run = _Run(self.compiled, settings, self.announce, events, self.watch)
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
        self.options = options = dict(
            rtol=settings.rtol,
            atol=settings.atol,
            step=settings.step,
            first_step=self.first_step,
            project_on=settings.project,
            error_size=len(y0) - 1,  # the work does not steer the step
            report_size=machine.report_size,
            buffer_rows=max(1, min(len(self.times), BUFFER_NUMBERS // width)),
            ends=machine.ending,
        )
        try:
            if settings.integrator == "radau":
                return implicit_integration(machine, y0, self.times, options)
            options = options | {
                "length_count": machine.length_count,
                "watched": machine.counts_turns,
            }
            problem = machine.functions, machine.system, machine.loops, y0, self.times
            if settings.integrator == "adams":
                refuse_adams(machine)
                del options["ends"]
                return make_adams(*problem, **options)
            if settings.integrator == "auto":
                leave = machine.method != "penalty"  # which radau does not solve
                return Integration(METHODS[EXPLICIT], *problem, leave_stiff=leave, **options)
            return Integration(METHODS[settings.integrator], *problem, **options)
        except ValueError as error:
            raise SceneError([Mistake("step", settings.step, str(error))]) from error

    def _begin(self, integration: Integration) -> None:
        """Compile an integrator before the clock of the run goes on; it is the present one then."""
        if self.announce is not None and not driver_is_cached("integrators"):
            self.announce("the integrator")
        before = time.perf_counter()
        integration.compile()
        spent = time.perf_counter() - before
        self.compile_time += spent
        self.started += spent
        self.runs.append(integration)
        if self.observer is not None:
            self.observer.begin(integration)

    def _advance(self, progress: Progress | None) -> None:
        """Advance in chunks whose length in right-hand sides follows the clock."""
        integration = self.runs[-1]
        budget, t_end = 100, float(self.times[-1])
        while integration.status is Status.RUNNING:
            before, clock = integration.statistics.rhs, time.perf_counter()
            if self.watcher:
                self.watcher.advance(integration, budget)
            else:
                integration.advance(budget)
            self._take_rows()
            done, seconds = integration.statistics.rhs - before, time.perf_counter() - clock
            if progress is not None:
                progress(integration.t, t_end)
            if self.observer is not None:
                self.observer.look()
            if done and seconds > 0.0:
                budget = int(min(max(1.0, done * CHUNK_SECONDS / seconds), 4.0 * budget, 1e9))

    def _take_rows(self) -> None:
        """Take what was reported since the last chunk; in a long run, also onto disk."""
        if not self.runs:
            return
        rows = self.runs[-1].rows()
        if len(rows):
            assert self.keeper is not None
            self.keeper.take(rows, lambda: self._record("done"))

    def _stopped(self) -> SimulationError:
        """Why the integration ended early, with what was computed."""
        message = why_stopped(self.machine, self.runs[-1])
        self.notes.append(message)
        return SimulationError(message, self._kept("stopped"))

    def _kept(self, status: str) -> Result | None:
        """The result of what was computed, whole on disk if asked for; None where nothing was."""
        if self.keeper is None or not self.keeper.count:
            return None
        if count := self.machine.unsettled:
            self.notes.append(
                f"friction: the multipliers did not settle in {PASSES} passes, {count} times of "
                f"{self._statistics().rhs} or more; the last ones were used. Motion there is "
                "uncertain: a high mu may lock the joint by itself"
            )
        self.notes += event_notes(self.runs, self._events())
        self.notes += stiffness_notes(self.runs, self.settings.integrator)
        return self.keeper.result(self._record(status))

    def _events(self) -> list[Occurrence]:
        found = self.watcher.occurrences if self.watcher else []
        return occurrences(self.machine, self.runs, found)

    def _statistics(self) -> Counts:
        """What all integrations have done together."""
        return Counts(*(sum(n) for n in zip(*(run.statistics for run in self.runs), strict=True)))

    def _record(self, status: str) -> Record:
        counts, events = self._statistics(), self._events()
        changes = any(event.changes for event in events)
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
            events=events,
            settings={
                "t_end": float(self.times[-1]),
                "dt": self.settings.dt,
                "rtol": self.settings.rtol,
                "atol": self.settings.atol,
                "step": self.settings.step,
                "project": bool(self.settings.project),
                "correct": bool(self.settings.correct),
                "rank": self.rank,
                "conservative": self.compiled.is_conservative and not changes,
                "correct_metric": str(self.settings.correct_metric),
            },
        )
