"""A run that a script takes step by step: for learning, hardware, loops of one's own."""

import math
import os
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import CHECKPOINTED
from dap3d_core.formulations import REPORT
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators import Status
from dap3d_core.integrators.stepping.hold import Hold, quick_view
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result
from dap3d_core.result.contact_table import ContactTable, no_contacts
from dap3d_core.scene import Scene
from dap3d_core.settings import StepSettings
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.control.held_inputs import HeldInputs
from dap3d_core.simulation.control.sampled import ALIKE, jump, with_events
from dap3d_core.simulation.control.state_view import StateView
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.locate import EventLocator
from dap3d_core.simulation.handover import hand_over
from dap3d_core.simulation.initial.given_state import state_of
from dap3d_core.simulation.initial.released_joints import ReleasedJoints
from dap3d_core.simulation.output.termination import why_stopped
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks, jumps_of
from dap3d_core.simulation.settings import compiled_for, replaced_notes, settings_of

if TYPE_CHECKING:
    from dap3d_core.simulation.events.jumps import Jumps

#: Where a run without a final time ends at last, s: steps cannot resolve time any further.
HORIZON = 1e5
#: Steps that a run is taken to have, where a time is judged by the length of the run.
USUAL_STEPS = 1000
#: Rows that there is room for at first; it doubles.
FIRST_ROWS = 1024


class SteppedRun:
    """A run that waits for ``step``; ``dap.start`` makes it.

    Threads may share it: each call of ``step``, ``reset`` and ``result`` waits for the one before.

    Attributes:
        compiled: the model.
        state: the present state, a ``StateView``: ``run.state["crank.r.z"]``.
        notes: what the run chose, changed or noticed, in order.
    """

    def __init__(self, run: Run, *, record: bool) -> None:
        """Args: a run that was not begun; whether the states between steps are kept."""
        #: Held by the thread in ``step``, ``reset`` or ``result``, which call each other.
        self._lock = threading.RLock()
        self.compiled, self._run = run.compiled, run
        evaluator = self._evaluator = run.evaluator = run.compiled.new_evaluator()
        if run.event_locator is not None:
            run.event_locator = EventLocator(run.compiled, (), evaluator)
        self._locator = run.event_locator
        run.initialise()
        run.jumps = jumps_of(evaluator, run.settings)
        if self._locator is not None:
            self._locator.jumps = run.jumps
        if run.jumps is not None:
            run.jumps.begin(run.present)
        self.state = StateView(run.compiled, evaluator)
        self.notes = run.notes
        self._inputs = HeldInputs(evaluator)
        self._failure = ""
        self._is_recorded, self._t_end = record, run.t_end
        integration = self._integration = run.present
        self._log = StateLog(
            evaluator, integration, self._inputs,
            None if self._locator is None else self._locator.released,
        )  # fmt: skip
        self._attach()
        system = evaluator.system
        arrays = [*integration.state_arrays(), *(getattr(system, name) for name in CHECKPOINTED)]
        arrays += evaluator.coordinates.reference
        self._start = [(array, array.copy()) for array in arrays]

    @property
    def t(self) -> float:
        """Time reached, s."""
        return self._hold.t

    def step(self, dt: float, inputs: Mapping[str, float] | None = None) -> float:
        """Set inputs, and integrate for a time dt, s, in which they are held.

        Args:
            dt: s, positive.
            inputs: {input: value} of those that change.

        Returns:
            the time reached, s.

        Raises:
            ValueError: dt is no positive number, an input does not exist, or a value is not finite.
            TypeError: ``inputs`` is no mapping.
            SimulationError: the run cannot go on; what was computed is ``.result``.
        """
        with self._lock:
            if self._failure:
                raise SimulationError(self._failure, self.result())
            hold = self._hold
            t = hold.t
            try:
                end = t + dt
                if not t < end < math.inf:
                    raise TypeError
            except TypeError:
                words = f"dt is {dt!r}; it should be a positive number of seconds"
                raise ValueError(words) from None
            if abs(end - self._t_end) <= ALIKE * dt:
                end = self._t_end
            if inputs and self._inputs.set(inputs):
                jump(self._evaluator, hold, self._run.jumps, drives=self._inputs.drives)
                if self._locator is not None:
                    self._locator.begin_anew(hold.integration)
            if self._is_recorded:
                self._log.add(t)
            if self._run.jumps is not None:
                self._run.jumps.span = min(USUAL_STEPS * dt, self._t_end)
            if not self._reach(end) or self._run.until < math.inf:
                self._go_on(end)
            self.state.changed()
            return end

    def reset(self, u: ArrayLike | None = None) -> None:
        """Begin again at t = 0, with the inputs of the scene; what was recorded is given up.

        Args:
            u: (13 n,) state to begin from, in the order of ``Result.u``; it is brought onto the
                constraints. By default that of the start.

        Raises:
            ValueError: u is not 13 n finite numbers.
            SimulationError: no state on the constraints was found near u.
        """
        with self._lock:
            run, evaluator = self._run, self._evaluator
            run.integrations[:] = [self._integration]
            run.crossed, run.until = [], math.inf
            for array, first in self._start:
                array[...] = first
            self._inputs.replace(evaluator.model.input_values.tolist())
            self._failure, self._log.count = "", 0
            if self._locator is not None:
                self._locator.forget()
                self._locator.release_inactive(None)
            self._hold.forget()
            if self._hold.integration is not self._integration:
                self._attach()
            self.state.changed()
            if u is not None:
                state = state_of(u, evaluator.model.body_names)
                evaluator.start(0.0, state)
                self._integration.work.state[Y] = evaluator.coordinates.start(state)
                self._integration.restart()
                if not self._integration.project():
                    raise SimulationError(
                        "no state that satisfies the constraints was found near u"
                    )
            if run.jumps is not None:
                run.jumps.restart(self._integration)

    def result(self) -> Result:
        """The states at the ends of all steps so far, with the inputs that act from there on.

        Accelerations and reactions are computed here. Without ``record`` the present state alone.
        """
        with self._lock:
            log, t = self._log, self.t
            run = self._run
            notes = [] if run.jumps is None else run.jumps.notes(run.present)
            record = run.record("stopped" if self._failure else "done", notes)
            more = {"t_end": t, "dt": None, "controllers": ["steps of a script"]}
            record = attrs.evolve(record, settings=record.settings | more)
            log.add(t)
            rows = log.reports()
            if (shapes := self._evaluator.model.collisions) is not None:
                record = attrs.evolve(record, contacts=log.contacts(shapes.names))
            log.count -= 1
            return Result.of_run(
                self._evaluator.model, rows, record, lambda: self.compiled.evaluator
            )

    # ---------------------------------------------------------------- steps

    def _attach(self) -> None:
        """Work with the present integration."""
        self._hold = Hold(self._run.present, self._evaluator.model.body_count)
        self._log.attach(self._run.present)
        self.state.attach(self._run.present)

    def _reach(self, end: float, budget: int | None = None) -> bool:
        """As ``Hold.to``; joints may end meanwhile."""
        if self._locator is None:
            return self._hold.to(end, budget)
        return with_events(self._hold, self._locator, end)

    def _go_on(self, end: float) -> None:
        """Reach the end of a step that one compiled call has not reached."""
        run = self._run
        while True:
            present = run.present
            present.rows()  # those of the integration are not used
            if run.jumps is not None and present.status is Status.JUMPED:
                self._jump(run.jumps)
            elif present.status is Status.RUNNING and present.t < min(end, run.until):
                self._reach(min(end, run.until), 0 if run.until < math.inf else None)
            elif present.t >= end and present.status in (Status.RUNNING, Status.FINISHED):
                return
            elif hand_over(run):
                self._attach()
            else:
                self._stop()

    def _jump(self, jumps: "Jumps") -> None:
        """Let velocities jump; the hold goes on."""
        try:
            jumps.apply(self._run.present)
        except SimulationError as error:
            self._failure = str(error)
            raise SimulationError(self._failure, self.result()) from error

    def _stop(self) -> None:
        """Say why the run cannot go on."""
        run = self._run
        if run.present.status is Status.FINISHED:
            words = f"the run has reached its end, t = {self.t:g} s"
            self._failure = f"{words}: start it with a later t_end, or reset it"
        else:
            self._failure = why_stopped(self._evaluator, run.present, run.rank)
        raise SimulationError(self._failure, self.result())


@checked
def start(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    *,
    t_end: float | None = None,
    allow_code: bool = False,
    announce: Callable[[str], None] | None = None,
    record: bool = True,
    **settings: Unpack[StepSettings],
) -> SteppedRun:
    """Begin a run that a script takes step by step; settings are those of ``simulate``.

    ::

        run = dap.start(scene, rtol=1e-6)
        while run.t < 2.0:
            run.step(0.002, inputs={"motor": -3.0 * run.state["hinge.angle"]})

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        t_end: s, where it ends at last; not that of the scene.
        method, integrator, rtol, atol, step, correct, project, correct_metric: as of ``simulate``.
        allow_code, announce: as of ``compile``.
        record: keep the states between steps, for ``result``.

    Raises:
        SceneError, PluginError: as ``compile``; unusable settings.
        SimulationError (RedundantError, AssemblyError): the run cannot begin.
    """
    compiled = compiled_for(scene, allow_code, announce, **settings)
    end = HORIZON if t_end is None else t_end
    simulation = settings_of(compiled, t_end=end, dt=end, **settings)
    with compiled.borrow_evaluator():
        run = Run(compiled, simulation, Callbacks())
        run.reports = False  # how often states are looked at is not known
        run.notes += replaced_notes(compiled, simulation, settings)
        return SteppedRun(run, record=record)


class StateLog:
    """Rows t, y, inputs, and the numbers by which turns of angles are counted.

    Attributes:
        count: rows so far.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        integration: Integration,
        inputs: HeldInputs,
        released: ReleasedJoints | None,
    ) -> None:
        """Args: the evaluator of the run, its integration, the inputs that act on it, and the
        joints that have ended; None where none may.
        """
        self._evaluator, self._joints = evaluator, released
        #: Reports of the rows, and contacts of shapes, where forces are means of steps, which are
        #: not known later.
        self._reports: list[Floats] = []
        self._contacts: list[Floats] = []
        self._ended: list[frozenset[str]] = []
        self._turns = np.r_[0:0, *evaluator.turn_places()]
        self._inputs = quick_view(inputs.present)
        self._y_end = 1 + len(integration.work.state[Y])
        self._end = self._y_end + len(inputs.values)
        self._width = self._end + len(self._turns)
        self.count = 0
        self._make_room(FIRST_ROWS)
        self.attach(integration)

    def attach(self, integration: Integration) -> None:
        """Keep the states of an integration from here on."""
        self._integration = integration
        self._y = quick_view(integration.work.state[Y])

    def add(self, t: float) -> None:
        """Keep the present state, of time t."""
        first = self.count * self._width
        if first == len(self._flat):
            self._make_room(2 * self.count)
        flat, y_end, end = self._flat, first + self._y_end, first + self._end
        flat[first] = t
        flat[first + 1 : y_end] = self._y
        if end > y_end:
            flat[y_end:end] = self._inputs
        if len(self._turns):
            self._rows[self.count, self._end :] = self._evaluator.system.par[self._turns]
        if self._joints is not None:
            self._ended[self.count :] = [frozenset(self._joints.names)]
        if self._integration.has_means:
            row = self._report(self._rows[self.count])
            self._integration.complete(row)
            self._reports[self.count :] = [row]
            if self._evaluator.model.collisions is not None:
                self._contacts[self.count :] = [self._integration.contacts_at(t)]
        self.count += 1

    def _make_room(self, rows: int) -> None:
        log: Floats = np.empty((rows, self._width))
        if self.count:
            log[: self.count] = self._rows
        self._rows: Floats = log
        self._flat = quick_view(log.reshape(-1))

    @IGNORE_FLOAT_ERRORS
    def _report(self, noted: Floats) -> Floats:
        """A row t, y, report of a row of the log, with the present inputs."""
        evaluator, y_end = self._evaluator, self._y_end
        row = np.zeros(y_end + evaluator.report_size)
        row[:y_end] = noted[:y_end]
        evaluator.functions[REPORT](
            float(noted[0]), noted[1:y_end].copy(), row[y_end:], evaluator.system, evaluator.loops
        )
        return row

    def reports(self) -> Floats:
        """Rows as a run reports them: accelerations and reactions are computed here."""
        evaluator, inputs = self._evaluator, self._rows[: self.count, self._y_end : self._end]
        rows = self._reports[: self.count] or self._reports_of(inputs)
        return evaluator.with_inputs(evaluator.body_rows(np.array(rows)), inputs)

    def contacts(self, shapes: tuple[str, ...]) -> ContactTable:
        """Contacts of shapes, by their names, at the times of the rows."""
        found = self._contacts[: self.count]
        return ContactTable.of_rows(shapes, np.concatenate(found)) if found else no_contacts()

    def _reports_of(self, inputs: Floats) -> list[Floats]:
        """The reports of all rows, with inputs (rows, inputs), turns and joints of their times."""
        evaluator, rows = self._evaluator, []
        par, places = evaluator.system.par, self._turns
        before = par[places]
        with evaluator.held_inputs():
            for k, noted in enumerate(self._rows[: self.count]):
                if self._joints is not None:
                    self._joints.let_end(self._ended[k])
                evaluator.set_inputs(inputs[k])
                par[places] = noted[self._end :]
                rows.append(self._report(noted))
        par[places] = before
        if self._joints is not None:
            self._joints.let_end(self._ended[-1])
        return rows
