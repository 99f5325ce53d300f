"""One run: initial conditions, method, integration in chunks, and what is left behind."""

import os
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.integrators import EXPLICIT, IMPLICIT, INTEGRATORS, Integration, Status
from dap3d_core.integrators import Statistics as Counts
from dap3d_core.integrators.stepping.singular_poses import begin_singular
from dap3d_core.result import INFORMATION, Occurrence, Record, Result, ResultError, Statistics
from dap3d_core.scene import Mistake, SceneError, Simulation
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import RedundantError, SimulationError
from dap3d_core.simulation.events.event import Event
from dap3d_core.simulation.events.locate import Watcher
from dap3d_core.simulation.failure.termination import doubts, event_notes, occurrences, why_stopped
from dap3d_core.simulation.handover import cannot_cross, crossing_notes, hand_over
from dap3d_core.simulation.implicit_run import stiffness_notes
from dap3d_core.simulation.initial.singular_start import SingularStart
from dap3d_core.simulation.initial.tolerances import (
    atol_notes,
    motion_notes,
    resolved_atol,
    rounding_notes,
)
from dap3d_core.simulation.initial_state import Start, start_notes
from dap3d_core.simulation.output.error_estimate import Again, StepLimits, add_error, halved
from dap3d_core.simulation.output.free_space import check_room, row_width
from dap3d_core.simulation.output.monitor import Observer, Standing
from dap3d_core.simulation.output.recorder import Keeper
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere
from dap3d_core.simulation.settings import (
    check_fit,
    fits,
    integration_options,
    refuse_singular_start,
    report_times,
    settings_notes,
)

if TYPE_CHECKING:
    from dap3d_core.simulation.checkpoint.save import Saver

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]

#: Seconds that a compiled chunk should take: Ctrl-C and the progress bar wait for its end.
CHUNK_SECONDS = 0.1
#: Right-hand sides of the first chunk, before it is known how long they take.
FIRST_CHUNK = 100
#: Numbers that wait in the row buffer at most.
BUFFER_NUMBERS = 4_000_000
#: A second run, for the error, leaves a singular pose by a first step of this part.
AGAIN = 0.8


class Run:
    """One run of a compiled model."""

    def __init__(
        self,
        compiled: CompiledModel,
        settings: Any,
        announce: Callable[[str], None] | None,
        events: Sequence[Event] = (),
        watch: Callable[[Standing], None] | None = None,
        *,
        estimate_error: bool = False,
    ) -> None:
        self.estimate_error = estimate_error
        self.announce = announce
        self.compiled = compiled
        self.machine = compiled.machine
        used = resolved_atol(settings.atol, self.machine)
        self.settings = attrs.evolve(settings, atol=used)
        self.times = report_times(settings.t_end, settings.dt)
        self.notes = [*compiled.notes, *settings_notes(compiled, settings)]
        self.notes.append(f"method {compiled.method}: {compiled.reason}")
        if settings.step is None:
            self.notes += [
                INFORMATION + note for note in atol_notes(settings.atol, used, self.machine)
            ]
        self.keeper: Keeper | None = None
        self.saver: Saver | None = None
        #: Whether the run stands between two chunks, and nothing is half done.
        self.is_whole = False
        self.started = self.compile_time = 0.0
        self.singular: SingularStart | None = None
        self.rank = 0
        #: Of a second run, which is to be finer than the first everywhere.
        self.limits: StepLimits | None = None
        self.watcher = Watcher(compiled, events) if events else None
        self.watch, end = watch, float(self.times[-1])
        self.observer = None if watch is None else Observer(self.machine.model, end, watch)
        #: The integrations, the present one last: "auto" and radau may take a second one.
        self.runs: list[Integration] = []
        #: Times of singular poses that an explicit integration was to cross for radau, and the
        #: time at which it leaves the run to radau again.
        self.crossed: list[float] = []
        self.until = np.inf
        self.options: dict[str, Any] = {}

    def go(
        self,
        progress: Progress | None,
        output: str | os.PathLike[str] | None,
        *,
        force: bool,
        checkpoint: float | None = None,
    ) -> Result:
        """Run from the start to the end; arguments and errors as of ``simulate``."""
        self.keep(output, force=force)
        if checkpoint is not None:
            from dap3d_core.simulation.checkpoint.save import Saver

            self.saver = Saver(self, checkpoint, force=force)
        self.prepare()
        if self.saver is not None:
            self.saver.begin()
        return self.finish(progress)

    def prepare(self) -> None:
        """Stand at the start: corrected, compiled, nothing integrated."""
        self.started = time.perf_counter()
        start = self._start()
        integration = self._integration(start)
        self.begin(integration)

    def keep(
        self, output: str | os.PathLike[str] | None, *, force: bool, identity: str = ""
    ) -> None:
        """Keep what will be reported, and where; identity: of the run that this one goes on with.

        Raises:
            ResultError: the output cannot be written.
            SceneError: there is no room for it.
        """
        check_room(len(self.times), row_width(self.machine), self.settings.dt, output)
        most = len(self.times) + 1  # an event may end a run between two of them
        self.keeper = Keeper(self.compiled, output, most, force=force, run=identity)

    def finish(self, progress: Progress | None) -> Result:
        """Integrate to the end from where the run stands."""
        keeper = self.keeper
        assert keeper is not None
        try:
            self._advance(progress)
            while hand_over(self):
                self._advance(progress)
        except BaseException as error:
            if isinstance(error, ResultError):  # the disk: what is there stays as it is
                error.part = keeper.part  # type: ignore[attr-defined]
                if self.saver is not None and self.saver.has_written:
                    error.checkpoint = self.saver.path  # type: ignore[attr-defined]
                raise
            self._take_rows()
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "stopped"
            error.result = self._kept(status)  # type: ignore[attr-defined]
            if self.saver is not None and self.keeper is not None and self.keeper.count:
                self.saver.leave(error)
            elif self.saver is not None:
                self.saver.remove()
            raise
        finally:
            if self.watcher:
                self.watcher.numbers.put_back()
        ended = self.runs[-1].status
        if ended not in (Status.FINISHED, Status.ENDED):
            raise self._stopped()
        result = self._kept("done" if ended is Status.FINISHED else "stopped")
        assert result is not None
        if self.saver is not None:
            self.saver.remove()
        if self.estimate_error:
            add_error(result, self.settings, self._again(progress), keeper.output)
        return result

    def _again(self, progress: Progress | None) -> Again:
        """Makes a run with other settings and another first step, in memory."""

        def again(settings: Simulation, limits: StepLimits | None) -> Result:
            events = self.watcher.events if self.watcher else ()
            run = Run(self.compiled, settings, self.announce, events, self.watch)
            run.limits = limits
            return run.go(progress, None, force=False)

        return again

    def _start(self) -> Start:
        """Where the run starts, corrected if asked for; its rank must suit the method."""
        settings, scene = self.settings, self.compiled.scene
        metric = str(settings.correct_metric)
        start = self.compiled.start(bool(settings.correct), settings.hold, metric)
        self.notes += start_notes(start, self.machine, scene)
        t_end = float(self.times[-1])
        self.notes += self.compiled.pace(t_end).notes(settings, settings.dt or t_end / 100.0)
        self.rank = start.redundancy.rank.rank
        if start.redundancy.rank.redundant:
            self._judge_redundancy(start)
        return start

    def _judge_redundancy(self, start: Start) -> None:
        """Refuse redundant rows, or note what they leave open."""
        redundancy, u = start.redundancy, start.u
        self.singular = singular = redundancy.singular
        words = redundancy.describe()
        formulation = self.machine.formulation
        if not formulation.accepts_redundant:
            elsewhere = redundancy_elsewhere(self.machine, u, redundancy).describe(redundancy)
            raise RedundantError(
                f"{words}; {elsewhere}. The {formulation.name} method needs independent rows"
            )
        if singular is not None and not singular.leads_on:
            raise RedundantError(singular.describe())
        if redundancy.contradictions:
            raise RedundantError(f"{words}. No motion satisfies them all")
        if redundancy.bindings:
            raise RedundantError(words)
        if singular is not None:
            refuse_singular_start(self.settings, singular.first_step)
        least = " (reported are those of least |lambda|)" if formulation.is_exact else ""
        self.notes.append(
            f"{words}. Accelerations are unique; reactions in these joints are not{least}"
        )
        if singular is not None:
            self.notes.append(singular.describe())

    def _integration(self, start: Start) -> Integration:
        machine, settings, singular, u0 = self.machine, self.settings, self.singular, start.u
        machine.watch_pivots(0.0, u0 if singular is None else singular.aside)
        machine.start(0.0, u0)
        y0 = machine.integrated(u0)
        width = 1 + len(y0) + machine.report_size
        self.options = options = integration_options(machine, settings) | {
            "first_step": None if self.limits is None else self.limits.first,
            "buffer_rows": max(1, min(len(self.times), BUFFER_NUMBERS // width)),
        }
        integrator = INTEGRATORS.get(settings.integrator, EXPLICIT)
        check_fit(integrator, machine.formulation)
        if settings.integrator == "auto":
            options = options | {"leave_stiff": fits(IMPLICIT, machine.formulation)}
        try:
            integration = integrator.make(machine, y0, self.times, **options)
        except ValueError as error:
            raise SceneError([Mistake("step", settings.step, str(error))]) from error
        if singular is not None:
            first = singular.first_step * (1.0 if self.limits is None else AGAIN)
            begin_singular(integration.work, machine.rates(0.0, u0, singular.acceleration), first)
        return integration

    def begin(self, integration: Integration) -> None:
        """Compile an integrator before the clock of the run goes on; it is the present one then."""
        integration.tstops = self.compiled.pace(float(self.times[-1])).stops
        if self.limits is not None:
            integration.tstops = halved(integration.tstops)
            integration.work.longest_step = self.limits.longest
        before = time.perf_counter()
        integration.compile()
        spent = time.perf_counter() - before
        self.compile_time += spent
        self.started += spent
        self.runs.append(integration)
        self.look_on()

    def look_on(self) -> None:
        """Let who watches the run look at its present integration."""
        if self.observer is not None:
            self.observer.begin(self.runs[-1])

    def _advance(self, progress: Progress | None) -> None:
        """Advance in chunks whose length in right-hand sides follows the clock."""
        integration = self.runs[-1]
        # step by step, where it is to end at the first step behind a time
        budget = FIRST_CHUNK if self.until == np.inf else 0
        t_end = float(self.times[-1])
        while integration.status is Status.RUNNING and integration.t < self.until:
            before, clock = integration.statistics.rhs, time.perf_counter()
            self.is_whole = False
            if self.watcher:
                self.watcher.advance(integration, budget)
            else:
                integration.advance(budget)
            self._take_rows()
            self.is_whole = True
            if self.saver is not None:
                self.saver.look()
            done, seconds = integration.statistics.rhs - before, time.perf_counter() - clock
            if progress is not None:
                progress(integration.t, t_end)
            if self.observer is not None:
                self.observer.look()
            if done and seconds > 0.0 and self.until == np.inf:
                budget = int(min(max(1.0, done * CHUNK_SECONDS / seconds), 4.0 * budget, 1e9))

    def _take_rows(self) -> None:
        """Take what was reported since the last chunk; in a long run, also onto disk."""
        if not self.runs:
            return
        rows = self.runs[-1].rows()
        if len(rows):
            assert self.keeper is not None
            if self.singular is not None and not self.keeper.count:
                first = len(rows[0]) - self.machine.report_size
                rows[0, first : first + len(self.singular.acceleration)] = (
                    self.singular.acceleration
                )
            self.keeper.take(rows, lambda: self.record("done"))

    def _stopped(self) -> SimulationError:
        """Why the integration ended early, with what was computed."""
        message = why_stopped(self.machine, self.runs[-1], self.rank)
        message = cannot_cross(message, self)
        self.notes.append(message)
        result = self._kept("stopped")
        if self.saver is not None:
            self.saver.remove()
        return SimulationError(message, result)

    def _kept(self, status: str) -> Result | None:
        """The result of what was computed, whole on disk if asked for; None where nothing was."""
        if self.keeper is None:
            return None
        return self.keeper.result(self.record(status, self._closing_notes()))

    def _closing_notes(self) -> list[str]:
        """What is only told of a run that has come to an end."""
        notes = doubts(self.machine, self._statistics().rhs)
        if self.settings.step is None and self.keeper is not None and self.keeper.count:
            keeper, model = self.keeper, self.machine.model
            notes += motion_notes(keeper.low, keeper.high, self.settings)
            notes += rounding_notes(self.runs, model.body_names)
        if self.keeper is not None:
            notes += self.keeper.pulling.notes()
        notes += self.watcher.notes() if self.watcher else []
        notes += event_notes(self.runs, self._events())
        notes += crossing_notes(self.crossed)
        return notes + stiffness_notes(self.runs, self.settings.integrator)

    def _events(self) -> list[Occurrence]:
        found = self.watcher.occurrences if self.watcher else []
        return occurrences(self.machine, self.runs, found)

    def _statistics(self) -> Counts:
        """What all integrations have done together."""
        return Counts(*(sum(n) for n in zip(*(run.statistics for run in self.runs), strict=True)))

    def record(self, status: str, more_notes: Sequence[str] = ()) -> Record:
        """What there is to say of the run so far."""
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
            notes=[*self.notes, *more_notes],
            events=events,
            types=self.compiled.types,
            settings={
                "t_end": float(self.times[-1]),
                "dt": self.settings.dt,
                "rtol": self.settings.rtol,
                "atol": self.settings.atol,
                "length": self.machine.model.length,
                "most_work": max((run.largest_work for run in self.runs), default=0.0),
                "step": self.settings.step,
                "project": bool(self.settings.project),
                "correct": bool(self.settings.correct),
                "rank": self.rank,
                "conservative": self.compiled.is_conservative and not changes,
                "correct_metric": str(self.settings.correct_metric),
                "method": self.compiled.asked,
            },
        )
