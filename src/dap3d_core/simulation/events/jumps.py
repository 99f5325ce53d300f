"""Jumps of velocities in the course of a run: where switches cross, and at its start."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations import ACCEPTED
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.jumps.law import ImpossibleJumpError, Jump, JumpLaw
from dap3d_core.integrators import Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.model.state_layout import velocities_of
from dap3d_core.result import EventRecord, information
from dap3d_core.result.file.validate import are_events, check_forms, is_number
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.uncarried_contact import UncarriedContact

#: Records of jumps that a result keeps.
MOST_RECORDS = 1000
#: Parts of the run: the time to zero of a switch below which it is on the side to which it goes;
#: that of a contact that has closed.
AT_ONCE, SOON = 1e-10, 1e-13
#: What passes a stop by this part of the length of the scene has gone through it.
PASSED = 1e-9
#: Part of the exchanged energy above which work of jumps is no rounding.
LOSSLESS = 1e-10


class Jumps:
    """Changes velocities where the integrations of a run stop for it.

    Attributes:
        records: of the first MOST_RECORDS jumps, and of the switches that crossed without one.
        count: jumps and such crossings.
        lose: whether a jump took or gave energy.
        span: of the run, s, by which rates and times are judged; None: from its start to its end.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        self._evaluator = evaluator
        self.records: list[EventRecord] = []
        self.count, self.lose = 0, False
        self.span: float | None = None

    @cached_property
    def _law(self) -> JumpLaw:
        return JumpLaw(self._evaluator)

    def state(self) -> dict[str, Any]:
        """The jumps so far, as plain data."""
        records = [attrs.asdict(one) for one in self.records]
        return {"records": records, "count": self.count, "lose": self.lose}

    def restore(self, stored: Any) -> None:
        """Go on from what ``state`` gave.

        Raises:
            ValueError: it is not of that form.
        """
        check_forms(stored, {
            "records": (are_events, "a list of jumps"),
            "count": (is_number, "a number of jumps"),
            "lose": (lambda value: isinstance(value, bool), "true or false"),
        })  # fmt: skip
        self.records = [EventRecord(**one) for one in stored["records"]]
        self.count, self.lose = int(stored["count"]), stored["lose"]

    def begin(self, integration: Integration) -> None:
        """Let what touches and approaches at the start of a run jump there."""
        crossing = np.zeros(integration.work.switches.shape[1])
        crossing[self._closing(integration)] = -1.0
        crossing[self._contact.pushes] = 0.0  # rows that push need not cross to answer
        self._jump(integration, crossing, None)

    def repeat_of(self, other: "Jumps") -> None:
        """Decide what another decided at its last instant, at states nearby."""

    def share(self, some: Integers, others: Integers) -> bool:
        """True if contacts of some switches share what they carry with those of others."""
        return False

    def slips(self, integration: Integration) -> Floats:
        """(m, 3) slip of each contact, m/s."""
        return np.zeros((0, 3))

    def sliding(self) -> list[int]:
        """Switches by which slip ends of contacts that slide in a plane, against friction."""
        return []

    def sliding_from_rest(self, integration: Integration) -> dict[str, int]:
        """Name -> place among ``slips`` of contacts that slide, in a plane, and are still."""
        return {}

    def restart(self, integration: Integration) -> None:
        """Forget the jumps so far, and begin again."""
        self.records, self.count, self.lose = [], 0, False
        self.begin(integration)

    def apply(self, integration: Integration) -> None:
        """Let velocities jump where an integration has stopped for it; it then continues."""
        work = integration.work
        crossing, sides = work.switches[[at.CROSSED, at.SIDE]]
        work.switches[at.CROSSED] = 0.0
        work.status = Status.RUNNING
        self._jump(integration, crossing, sides)

    def follow(self, integration: Integration) -> None:
        """Take note of how far an integration has come."""

    def notes(self, integration: Integration) -> list[str]:
        """Notes at the end of a run: more jumps than are kept, bodies that passed a stop."""
        evaluator, notes = self._evaluator, []
        if self.count > MOST_RECORDS:
            notes.append(
                information(f"there were {self.count} jumps; the first {MOST_RECORDS} are kept")
            )
        values = evaluator.switch_values(integration.t, integration.y)
        passed = self._contact.pushes & (values < -PASSED * evaluator.model.length)
        return notes + [
            f"{self._title(k)}: its switch is {values[k]:.3g} at the end. Contact stayed, and "
            "nothing carried it: its type has no wrench, and acts by jumps alone"
            for k in np.flatnonzero(passed).tolist()
        ]

    def set_state(
        self,
        integration: Integration,
        bodies: Mapping[int, Floats],
        states: Mapping[int, Floats],
        title: str,
    ) -> tuple[Floats, float]:
        """Let an event set velocities and states; u (13 n,) after it, and the work of that, J.

        Args:
            bodies: number of a body, from 0 -> (6,) its r_dot and omega, global axes; NaN leaves a
                component to the joints.
            states: first place of a state among all -> its numbers.
            title: of what asks for it, with its kind.

        Raises:
            SimulationError: the joints do not allow such velocities.
        """
        t, u = integration.t, self._state_of(integration)
        none = np.zeros(integration.work.switches.shape[1])
        y = self._evaluator.body_state(integration.y)
        own = y[self._evaluator.model.integrated_layout["states"]]
        for first, numbers in states.items():
            own[first : first + len(numbers)] = numbers
        try:
            jump = self._law.jump(t, y, None, none, self._soon(integration), rows_to(u, bodies))
        except ImpossibleJumpError as error:
            raise self._impossible(t, title, bodies) from error
        return self._take(integration, u, jump), jump.work

    def settle(self, integration: Integration) -> None:
        """Follow joints that have ended: velocities stay."""

    def _impossible(self, t: float, title: str, bodies: Iterable[int]) -> SimulationError:
        """The error where joints hold velocities that are set."""
        names = ", ".join(self._evaluator.model.body_names[k] for k in bodies) or "no body"
        return SimulationError(
            f"the run stopped at t = {t:.9g} s: {title} sets a velocity of {names} that "
            "the joints do not allow; set fewer components (None leaves one to the joints)"
        )

    def _state_of(self, integration: Integration) -> Floats:
        u: Floats = self._evaluator.hold(self._evaluator.body_state(integration.y))
        return u

    def _soon(self, integration: Integration) -> float:
        return SOON * self._span_of(integration)

    def _span_of(self, integration: Integration) -> float:
        times = integration.work.times
        span = float(times[-1] - times[0]) if self.span is None else self.span
        return max(span, abs(integration.t))

    def _jump(self, integration: Integration, crossing: Floats, sides: Floats | None) -> None:
        t, u = integration.t, self._state_of(integration)
        states_before = self._evaluator.states
        try:
            y = self._evaluator.body_state(integration.y)
            jump = self._law.jump(t, y, sides, crossing, self._soon(integration))
        except ImpossibleJumpError as error:
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: {error} cannot change the velocity as its "
                "impulse asks for: joints hold it. Where a driver moves its bodies, leave the "
                "element out, or give the driver's bodies a freedom"
            ) from error
        if not jump.elements:
            for k in np.flatnonzero(crossing).tolist():  # switches that brought no jump
                self._record(EventRecord(name=self._title(k), t=t, direction=int(crossing[k]),
                                         kind="switch"))  # fmt: skip
            self._refuse_what_nothing_carries(integration)
            return
        self.lose |= abs(jump.work) > LOSSLESS * jump.exchanged
        after = self._take(integration, u, jump)
        direction = next((int(x) for x in crossing if x != 0.0), 0)
        name = ", ".join(jump.elements)
        states = self._changed_states(states_before, jump.states)
        self.lose |= bool(states)  # what they store is not followed
        self._record(EventRecord(name=name, t=t, direction=direction, kind="jump", u=u,
                                 u_after=after, work=jump.work, states=states))  # fmt: skip

    def _changed_states(self, before: Floats, after: Floats) -> dict[str, dict[str, Any]]:
        """States of elements that a jump has changed: element -> state -> value."""
        changed: dict[str, dict[str, Any]] = {}
        for state in self._evaluator.model.element_states:
            value = after[state.places].tolist()
            if before[state.places].tolist() != value:
                value = value[0] if state.length == 1 else value
                changed.setdefault(state.element, {})[state.name] = value
        return changed

    def _take(self, integration: Integration, u: Floats, jump: Jump) -> Floats:
        """Make the velocities of an integration those after a jump; its state u (13 n,) then."""
        evaluator, y = self._evaluator, jump.y
        if not evaluator.coordinates.are_of_bodies:
            y = evaluator.coordinates.with_jump(integration.y, jump.dv, jump.states, jump.work)
        integration.work.state[at.Y] = y
        integration.restart()
        if len(jump.sides):
            self._set_sides(integration, jump)
            self._refuse_what_nothing_carries(integration)
        after = u.copy()
        velocities_of(after)[:] += jump.dv
        return after

    def _refuse_what_nothing_carries(self, integration: Integration) -> None:
        """SimulationError for contact that stays, of a type without a force that could hold it."""
        for k in self._closing(integration):
            raise SimulationError(
                f"the run stopped at t = {integration.t:.9g} s: {self._title(k)} comes to rest "
                "in contact, and nothing carries it: its type has no wrench, and the bodies would "
                "pass through each other. Give it a wrench below zero of its switch, as ptp_stop "
                "and its like have, or end the run by an event before"
            )

    def _closing(self, integration: Integration) -> list[int]:
        """Switches at which contact stays that nothing carries."""
        sides, span = integration.work.switches[at.SIDE], self._span_of(integration)
        return self._contact.closing(integration.t, integration.y, sides, span)

    @cached_property
    def _contact(self) -> UncarriedContact:
        return UncarriedContact(self._evaluator, self._law)

    def _title(self, k: int) -> str:
        """Kind and name of the element of a switch."""
        switch = self._evaluator.switches[k]
        return f"{switch.group.type_info.type.kind} {switch.name(self._evaluator.model)}"

    def _record(self, record: EventRecord) -> None:
        self.count += 1
        if len(self.records) < MOST_RECORDS:
            self.records.append(record)

    @IGNORE_FLOAT_ERRORS
    def _set_sides(self, integration: Integration, jump: Jump) -> None:
        """Sides of the switches after a jump: of one that goes back at once, where it goes to.

        The state lies beyond zero by rounding, and the way back is no crossing of its own.
        """
        evaluator, work = self._evaluator, integration.work
        t, y = integration.t, integration.y
        span, values = self._span_of(integration), evaluator.switch_values(t, y)
        rates = self._contact.rates(t, y, span)
        at_once = np.abs(values) <= AT_ONCE * span * np.abs(rates)
        sides = np.where(at_once, np.sign(rates), jump.sides)
        work.switches[at.SIDE] = np.where(self._law.elements.is_jump, sides, 0.0)
        if work.calls_accepted:  # angles are extrapolated by their rates
            evaluator.functions[ACCEPTED](t, y, np.ones(1), evaluator.system, evaluator.loops)


def rows_to(u: Floats, bodies: Mapping[int, Floats]) -> list[tuple[Floats, float]]:
    """Rows that bring velocities of bodies to the values given, and their changes."""
    v, rows = velocities_of(u), []
    for body, targets in bodies.items():
        for k in np.flatnonzero(np.isfinite(targets)).tolist():
            row = np.zeros(6 + v.size)
            row[6 + 6 * body + k] = 1.0
            rows.append((row, float(targets[k] - v[6 * body + k])))
    return rows
