"""The state of one run, which all parts of it share: its integrations, rows, notes and clock.

Rows are in memory while they are few, else in a file next to the output.
"""

import math
import os
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.programs.change_over import ChangeOver
from dap3d_core.integrators import STEPPING, Integration, StepCounts
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.result import (
    EventRecord,
    Result,
    ResultError,
    ResultWriter,
    RunMetadata,
    RunStatistics,
    check_target,
    information,
)
from dap3d_core.result.arrays import LARGE, Arrays, arrays_of, joined, summary_of
from dap3d_core.result.contact_table import ContactTable, no_contacts
from dap3d_core.result.file.atomic_write import check_utf8
from dap3d_core.result.open import arrays_in
from dap3d_core.scene import MISSING, Mistake, SceneError, Simulation
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.events.event import Event, check_every
from dap3d_core.simulation.events.locate import EventLocator
from dap3d_core.simulation.explain import method_note
from dap3d_core.simulation.failure.monitors import CreepMonitor, UnilateralMonitor
from dap3d_core.simulation.initial.tolerances import atol_notes, resolved_atol
from dap3d_core.simulation.output.error_estimate import StepLimits, with_midpoints
from dap3d_core.simulation.output.free_space import check_room
from dap3d_core.simulation.output.monitor import Observer, RunProgress
from dap3d_core.simulation.output.termination import occurrences
from dap3d_core.simulation.settings import report_times, settings_notes

if TYPE_CHECKING:
    from dap3d_core.simulation.control.sampled import Controller, SampledControl
    from dap3d_core.simulation.events.jumps import Jumps
    from dap3d_core.simulation.initial.start_state import StartState
    from dap3d_core.simulation.redundancy.shared_reactions import ShareSpread


#: A run that lasts longer writes its rows to disk as they come, so that it may be killed.
SHORT_SECONDS = 1.0


class ResultRecorder:
    """Keeps the rows of one run.

    Attributes:
        run: the identity that its files carry.
        output: the file that is wanted in the end, or None.
        count: instants reported so far.
        pulling: multipliers that must not be negative, and were.
        spread: what depends on the share of loads that are not unique; None where nothing does.
        creep: friction that should stick and creeps.
    """

    def __init__(
        self,
        model: Model,
        evaluator: Callable[[], Evaluator],
        output: str | os.PathLike[str] | None,
        most: int,
        *,
        force: bool,
        run: str = "",
    ) -> None:
        """Args:
            model: the model of the rows.
            evaluator: returns its evaluator, for quantities that a result computes later.
            output, force: as ``simulate`` has them.
            most: how many rows come at most.
            run: identity of the run that this one continues.

        Raises:
            ResultError: the output cannot be written.
        """
        if output is not None:
            check_utf8("write", output)
        self.run = run or os.urandom(16).hex()
        self.output: Path | None = None if output is None else check_target(output, force)
        self.count = 0
        self._model, self._evaluator, self._most, self._force = model, evaluator, most, force
        self._subject = summary_of(model)
        self._parts: list[Arrays] = []
        self.pulling = UnilateralMonitor(model)
        self.spread: ShareSpread | None = None
        self.creep = CreepMonitor(model, most)
        self._bytes = 0
        self._writer: ResultWriter | None = None
        #: (13 n,) the least and the largest value of each component so far.
        self.low, self.high = (np.full(model.u0.size, x) for x in (np.inf, -np.inf))
        self._began = math.inf  # when the first rows came

    def take(self, rows: Floats, record: Callable[[], RunMetadata]) -> None:
        """Keep what was reported since the last time; record: what is known of the run."""
        self.add(arrays_of(rows, self._subject), record)

    def add(self, arrays: Arrays, record: Callable[[], RunMetadata]) -> None:
        """Array version of ``take``."""
        self._began = min(self._began, time.perf_counter())
        self.count += len(arrays)
        if len(arrays):
            self.low = np.minimum(self.low, np.min(arrays.u, axis=0))
            self.high = np.maximum(self.high, np.max(arrays.u, axis=0))
        self.pulling.update(arrays)
        if self.spread is not None:
            self.spread.update(arrays)
        self.creep.update(arrays)
        self._bytes += 8 * len(arrays) * arrays.width
        large = self._bytes > LARGE
        if self._writer is None:
            self._parts.append(arrays)
            if self.output and (large or time.perf_counter() - self._began > SHORT_SECONDS):
                self.write(record)
        else:
            self._writer.append(arrays)
            if not large:
                self._parts.append(arrays)
        if large and self._writer is not None:
            self._parts.clear()

    def write(self, record: Callable[[], RunMetadata]) -> None:
        """Have all rows in a file from now on."""
        if self._writer is None:
            assert self.output is not None
            about = attrs.evolve(record(), run=self.run)
            self._writer = ResultWriter(
                self.output, self._subject, about, self._most, force=self._force
            )
            for part in self._parts:
                self._writer.append(part)

    @property
    def part(self) -> Path | None:
        """The unfinished file that holds the rows written so far; None where there is none."""
        return None if self._writer is None or not self._writer.count else self._writer.part

    def to_disk(self, record: Callable[[], RunMetadata]) -> None:
        """Wait until all rows are on the disk."""
        self.write(record)
        assert self._writer is not None
        self._writer.to_disk()

    def result(self, record: RunMetadata) -> Result | None:
        """The result of what was kept, whole in the output if there is one; None of nothing."""
        if not self.count:
            if self._writer is not None:
                self._writer.discard()
            return None
        if self._writer is not None:
            self._writer.close()
        result = Result(
            self._subject,
            self._arrays(),
            attrs.evolve(record, run=self.run),
            lambda: (self._model, self._evaluator),
        )
        if self.output is not None:
            try:
                result.save(self.output, force=self._force)
            except ResultError as error:
                if self._writer is None:
                    raise
                words = f"{error}; what was computed is in {self._writer.part}"
                raise ResultError(words) from error
            self._force = True  # it is ours now
        if self._writer is not None:
            self._writer.discard()
        return result

    def _arrays(self) -> Arrays:
        if self._parts:
            return joined(self._parts)
        assert self._writer is not None
        return arrays_in(self._writer.part, self._subject, self.count)


#: The setting ``start`` in a result whose run was given another state.
GIVEN_START = "given state"
Progress = Callable[[float, float], None]


@attrs.frozen(kw_only=True)
class Callbacks:
    """Functions of the caller, or None.

    Attributes:
        progress: called as progress(t, t_end) between chunks.
        watch: called between chunks with a ``RunProgress``.
    """

    progress: Progress | None = None
    watch: Callable[[RunProgress], None] | None = None


class RunState:
    """One run between two chunks; checkpoints and the change of integrator work on it.

    Attributes:
        compiled, evaluator, settings: the model, its evaluator, the settings with atol as a number.
        programs: of the scene's own, which take the place of general code in longer runs.
        times: (nt,) reporting times, s.
        options: what every integration of the run is made with.
        integrations: the present one last; "auto" and radau may take a second one.
        crossed, until: times of singular poses that an explicit integration crosses for radau, and
            the time at which radau takes over again, s.
        rank: of the constraints at the start.
        is_whole: the run is between two chunks, its rows taken.
        estimate_error: a second run is to estimate the error of this one; "quick" where that takes
            less than a second.
        limits: of the steps of such a second run.
        start: a state in place of the scene's initial conditions; None for what the settings say.
        jumps: changes of velocities by elements; None where no type of the scene has any.
        recorder, watcher: the rows reported so far; the events of a script.
        control: the controllers of a script, None for none.
        started, compile_time: clock at the start, compilation left out; seconds of compilation.
    """

    def __init__(
        self,
        compiled: CompiledModel,
        settings: Any,
        callbacks: Callbacks,
        events: Sequence[Event] = (),
        *,
        output: str | os.PathLike[str] | None = None,
        force: bool = False,
        identity: str = "",
        estimate_error: bool | str = False,
        limits: StepLimits | None = None,
        start: "StartState | None" = None,
        controllers: "Sequence[Controller]" = (),
    ) -> None:
        """Args:
            compiled, settings, callbacks, events, controllers: of the run.
            output, force: file of the result, and whether over an existing one.
            identity: of the run that this one continues.
            estimate_error, limits, start: as the attributes.

        Raises:
            ResultError: the output cannot be written.
            SceneError: there is no final time, or no room for the output.
        """
        self.compiled, self.evaluator, self.callbacks = compiled, compiled.evaluator, callbacks
        atol = resolved_atol(settings.atol, self.evaluator)
        self.settings: Simulation = attrs.evolve(settings, atol=atol)
        self.times = report_times(settings.t_end, settings.dt)
        self.notes = [*compiled.notes, *settings_notes(compiled, settings)]
        self.notes.append(method_note(compiled.method, compiled.reason, settings.method))
        if settings.step is None:
            self.notes += [
                information(note) for note in atol_notes(settings.atol, atol, self.evaluator)
            ]
        self.started, self.compile_time, self.rank = 0.0, 0.0, 0
        self.estimate_error, self.limits, self.start = estimate_error, limits, start
        self.is_whole = False
        self.integrations: list[Integration] = []
        self.crossed: list[float] = []
        self.until = np.inf
        self.options: dict[str, Any] = {}
        watches = bool(events or compiled.model.breaks)
        self.event_locator = EventLocator(compiled, events, self.evaluator) if watches else None
        self.jumps = jumps_of(self.evaluator, self.settings)
        if self.event_locator is not None:
            check_every(self.event_locator.events, self.t_end)
            self.event_locator.jumps = self.jumps
        self.programs = ChangeOver(self.evaluator)
        self.control: SampledControl | None = None
        if controllers:
            self._take(controllers)
        watch = callbacks.watch
        self.observer = None if watch is None else Observer(self.evaluator, self.t_end, watch)
        check_room(len(self.times), compiled.model.row_layout.size, self.settings.dt, output)
        most = len(self.times) + 1  # an event may end a run between two of them
        self.recorder = ResultRecorder(
            compiled.model, lambda: compiled.evaluator, output, most, force=force, run=identity
        )

    def _take(self, controllers: "Sequence[Controller]") -> None:
        """Let controllers set the inputs of the run."""
        from dap3d_core.simulation.control.sampled import SampledControl

        if self.estimate_error:
            what = "cannot be estimated in a run with controllers: they may remember its first run"
            remedy = "compare with a run of smaller rtol and atol"
            raise SceneError([Mistake("estimate_error", True, what, remedy=remedy)])
        self.control = SampledControl(self.compiled, self.evaluator, controllers, self.t_end)
        self.control.jumps = self.jumps
        self.notes += self.control.notes(self.settings.dt or self.t_end / 100.0)

    @property
    def t_end(self) -> float:
        """Final time, s."""
        return float(self.times[-1])

    @property
    def present(self) -> Integration:
        """The integration that the run is in."""
        return self.integrations[-1]

    @cached_property
    def stops(self) -> Sequence[tuple[float, bool]]:
        """Break points of functions of time: as the argument of ``Integration``."""
        stops = self.compiled.breakpoints(self.t_end).stops
        return stops if self.limits is None else with_midpoints(stops)

    def begin(self, integration: Integration) -> None:
        """Make an integration the present one; it is compiled first, off the clock of the run."""
        if self.limits is not None:
            integration.work.longest_step = self.limits.longest
        if self.event_locator is not None:
            integration.work.follows_steps = 1  # dense output, for ``state_within``
        before = time.perf_counter()
        integration.compile()
        spent = time.perf_counter() - before
        self.compile_time += spent
        self.started += spent
        self.integrations.append(integration)
        self.observe_present()

    def observe_present(self) -> None:
        """Let the callback ``watch`` follow the present integration."""
        if self.observer is not None:
            self.observer.begin(self.present)

    def statistics(self) -> StepCounts:
        """StepCounts of all integrations together."""
        return StepCounts(*map(sum, zip(*(i.statistics for i in self.integrations), strict=True)))

    def events(self) -> list[EventRecord]:
        """Crossings of switches and events of the script so far, by time."""
        others = self.event_locator.occurrences if self.event_locator else []
        if self.jumps is not None:
            others = [*others, *self.jumps.records]
        return occurrences(self.evaluator, self.integrations, others)

    def _contacts(self) -> ContactTable:
        """Contacts of shapes at the instants reported so far."""
        shapes = self.evaluator.model.collisions
        if shapes is None:
            return no_contacts()
        every = [one.contact_rows for one in self.integrations]
        return ContactTable.of_rows(shapes.names, np.concatenate(every))

    def record(self, status: str, more_notes: Sequence[str] = ()) -> RunMetadata:
        """The metadata of the result so far."""
        counts, events = self.statistics(), self.events()
        changes = any(event.changes or event.kind == "engage" for event in events)
        changes |= self.jumps is not None and self.jumps.lose
        return RunMetadata(
            scene_text=self.compiled.scene_text,
            stats=RunStatistics(
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
            contacts=self._contacts(),
            types=self.compiled.types,
            settings={
                "t_end": self.t_end,
                "dt": self.settings.dt,
                "rtol": self.settings.rtol,
                "atol": self.settings.atol,
                "length": self.evaluator.model.length,
                "extent": self.evaluator.model.extent,
                "most_work": max((run.largest_work for run in self.integrations), default=0.0),
                **self._rate_noise(),
                **self._stepping(),
                "step": self.settings.step,
                "project": bool(self.settings.project),
                "correct": bool(self.settings.correct),
                "rank": self.rank,
                "conservative": self._is_conservative(changes),
                "correct_metric": str(self.settings.correct_metric),
                "start": self.settings.start if self.start is None else GIVEN_START,
                "method": self.compiled.requested_method,
                **({} if self.control is None else {"controllers": self.control.titles}),
            },
        )

    def _is_conservative(self, changes: bool) -> bool:
        """True if potentials account for all work but that of contacts which are stepped."""
        others = self.evaluator.model.contact_count and not self._stepping()
        return self.compiled.is_conservative and not changes and not others

    def _stepping(self) -> dict[str, dict[str, float]]:
        """What contacts did, and what was left unsolved of them, where they are stepped."""
        states = [one.work for one in self.integrations if one.name == STEPPING.name]
        if not states:
            return {}
        most = ("largest_residual", "deepest")
        sums = ("contact_work", "friction_work", "work_given")
        found = {name: max(float(getattr(work, name)) for work in states) for name in most}
        found |= {name: sum(float(getattr(work, name)) for work in states) for name in sums}
        return {"stepping": found}

    def _rate_noise(self) -> dict[str, dict[str, float]]:
        """Largest rounding of accelerations, m/s^2 and rad/s^2, where it limits the accuracy.

        In coordinates of a formulation it is that of other rates, and not recorded.
        """
        part = self.evaluator.coordinates.body_velocities
        noise = np.zeros(6)
        for integration in self.integrations:
            rows = integration.rate_noise[part].reshape(-1, 6)
            noise = np.maximum(noise, rows.max(axis=0, initial=0.0))
        if not noise.any():
            return {}
        v, w = np.linalg.norm(noise.reshape(2, 3), axis=1).tolist()
        return {"rate_noise": {"v": v, "w": w}}


def jumps_of(evaluator: Evaluator, settings: Simulation) -> "Jumps | None":
    """What changes velocities in a run of a model; None where none of its types does.

    Raises:
        SceneError: elements change velocities by laws that steps of contacts do not know.
    """
    jumping = [switch for switch in evaluator.switches if switch.jumps]
    if not jumping:
        return None
    if integrator_named(settings.integrator).steps_contacts:
        others = [switch.name(evaluator.model) for switch in jumping if not switch.is_contact]
        if others:
            what = "changes velocities by a law of its own, which steps of contacts do not know"
            remedy = "describe what it does by a contact, or take the contacts out"
            raise SceneError([Mistake(others[0], MISSING, what, remedy=remedy)])
        return None
    if evaluator.model.contact_count:
        from dap3d_core.simulation.events.contact_jumps import ContactJumps

        return ContactJumps(evaluator)
    from dap3d_core.simulation.events.jumps import Jumps

    return Jumps(evaluator)
