"""Controllers in the course of a run: sampled when they are due, their inputs held in between."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators import Integration
from dap3d_core.integrators.stepping.hold import Hold
from dap3d_core.integrators.stepping.integration_state import MOST_COUNTED, Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.state_layout import by_body
from dap3d_core.result import information
from dap3d_core.result.file.validate import check_forms, is_number, list_of
from dap3d_core.scene.coerce import plain
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.control.held_inputs import HeldInputs
from dap3d_core.simulation.control.state_view import StateView
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.event import several
from dap3d_core.simulation.events.locate import EventLocator

if TYPE_CHECKING:
    from dap3d_core.simulation.events.jumps import Jumps

#: Seconds of holds after which a run looks about: progress, checkpoints, Ctrl-C.
CHUNK_SECONDS = 0.1
#: Keys of the state of a hold in a checkpoint.
HOLD = ("h", "rejected")
#: Instants that differ by less than this part of the time between samples are one.
ALIKE = 1e-9


@attrs.frozen(kw_only=True)
class Controller:
    """Something that sets inputs of a scene at equal distances of time.

    ``update`` is called at t = 0 and at each multiple of ``every`` before the end of the run, and
    not in between: what it returns is held until the next time (zero-order hold). Steps end there.

    Attributes:
        every: s, from one sample to the next.
        update: called as update(t, state) with a ``StateView``; returns {input: value} of the
            inputs that it changes, {} for none.
        name: for messages; that of the function where it is left out.

    Raises:
        ValueError: ``every`` is no positive time.
        TypeError: ``update`` is no function.
    """

    every: float = attrs.field(converter=plain)
    update: Callable[[float, StateView], Mapping[str, float]]
    name: str = ""

    def __attrs_post_init__(self) -> None:
        every: Any = self.every
        is_number = isinstance(every, (int, float)) and not isinstance(every, bool)
        if not (is_number and 0.0 < every < math.inf):
            raise ValueError(f"every is {every!r}; it should be a positive number of seconds")
        update: Any = self.update
        if not callable(update):
            words = f"update is {update!r}; it should be a function of t and the state"
            raise TypeError(words)

    @property
    def title(self) -> str:
        """Name of the controller."""
        return self.name or str(getattr(self.update, "__name__", type(self.update).__name__))


class SampledControl:
    """The controllers of one run.

    Attributes:
        controllers: the controllers.
        view: the state that they are given.
    """

    def __init__(
        self,
        compiled: CompiledModel,
        evaluator: Evaluator,
        controllers: Sequence[Controller],
        t_end: float,
    ) -> None:
        self.controllers = several(controllers, Controller, "controllers")
        if not compiled.model.input_names:
            raise SimulationError(
                "the scene has no inputs that a controller could set: declare [inputs.NAME], and "
                'name it in a force, input = "NAME"'
            )
        self._evaluator, self._t_end = evaluator, t_end
        #: No sample is taken from here on: it would act on nothing.
        self._last = t_end - ALIKE * min(one.every for one in self.controllers)
        self.view = StateView(compiled, evaluator)
        self._inputs = HeldInputs(evaluator)
        self._counts = [0] * len(self.controllers)
        self._setters: dict[str, int] = {}
        self._holds: dict[int, Hold] = {}
        #: When inputs have changed since rows were taken last, and to what.
        self._history: list[tuple[float, list[float]]] = []
        self._next = 0.0
        self.jumps: Jumps | None = None  # of the run, if it has any

    @property
    def titles(self) -> list[str]:
        """Names of the controllers."""
        return [controller.title for controller in self.controllers]

    def notes(self, dt: float) -> list[str]:
        """Notes on controllers that are slow."""
        found = []
        for one in self.controllers:
            about = f"controller {one.title} is sampled every {one.every:g} s"
            if one.every >= self._t_end > 0.0:
                found.append(f"{about}, and the run ends at {self._t_end:g} s: at t = 0 alone")
            elif one.every > dt * (1.0 + ALIKE):
                found.append(
                    information(
                        f"{about}, less often than results are reported (every {dt:g} s): "
                        "its inputs are the same for several of them"
                    )
                )
        return found

    # ---------------------------------------------------------------- a chunk of a run

    def advance(
        self, integration: Integration, locator: EventLocator | None, step_by_step: bool
    ) -> None:
        """Advance from sample to sample, for CHUNK_SECONDS or until rows must be taken.

        Raises:
            SimulationError: a controller raised an exception, or returned what is none of inputs.
        """
        hold = self._hold_of(integration)
        deadline = time.perf_counter() + CHUNK_SECONDS
        budget = 0 if step_by_step else None
        while True:
            if hold.t >= self._next and not hold.is_open:
                self._sample(hold, locator)
            end = self._next
            reached = with_events(hold, locator, end) if locator else hold.to(end, budget)
            if not reached or time.perf_counter() > deadline:
                return

    def inputs_at(self, t: Floats) -> Floats:
        """(k, inputs) the inputs at rising instants since the rows were taken last."""
        history = self._history or [(0.0, list(self._inputs.values))]
        times = np.array([time for time, _ in history])
        values = np.array([row for _, row in history])
        found: Floats = values[np.maximum(np.searchsorted(times, t, side="right") - 1, 0)]
        self._history = history[-1:]
        return found

    def _hold_of(self, integration: Integration) -> Hold:
        """The holds of an integration; another one may take over in the course of a run."""
        hold = self._holds.get(id(integration))
        if hold is None:
            hold = self._holds[id(integration)] = Hold(
                integration, self._evaluator.model.body_count
            )
        if getattr(self.view, "_integration", None) is not integration:
            self.view.attach(integration)
        return hold

    # ---------------------------------------------------------------- samples

    def _sample(self, hold: Hold, locator: EventLocator | None) -> None:
        """Call the controllers that are due, and set what they return."""
        now = self._next
        self.view.changed()
        given: Mapping[str, Any]
        if len(self.controllers) == 1:
            self._counts[0] += 1
            given = self._update(self.controllers[0], now)
        else:
            given = self._of_several(now)
        self._next = self._next_instant()
        try:
            changes = self._inputs.set(given)
        except ValueError as error:
            who = " or ".join(self.titles)
            raise SimulationError(f"controller {who} at t = {now:.9g} s: {error}") from error
        if changes or not self._history:
            self._history.append((now, list(self._inputs.values)))
        if changes:
            jump(self._evaluator, hold, self.jumps, drives=self._inputs.drives)
            if locator is not None:
                locator.begin_anew(hold.integration)

    def _update(self, controller: Controller, now: float) -> Mapping[str, Any]:
        try:
            found = controller.update(now, self.view)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise SimulationError(
                f"controller {controller.title} failed at t = {now:.9g} s: {reason}"
            ) from error
        if type(found) is not dict and not isinstance(found, Mapping):
            raise SimulationError(
                f"controller {controller.title} returned {found!r} at t = {now:.9g} s; it should "
                "return {input: value}, or {} to leave all as they are"
            )
        return found

    def _of_several(self, now: float) -> dict[str, Any]:
        """What the controllers that are due set together."""
        given: dict[str, Any] = {}
        for k, controller in enumerate(self.controllers):
            if abs(self._counts[k] * controller.every - now) > ALIKE * controller.every:
                continue
            self._counts[k] += 1
            for name, value in self._update(controller, now).items():
                other = self._setters.setdefault(name, k)
                if other != k:
                    names = f"{self.controllers[other].title} and {controller.title}"
                    raise SimulationError(f"controllers {names} both set input {name}")
                given[name] = value
        return given

    def _next_instant(self) -> float:
        """The next instant at which a controller is due; infinite behind the end of the run."""
        if len(self.controllers) == 1:
            instant = self._counts[0] * self.controllers[0].every
        else:
            pairs = zip(self._counts, self.controllers, strict=True)
            instant = min(count * one.every for count, one in pairs)
        return instant if instant < self._last else math.inf

    # ---------------------------------------------------------------- checkpoints

    def state(self, integrations: Sequence[Integration]) -> dict[str, Any]:
        """State of the controllers' schedule and inputs, as plain data."""
        return {
            "titles": self.titles,
            "every": [one.every for one in self.controllers],
            "counts": list(self._counts),
            "inputs": list(self._inputs.values),
            "holds": [self._hold_of(one).state() for one in integrations],
        }

    def restore(self, found: Mapping[str, Any], integrations: Sequence[Integration]) -> None:
        """Go on from what ``state`` gave.

        Raises:
            ValueError: it is not of that form.
        """
        check_forms(found, {
            "counts": (list_of(_is_count, len(self.controllers)), "counts of samples"),
            "inputs": (list_of(is_number, len(self._inputs.values)), "a number for each input"),
            "holds": (list_of(_is_hold, len(integrations)), "a hold of each integration"),
        })  # fmt: skip
        self._counts = list(found["counts"])
        self._inputs.replace(found["inputs"])
        self._next = self._next_instant()
        for integration, hold in zip(integrations, found["holds"], strict=True):
            self._hold_of(integration).restore(hold)

    def put_back(self) -> None:
        """Make the inputs those of the scene again."""
        self._evaluator.set_inputs(self._evaluator.model.input_values)


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < MOST_COUNTED


def _is_hold(value: Any) -> bool:
    return isinstance(value, dict) and all(is_number(value.get(name)) for name in HOLD)


def with_events(hold: Hold, locator: EventLocator, end: float) -> bool:
    """As ``Hold.to``, with events looked for after each step."""
    hold.begin()
    locator.horizon = end
    locator.advance(hold.integration, 0)
    if hold.t < locator.horizon or hold.integration.status != 0:
        return False
    hold.land(end)
    return True


def jump(evaluator: Evaluator, hold: Hold, jumps: "Jumps | None", *, drives: bool) -> None:
    """Go on behind a change of inputs.

    Where a driver reads one, velocities jump with it, by impulses that its joints transmit: the
    least change in the metric of the masses. What they do is work of the drivers. What touches
    lifts, slips or sticks by the forces that act then.
    """
    hold.jump()
    if drives and jumps is not None and evaluator.model.contact_count:
        jumps.set_state(hold.integration, {}, {}, "what sets an input")  # contacts do not pull
    elif drives:
        _jump_of_velocities(evaluator, hold.integration)
    elif jumps is not None:
        jumps.settle(hold.integration)


@IGNORE_FLOAT_ERRORS  # costs more than the rest of a sample: only where it is needed
def _jump_of_velocities(evaluator: Evaluator, integration: Integration) -> None:
    y = integration.work.state[Y]
    before = kinetic_energy(evaluator, y)
    if not integration.project():
        raise SimulationError(
            f"velocities that fit the inputs set at t = {integration.t:.9g} s were not found"
        )
    y[-1] += kinetic_energy(evaluator, y) - before


def kinetic_energy(evaluator: Evaluator, y: Floats) -> float:
    """Kinetic energy, J, of an integrated state."""
    model = evaluator.model
    state = by_body(evaluator.bodies_of(evaluator.body_state(y)))
    v, w = state[:, 7:10], state[:, 10:13]
    return 0.5 * float(model.mass @ np.sum(v * v, axis=1) + np.einsum("ba,bac,bc", w, model.Jp, w))
