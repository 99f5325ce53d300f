"""One run: initial conditions, integration in chunks, the result and its notes."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.integrators import IMPLICIT, STEPPING, Integration, Status
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.integrators.stepping.singular_poses import begin_singular
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.result import Computed, Result, ResultError, information
from dap3d_core.result.post.ledger import UNSOLVED
from dap3d_core.scene import Mistake, SceneError, Simulation
from dap3d_core.simulation import handover
from dap3d_core.simulation.errors import RedundantError, SimulationError
from dap3d_core.simulation.failure.stall import refusal_notes
from dap3d_core.simulation.initial.singular_start import SingularStart
from dap3d_core.simulation.initial.tolerances import motion_notes, rounding_notes
from dap3d_core.simulation.initial_state import InitialState, start_notes
from dap3d_core.simulation.output.error_estimate import QUICK, StepLimits, add_error, ending_after
from dap3d_core.simulation.output.termination import accuracy_warnings, event_notes, why_stopped
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere
from dap3d_core.simulation.redundancy.redundancy import Redundancy
from dap3d_core.simulation.run_state import RunState
from dap3d_core.simulation.settings import (
    check_fit,
    fits,
    integration_options,
    refuse_singular_start,
)

if TYPE_CHECKING:
    from dap3d_core.simulation.checkpoint.save import CheckpointWriter
    from dap3d_core.simulation.events.jumps import Jumps
    from dap3d_core.simulation.redundancy.shared_reactions import SharedLaw

#: Seconds that a compiled chunk should take: Ctrl-C and the progress bar wait for its end.
CHUNK_SECONDS = 0.1
#: Right-hand sides times bodies of the first chunk, some ms, before it is known how long they take.
FIRST_CHUNK = 5000 if jit_is_on() else 100
#: Numbers that wait in the row buffer at most.
BUFFER_NUMBERS = 1_000_000
#: Right-hand sides times bodies, about a second, from which on a note says that method joint would
#: be quicker.
MUCH_WORK = 3_000_000
#: A second run, for the error, leaves a singular pose by a first step of this part.
SECOND_RUN_FACTOR = 0.8


class Run(RunState):
    """One run of a compiled model: initialise, integrate, finish."""

    #: Whether rows are reported that show what functions of time do.
    reports = True
    checkpoint_writer: "CheckpointWriter | None" = None
    singular: SingularStart | None = None
    shared_laws: "tuple[SharedLaw, ...]" = ()

    def save_every(self, seconds: float, *, force: bool) -> None:
        """Write checkpoints next to the output; arguments and errors as of ``CheckpointWriter``."""
        from dap3d_core.simulation.checkpoint.save import CheckpointWriter

        self.checkpoint_writer = CheckpointWriter(self, seconds, force=force)

    def execute(self, restore: Callable[[RunState], None] | None = None) -> Result:
        """Run from the start, or from the state that ``restore`` gives the run, to the end."""
        self.initialise()
        if restore is not None:
            restore(self)
        elif self.jumps is not None:
            self.jumps.begin(self.present)
        if restore is None and self.checkpoint_writer is not None:
            self.checkpoint_writer.begin()
        return self.finish()

    def initialise(self) -> None:
        """Correct the initial state, and compile and begin the first integration."""
        self.started = time.perf_counter()
        if self.event_locator:
            self.event_locator.take_rows = self._take_rows
        try:
            if self.event_locator:
                self.event_locator.release_inactive(self.start)
            self.begin(self._integration(self._start()))
        except BaseException:
            if self.event_locator:
                self.event_locator.put_back()
            raise

    def finish(self) -> Result:
        """Integrate from the present state to the end.

        Raises:
            SimulationError: the integration stopped; as any other exception, it has the result of
                what was computed as ``.result``, and ``.checkpoint`` where one was written.
        """
        try:
            self._integrate()
            while handover.hand_over(self):
                self._integrate()
        except BaseException as error:
            self._interrupt(error)
            raise
        finally:
            if self.event_locator:
                self.event_locator.put_back()
            if self.control is not None:
                self.control.put_back()
        ended = self.present.status
        if ended not in (Status.FINISHED, Status.ENDED):
            message = handover.singular_failure_message(
                why_stopped(self.evaluator, self.present, self.rank), self
            )
            self.notes.append(message)
        result = self._result("done" if ended is Status.FINISHED else "stopped")
        if self.checkpoint_writer is not None:
            self.checkpoint_writer.remove()
        if ended not in (Status.FINISHED, Status.ENDED):
            raise SimulationError(message, result)
        assert result is not None
        if self.estimate_error:
            quick = self.estimate_error == QUICK
            add_error(result, self.settings, self._rerun_with, self.recorder.output, quick=quick)
        return result

    def _interrupt(self, error: BaseException) -> None:
        """Keep what was computed until an exception ended the integration."""
        if isinstance(error, ResultError):  # the disk: what is there stays as it is
            writer = self.checkpoint_writer
            checkpoint = writer.path if writer is not None and writer.has_written else None
            Computed(checkpoint=checkpoint, part=self.recorder.part).attach(error)
            return
        self._take_rows()
        status = "interrupted" if isinstance(error, KeyboardInterrupt) else "stopped"
        Computed(self._result(status)).attach(error)
        if self.checkpoint_writer is not None and self.recorder.count:
            self.checkpoint_writer.leave(error)
        elif self.checkpoint_writer is not None:
            self.checkpoint_writer.remove()

    def _rerun_with(
        self, settings: Simulation, limits: StepLimits | None, seconds: float
    ) -> Result:
        """The result of a second run with other settings and limits of its steps, in memory."""
        events = self.event_locator.of_script if self.event_locator else ()
        watch = ending_after(seconds, self.callbacks.watch)
        callbacks = attrs.evolve(self.callbacks, watch=watch)
        run = Run(self.compiled, settings, callbacks, events, limits=limits, start=self.start)
        return run.execute()

    def _start(self) -> InitialState:
        """The initial state, corrected where the settings say so; its rank must suit the method."""
        settings, scene = self.settings, self.compiled.scene
        metric = str(settings.correct_metric)
        how = bool(settings.correct), tuple(settings.hold), metric
        state, found = self.start, self.compiled.rest_states
        if state is None and settings.start == "equilibrium":
            if how not in found:
                from dap3d_core.simulation.equilibrium.rest import start_at_rest

                found[how] = start_at_rest(self.evaluator, self.compiled.start(*how).u)
            state = found[how]
        start = self.compiled.start(*how, state)
        self.notes += start_notes(start, self.evaluator, scene)
        if self.reports:
            dt = settings.dt or self.t_end / 100.0
            self.notes += self.compiled.breakpoints(self.t_end).notes(settings, dt)
        self.rank = start.redundancy.rank.rank
        if start.redundancy.rank.redundant:
            self._judge_redundancy(start)
        return start

    def _judge_redundancy(self, start: InitialState) -> None:
        """Refuse redundant rows, or note what they leave open."""
        redundancy, u = start.redundancy, start.u
        self.singular = singular = redundancy.singular
        words = redundancy.describe()
        formulation = self.evaluator.formulation
        if not formulation.accepts_redundant:
            elsewhere = redundancy_elsewhere(self.evaluator, u, redundancy).describe(redundancy)
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
            refuse_singular_start(self.settings, singular.first_step, formulation)
        self._judge_shared_reactions(u, redundancy)
        if self.shared_laws:
            unique = "Reactions in these joints are not unique, and forces read them"
        else:
            least = " (reported are those of least |lambda|)" if formulation.is_exact else ""
            unique = f"Accelerations are unique; reactions in these joints are not{least}"
        self.notes.append(f"{words}. {unique}")
        if self.evaluator.model.breaks:
            from dap3d_core.simulation.events.breaking import share_notes

            self.notes += share_notes(self.evaluator.model, redundancy)
        if singular is not None:
            self.notes.append(singular.describe())

    def _judge_shared_reactions(self, u: Floats, redundancy: Redundancy) -> None:
        """Refuse forces that read reactions which are not unique, or follow what comes of it."""
        if not self.evaluator.model.iterated_forces:
            return
        from dap3d_core.simulation.redundancy import shared_reactions

        integrator = self.settings.integrator
        implicit = integrator if integrator == IMPLICIT.name else ""
        self.shared_laws = shared_reactions.shared_laws(
            self.compiled.checked, self.evaluator, u, redundancy
        )
        shared_reactions.refuse_shared(self.shared_laws, self.evaluator, implicit)
        if self.shared_laws:
            self.recorder.spread = shared_reactions.ShareSpread(self.evaluator, self.shared_laws)

    def _integration(self, start: InitialState) -> Integration:
        evaluator, settings, singular, u0 = self.evaluator, self.settings, self.singular, start.u
        store_reference_pivots(evaluator, 0.0, u0 if singular is None else singular.aside)
        evaluator.start(0.0, u0, start.angles, start.states)
        y0 = evaluator.coordinates.start(u0)
        width = 1 + len(y0) + evaluator.report_size
        self.options = options = integration_options(evaluator, settings) | {
            "first_step": None if self.limits is None else self.limits.first,
            "stops": self.stops,
            "buffer_rows": max(1, min(len(self.times), BUFFER_NUMBERS // width)),
        }
        integrator = integrator_named(settings.integrator)
        check_fit(integrator, evaluator.formulation)
        may_change = fits(IMPLICIT, evaluator.formulation) and not self.shared_laws
        may_change &= not evaluator.model.breaks
        slips = evaluator.model.contact_count > 0
        if settings.integrator == "auto":
            options = options | {"stop_when_stiff": may_change and not slips}
        try:
            integration = integrator.make(evaluator, y0, self.times, **options)
        except ValueError as error:
            raise SceneError([Mistake("step", settings.step, str(error))]) from error
        explicit = integration.adaptive and not integration.implicit
        integration.work.stops_when_slow = may_change and slips and explicit and not settings.step
        if singular is not None:
            first = singular.first_step * (1.0 if self.limits is None else SECOND_RUN_FACTOR)
            begin_singular(integration.work, evaluator.rates(0.0, u0, singular.acceleration), first)
        return integration

    def _integrate(self) -> None:
        """Advance in chunks, as many right-hand sides each as fit into ``CHUNK_SECONDS``."""
        run: Callable[[], object]
        integration, progress = self.present, self.callbacks.progress
        # step by step, where it is to end at the first step behind a time
        first = max(1, FIRST_CHUNK // self.evaluator.model.body_count)
        budget = first if self.until == np.inf else 0
        while integration.status is Status.RUNNING and integration.t < self.until:
            before, clock = integration.statistics.rhs, time.perf_counter()
            self.is_whole = False
            if self.control is not None:
                of_control = integration, self.event_locator, self.until < np.inf
                run = partial(self.control.advance, *of_control)
            elif self.event_locator:
                run = partial(self.event_locator.advance, integration, budget)
            else:
                run = partial(integration.advance, budget)
            if self.event_locator:  # it may change numbers of the scene meanwhile
                run()
            else:
                self.programs.during(integration, run)
            if self.jumps is not None:
                self._let_jump(self.jumps, integration)
            self._take_rows()
            self.is_whole = True
            if self.checkpoint_writer is not None:
                self.checkpoint_writer.update()
            done, seconds = integration.statistics.rhs - before, time.perf_counter() - clock
            if progress is not None:
                progress(integration.t, self.t_end)
            if self.observer is not None:
                self.observer.update()
            if done and seconds > 0.0 and self.until == np.inf:
                budget = int(min(max(1.0, done * CHUNK_SECONDS / seconds), 4.0 * budget, 1e9))

    def _let_jump(self, jumps: "Jumps", integration: Integration) -> None:
        """Where the integration stopped for it, let velocities jump, and events take notice."""
        jumps.follow(integration)
        if integration.status is not Status.JUMPED:
            return
        jumps.apply(integration)
        if self.event_locator:
            self.event_locator.look_again(integration)

    def _take_rows(self) -> None:
        """Take what was reported since the last chunk; in a long run, also onto disk."""
        if not self.integrations:
            return
        rows = self.evaluator.body_rows(self.present.rows())
        if len(rows):
            if self.singular is not None and not self.recorder.count:
                first = len(rows[0]) - self.evaluator.report_size
                accelerations = self.singular.acceleration
                rows[0, first : first + len(accelerations)] = accelerations
            inputs = None if self.control is None else self.control.inputs_at(rows[:, 0])
            rows = self.evaluator.with_inputs(rows, inputs)
            self.recorder.take(rows, lambda: self.record("done"))

    def _result(self, status: str) -> Result | None:
        """The result of what was computed, whole on disk if it has an output; None of nothing."""
        return self.recorder.result(self.record(status, self._closing_notes()))

    def _closing_notes(self) -> list[str]:
        """Notes on a run that has come to an end."""
        recorder, event_locator = self.recorder, self.event_locator
        notes = accuracy_warnings(self.evaluator)
        if self.settings.step is None and recorder.count:
            notes += motion_notes(recorder.low, recorder.high, self.settings)
            notes += rounding_notes(self.integrations, self.evaluator)
        notes += recorder.pulling.notes()
        notes += [recorder.spread.note()] if recorder.spread is not None else []
        notes += recorder.creep.notes(self.evaluator)
        notes += event_locator.notes() if event_locator else []
        notes += self.jumps.notes(self.present) if self.jumps is not None else []
        notes += event_notes(self.integrations, self.events())
        notes += refusal_notes(self.evaluator, self.integrations)
        notes += handover.crossing_notes(self.crossed)
        notes += stepping_notes(self.integrations, self.evaluator.model.length)
        notes += handover.stiffness_notes(self.integrations, self.settings.integrator)
        return notes + self._method_notes()

    def _method_notes(self) -> list[str]:
        """That a long run whose method was left to auto would be quicker by method joint."""
        model, work = self.evaluator.model, self.statistics().rhs * self.evaluator.model.body_count
        is_left_open = self.compiled.requested_method == "auto" and model.row_count > 0
        if not is_left_open or not self.evaluator.coordinates.are_of_bodies:
            return []
        if work < MUCH_WORK or any(i.implicit for i in self.integrations):
            return []
        from dap3d_core.simulation.explain import WORTHWHILE, in_joint_coordinates

        ratio = self.compiled.joint_cost
        if ratio is None or ratio >= WORTHWHILE:
            return []
        return [information(in_joint_coordinates(ratio))]


def stepping_notes(integrations: Sequence[Integration], length: float) -> list[str]:
    """What contacts of a run by time stepping do that they should not; the ledger has their sizes.

    length: of the scene, m.
    """
    states = [one.work for one in integrations if one.name == STEPPING.name]
    if not states:
        return []
    residual, deepest = max(w.largest_residual for w in states), max(w.deepest for w in states)
    notes: list[str] = []
    if residual > UNSOLVED:
        notes.append(
            f"contacts were solved to {residual:.2g} of the largest impulse of a step: where "
            "bodies rest is not to be trusted; give a shorter contact_step"
        )
    elif deepest > UNSOLVED * length:
        notes.append(
            f"bodies overlap by {deepest:.2g} m: joints or drivers hold them where they cannot "
            "move apart"
        )
    first = next(one for one in integrations if one.name == STEPPING.name)
    notes += [words] if (words := first.overlapping) else []
    return [*notes, information(words)] if (words := first.shortened) else notes
