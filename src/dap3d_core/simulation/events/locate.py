"""Events of a script: looked for after every step, located by steps that end where they are.

There is no interpolation in what is found: a step is taken back and made again to another end until
the number that is watched passes its level there, to the last digit of time. So what holds of a
step (its error, the constraints) holds of the state at an event.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import CHECKPOINTED
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import STEPPING, Integration, Status
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result.event_record import EventRecord
from dap3d_core.result.file.validate import are_events, are_texts, check_forms, is_number, list_of
from dap3d_core.result.post.smooth_parts import cubic
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.events.event import Event, Instant, Numbers, checked_events
from dap3d_core.simulation.events.sampling import Sampler, is_sampling
from dap3d_core.simulation.initial.released_joints import ReleasedJoints

if TYPE_CHECKING:
    from dap3d_core.simulation.events.jumps import Jumps
    from dap3d_core.simulation.initial.start_state import StartState


EPSILON = float(np.finfo(float).eps)
#: Part of a run that shows to which side a number goes that is zero where the run begins.
SOON = 1e-9
#: Of the search for a root: bisection, which it falls back to, squared.
MAX_ITERATIONS = 3000


@attrs.frozen
class Passage:
    """A change of sign within a step, as samples show it.

    Attributes:
        side: +1 or -1, the side of the level before it.
        before, after: instants of the samples about it, s.
        is_sought: whether it is in the direction of the event.
    """

    side: float
    before: float
    after: float
    is_sought: bool


class EventLocator:
    """Locates events during an integration.

    Attributes:
        events: what is looked for: those of the script, ``of_script``, then those of joints.
        released: joints that hold no more; None where all hold throughout.
        occurrences: what was found.
        numbers: of the forces, which events may change.
        jumps: of velocities, which events may set; made where one does.
        horizon: time that no step goes beyond.
        take_rows: takes what was reported before an input changes.
    """

    horizon = np.inf

    def __init__(
        self, compiled: CompiledModel, events: Sequence[Event], evaluator: Evaluator
    ) -> None:
        self.compiled, self.evaluator = compiled, evaluator
        self.of_script = checked_events(events, compiled.model.body_names)
        self.events = self.of_script
        self.released: ReleasedJoints | None = None
        if compiled.model.breaks:
            from dap3d_core.simulation.events.breaking import JointEvents

            self._of_joints = JointEvents(compiled.model)
            self.events += self._of_joints.events
            self.released = ReleasedJoints(evaluator)
        self.numbers = Numbers(compiled, evaluator)
        self.jumps: Jumps | None = None
        self.take_rows: Callable[[], None] = lambda: None
        self.occurrences: list[EventRecord] = []
        self._samplers = [Sampler(event.every) for event in self.events]
        self._values: list[float] = []
        self._sides: list[float] = []

    def state(self) -> dict[str, Any]:
        """State of the search, as plain data."""
        return {
            "titles": [event.title for event in self.events],
            "occurrences": [attrs.asdict(one) for one in self.occurrences],
            "values": self._values,
            "sides": self._sides,
            "samplers": [sampler.state() for sampler in self._samplers],
            "inputs": self.evaluator.inputs.tolist(),
            **({} if self.released is None else {"joints": {
                "released": sorted(self.released.names),
                "pivots": self.evaluator.system.smallest.tolist(),
                **self._of_joints.state(),
            }}),
        }  # fmt: skip

    def _restore_joints(self, found: Any) -> None:
        assert self.released is not None
        system, known = self.evaluator.system, set(self.compiled.model.breaks)
        check_forms(found, {
            "released": (lambda value: are_texts(value) and set(value) <= known, "joints that end"),
            "pivots": (list_of(is_number, len(system.smallest)), "a number for each of the rows"),
        })  # fmt: skip
        self._of_joints.restore(found, known)
        self.released.put_back()
        self.released.release(found["released"])
        system.smallest[:] = found["pivots"]

    def restore(self, found: Any) -> None:
        """Go on from what ``state`` gave.

        Raises:
            ValueError: it is not of that form.
        """
        count, inputs = len(self.events), len(self.compiled.model.input_names)
        check_forms(found, {
            "values": (list_of(is_number, 0, count), "a number for each event"),
            "sides": (list_of({-1.0, 0.0, 1.0}.__contains__, 0, count), "a sign for each event"),
            "occurrences": (are_events, "a list of events"),
            "samplers": (list_of(is_sampling, count), "how each event changes"),
            "inputs": (list_of(is_number, inputs), "a number for each input"),
        })  # fmt: skip
        if len(found["sides"]) != len(found["values"]):
            raise ValueError("events should have as many sides as values")
        self.occurrences = [EventRecord(**one) for one in found["occurrences"]]
        self._values, self._sides = list(found["values"]), list(found["sides"])
        for sampler, state in zip(self._samplers, found["samplers"], strict=True):
            sampler.restore(state)
        self.evaluator.set_inputs(found["inputs"])
        if self.released is not None:
            self._restore_joints(found.get("joints"))
        if any(one.changes for one in self.occurrences):
            self.numbers.given = self.evaluator.system.par.copy()

    @property
    def changed_forces(self) -> set[str]:
        """Names of the forces whose numbers events have changed."""
        return {force for one in self.occurrences for force in one.changes}

    def notes(self) -> list[str]:
        """Notes on events that were not followed, or of which a passage cannot be decided."""
        pairs = list(zip(self.events, self._samplers, strict=True))
        touches = [
            f"event {event.title}: at t = {sampler.touch:.9g} s it turned within rounding of its "
            "level; whether it passed there cannot be decided"
            for event, sampler in pairs
            if sampler.touch is not None
        ]
        return touches + [
            f"event {event.title}: from t = {sampler.lost:.6g} s on it changed too fast to be "
            "followed, at some times at least: it may have passed its level unseen. Let it change "
            "more slowly, or give a shorter step"
            for event, sampler in pairs
            if sampler.lost is not None
        ]

    def advance(self, integration: Integration, budget: int) -> Status:
        """As ``Integration.advance``, step by step."""
        if not self._values:
            self.begin_anew(integration)
        limit = integration.statistics.rhs + budget
        while integration.status is Status.RUNNING and not integration.rows_are_full:
            self._step(integration)
            if integration.statistics.rhs > limit or integration.t >= self.horizon:
                break
        return integration.status

    def look_again(self, integration: Integration) -> None:
        """Act on the events whose numbers passed their levels in a jump of velocities."""
        self._take_notice(integration, self._instant(integration))

    def begin_anew(self, integration: Integration) -> None:
        """Look at the events again where what they watch may have jumped: that is no event.

        But joints that carry too much there break, and others that have to carry more then; so do
        joints end and hold again that are active by what has jumped.
        """
        begins = not self._values
        self._values = self._all(self._instant(integration))
        self._sides = [float(np.sign(value)) for value in self._values]
        if self.released is None:
            return
        sides = self._sides[len(self.of_script) :]
        if begins and 0.0 in sides:
            soon = SOON * integration.work.times[-1]
            y = integration.y + soon * self._slope(integration)
            later = self._instant(integration, integration.t + soon, y)
            events = self.events[len(self.of_script) :]
            sides = [side or float(np.sign(event.value(later)))
                     for side, event in zip(sides, events, strict=True)]  # fmt: skip
        if self._switch_joints(integration, *self._of_joints.due(sides, self.released.names)):
            self.begin_anew(integration)

    def release_inactive(self, start: "StartState | None") -> None:
        """End the joints that do not hold where a run starts: None for the scene's start."""
        model, compiled = self.compiled.model, self.compiled
        if self.released is not None and start is not None:
            begin = tuple(start.u.tolist())
            self.occurrences += [EventRecord(name=name, t=0.0, direction=0, kind="break", u=begin)
                                 for name in self.released.release(start.ended)]  # fmt: skip
        if self.released is not None and model.active:
            from dap3d_core.simulation.output.check_outputs import inactive_joints

            u = model.u0 if start is None else start.u
            self.released.release(inactive_joints(compiled.scene_text, self.evaluator, u))

    def forget(self) -> None:
        """Begin as at the start of a run, all joints holding; nothing was found."""
        self.put_back()
        self.occurrences.clear()
        self._values, self._sides = [], []
        self._samplers = [Sampler(event.every) for event in self.events]
        if self.released is not None:
            self._of_joints.forget()

    def put_back(self) -> None:
        """Make numbers and joints those of the scene again."""
        self.numbers.put_back()
        if self.released is not None:
            self.released.put_back()

    def _step(self, integration: Integration) -> None:
        arrays = self._arrays(integration)
        saved = [array.copy() for array in arrays]
        t, y, slope = integration.t, integration.y, self._slope(integration)

        def go_to(end: float) -> Instant:
            """Make the step again, to another end."""
            for array, before in zip(arrays, saved, strict=True):
                array[...] = before
            while integration.t < end and integration.status is Status.RUNNING:
                integration.advance_to(end)
            return self._instant(integration)

        integration.advance_to(self.horizon)
        if integration.t == t:
            return
        here = self._instant(integration)
        within = self._within(integration, go_to, here, t, y, slope)
        ahead = [self._ahead(k, t, values) for k, values in enumerate(within)]
        ends = {k: self._locate(go_to, t, k, found) for k, found in enumerate(ahead) if found}
        if ends:
            end = min(ends.values())
            here = go_to(end)
            for k, found in enumerate(ahead):
                if found and ends[k] == end:
                    self._sides[k] = found.side
        self._take_notice(integration, here)

    def _arrays(self, integration: Integration) -> list[Any]:
        """All that a step changes."""
        system = self.evaluator.system
        return [*integration.state_arrays(), *(getattr(system, name) for name in CHECKPOINTED)]

    def _instant(
        self, integration: Integration, t: float | None = None, y: Floats | None = None
    ) -> Instant:
        """A state, by default the present one, with what else is known of the last step."""
        t, y = integration.t if t is None else t, integration.y if y is None else y
        return Instant(self.compiled, t, y, self.numbers, integration.complete)

    def _all(self, instant: Instant) -> list[float]:
        return [event.value(instant) for event in self.events]

    def _slope(self, integration: Integration) -> Floats:
        """dy/dt at the state of the integration."""
        slope = integration.dy_dt
        if slope is not None:
            return slope
        return self.evaluator.slope(integration.t, integration.y)

    def _within(
        self,
        integration: Integration,
        go_to: Callable[[float], Instant],
        here: Instant,
        t: float,
        y: Floats,
        slope: Floats,
    ) -> list[Iterator[tuple[float, float]]]:
        """For each event instants within the step from t, and its values there, in order.

        Of steps of contacts the end alone: what they do has no course within.
        """
        if integration.name == STEPPING.name:
            return [iter([(here.t, event.value(here))]) for event in self.events]
        last, h, y_end = self._slope(integration), here.t - t, integration.y
        expected = y + 0.5 * h * (slope + last)
        end = self.evaluator.coordinates.continued(expected, y_end)
        known: dict[float, Instant] = {here.t: here}

        def instant(time: float) -> Instant:
            if time not in known:
                between = integration.state_within(time)
                if between is None:  # a method without dense output, as accurate as a cubic
                    between = cubic((time - t) / h, h, (y, end), (slope, last))
                known[time] = self._instant(integration, time, between)
            return known[time]

        def value(event: Event, time: float) -> float:
            return event.value(instant(time))

        def exact(event: Event, time: float) -> float:
            found = event.value(go_to(time))
            go_to(here.t)  # dense output is that of the whole step again
            return found

        return [
            iter(())
            if getattr(event.of, "is_of_inputs", False)
            else sampler.samples(partial(value, event), partial(exact, event), t, first, here.t)
            for event, sampler, first in zip(self.events, self._samplers, self._values, strict=True)
        ]

    def _ahead(
        self, k: int, start: float, values: Iterator[tuple[float, float]]
    ) -> "Passage | None":
        """Where event k passes its level in the step; None where it does not in its direction.

        One in the other direction is reported where the event comes after it in the same step.
        """
        side, before, passed = self._sides[k], start, None
        for time, value in values:
            if value * side > 0.0 or (side == 0.0 and value == 0.0):
                before = time
                continue
            if side == 0.0:
                side, before = float(np.sign(value)), time
                continue
            found = Passage(side, before, time, self.events[k].sense * side <= 0.0)
            if found.is_sought:
                return passed or found
            side, before, passed = -side, time, passed or found
        return None

    def _locate(
        self, go_to: Callable[[float], Instant], start: float, k: int, passage: "Passage"
    ) -> float:
        """The time at which the step from ``start`` shall end for event k.

        It is the first one at which the level is passed, to the last digits; where it is passed in
        the other direction, any behind it.
        """
        side, before, end = passage.side, passage.before, passage.after
        past = end
        if not passage.is_sought:
            return past
        from scipy.optimize import brentq

        first = self._values[k]
        known = {start: first if first * side > 0.0 else side * float(np.finfo(float).tiny)}

        def value(t: float) -> float:
            nonlocal past
            if t not in known:
                known[t] = self.events[k].value(go_to(t))
                if known[t] * side <= 0.0:
                    past = min(past, t)
            return known[t]

        if value(end) * side < 0.0:  # else it was the interpolation's mistake
            before = before if value(before) * side > 0.0 else start
            resolution = 2.0 * EPSILON * max(abs(start), abs(end))
            options = {"xtol": resolution, "rtol": 4.0 * EPSILON, "maxiter": MAX_ITERATIONS}
            brentq(value, before, past, **options)
        return past

    def _take_notice(self, integration: Integration, here: Instant) -> None:
        """Act on the events that are past here."""
        self._values = self._all(here)
        changes, passed = False, [0.0] * len(self.events)
        for k, event in enumerate(self.events):
            side, value = self._sides[k], self._values[k]
            if side == 0.0 or value * side > 0.0:  # reaching the level counts as passing it
                self._sides[k] = side or float(np.sign(value))
                continue
            self._sides[k] = float(np.sign(value))  # 0 where it is reached: until it leaves
            passed[k] = -side
            if event.sense * side <= 0.0 and k < len(self.of_script):
                changes |= self._act(integration, event, int(-side))
        if self.released is not None:
            due = self._of_joints.due(passed[len(self.of_script) :], self.released.names)
            changes |= self._switch_joints(integration, *due)
        if changes:  # numbers may jump with them: that is no event
            self.begin_anew(integration)

    def _act(self, integration: Integration, event: Event, direction: int) -> bool:
        """Do what an event asks for; whether it changed numbers of forces, velocities, states."""
        here, kind = self._instant(integration), "change"
        if callable(event.action):
            event.action(here)
        else:
            kind = event.action
        if kind == "stop":
            integration.end()
        if here.changes:
            integration.restart()
        after, work = None, 0.0
        if here.inputs:
            self._set_inputs(here.inputs)
        if here.velocities or here.states or here.inputs:
            changed = here.velocities, here.states
            after, work = self._jumps.set_state(integration, *changed, f"event {event.title}")
        self.occurrences.append(
            EventRecord(name=event.title, t=here.t, direction=direction, kind=kind, u=here.u,
                       changes=here.changes, u_after=after, work=work)
        )  # fmt: skip
        switched = self._switch_joints(integration, here.released, here.engaged)
        return bool(here.changes) or switched

    def _switch_joints(
        self, integration: Integration, ending: Sequence[str], engaging: Sequence[str]
    ) -> bool:
        """End joints, and let others hold again; whether any of them did not before."""
        if not (ending or engaging):
            return False
        assert self.released is not None
        t, released = integration.t, self.released
        u, ended = self._instant(integration).u, released.release(ending)
        if ended:
            integration.restart()
            released.begin_anew(t, integration.y)
        self.occurrences += [
            EventRecord(name=name, t=t, direction=0, kind="break", u=u) for name in ended
        ]
        if engaged := released.engage(engaging, t, integration.y):
            name = "joint " + ", ".join(engaged)
            after, work = self._jumps.set_state(integration, {}, {}, name)
            released.check_velocities(engaged, t, after)
            self.occurrences.append(
                EventRecord(name=name, t=t, direction=0, kind="engage", u=u, u_after=after,
                           work=work)
            )  # fmt: skip
        elif ended and self.jumps is not None:
            self.jumps.settle(integration)
        if switched := [*ended, *engaged]:
            self._of_joints.refuse_endless(t, switched, float(integration.work.times[-1]))
        return bool(switched)

    def _set_inputs(self, inputs: Mapping[int, float]) -> None:
        """Set inputs from here on; what was reported so far has those before."""
        self.take_rows()
        values = self.evaluator.inputs
        values[list(inputs)] = list(inputs.values())
        self.evaluator.set_inputs(values)

    @property
    def _jumps(self) -> "Jumps":
        """Jumps of the velocities of the run."""
        if self.jumps is None:
            from dap3d_core.simulation.events.jumps import Jumps

            self.jumps = Jumps(self.evaluator)
        return self.jumps
