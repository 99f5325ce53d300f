"""Contacts in the course of a run: what happens where one of their switches ends a mode."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations import RHS
from dap3d_core.formulations.contacts.contact_rows import (
    FRICTION,
    GAP,
    NORMAL,
    REACH,
    SLIP,
    ContactRows,
    ContactTable,
    JamError,
    Modes,
    find_modes,
    length_of,
    nearly_jams,
)
from dap3d_core.formulations.contacts.impacts import AT_REST, Impact, collide, repeat, unjam
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.formulations.switches import POSITION_ROUNDING
from dap3d_core.integrators import Integration, Status
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.interface.contacts.rows import APART
from dap3d_core.kernels.array_types import Floats
from dap3d_core.result import EventRecord
from dap3d_core.result.note import information
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.scene.errors import MISSING
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.events.jumps import LOSSLESS, MOST_RECORDS, Jumps, rows_to

#: Gaps, m of a scene of ordinary size, below which bodies touch: in a run, and where it begins.
TOUCHING, TOUCHING_AT_START = 1e-10, 1e-8
#: What an impulse changes where joints hold, as a part of what it does to free bodies: nothing.
HELD = 1e-10
#: Slip, m/s, that is stopped where it goes through zero.
STOPPED = 1e-6
#: Mobility of a slip, as a part of that of free bodies, below which it is the pose that stops it.
DEAD = 1e-12
#: Ends of modes within this part of the run: what changes more often comes to no end.
MOST_CHANGES, WITHIN = 500, 1e-6
#: So many steps within this part of the run are too many: it would not come to an end.
MOST_STEPS, SLOW = 10_000, 1e-5
#: Records of changes from one mode to another.
CHANGES = {(0, 1): "touch", (0, 2): "touch", (1, 0): "lift", (2, 0): "lift", (1, 2): "stick",
           (2, 1): "slip"}  # fmt: skip


@attrs.frozen
class Decided:
    """What was decided at one instant, for the same once more from a state nearby.

    Attributes:
        impact: with its rounds.
        stopped: contacts whose slip was stopped.
        modes: of all contacts, behind it.
        held, others: contacts that hold, and those that touch and do not.
    """

    impact: Impact
    stopped: list[int]
    modes: Modes
    held: list[int]
    others: list[int]


class ContactJumps(Jumps):
    """Changes velocities and modes of contacts where the integrations of a run stop for it."""

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the run.

        Raises:
            SceneError: elements of the scene change velocities by laws of their own.
        """
        super().__init__(evaluator)
        others = [s for s in evaluator.switches if s.jumps and not s.is_contact]
        if others:
            name = others[0].name(evaluator.model)
            what = "changes velocities by a law of its own, which contacts do not know"
            remedy = "describe what it does by a contact, or take the contacts out"
            raise SceneError([Mistake(name, MISSING, what, remedy=remedy)])
        model = evaluator.model
        if readers := model.iterated_forces[: -model.contact_count]:
            what = (
                "depends on reactions in joints, and the modes of contacts are found without that"
            )
            remedy = "take it out, or the contacts; friction of its own a contact has (mu)"
            raise SceneError([Mistake(f"forces.{readers[0]}", MISSING, what, remedy=remedy)])
        self.table = ContactTable(evaluator)
        #: What the last instant decided; where ``repeats``, what is decided at the next.
        self.decided: Decided | None = None
        self.repeats = False
        self._stood, self._jammed = (0, -np.inf), ""
        self._latest: deque[tuple[float, str]] = deque(maxlen=MOST_CHANGES)

    def begin(self, integration: Integration) -> None:
        """Find the modes at the start; what touches and approaches collides there.

        Raises:
            SceneError: bodies overlap.
        """
        if self.repeats:
            self._repeat(integration)
            return
        gaps, touching = self._gaps(integration), TOUCHING_AT_START * self.table.length
        beyond = np.flatnonzero(gaps < -touching)
        if beyond.size:
            raise SceneError([self._overlap(int(k), -gaps[k]) for k in beyond])
        self._resolve(integration, [], touching)

    def _movable(self, rows: ContactRows, closed: list[int]) -> list[int]:
        """Contacts that joints leave an effect; those that touch a body that they hold do nothing.

        Raises:
            SimulationError: one closes, and joints prescribe that.
        """
        movable, limits = list[int](), -AT_REST * self.table.length
        for c in closed:
            row = rows.G[3 * c]
            if self.table.alone[c] or rows.W[3 * c, 3 * c] > HELD * (row @ rows.inverse @ row):
                movable.append(c)
            elif rows.slip[c, 0] < limits[c] or rows.free[3 * c] < limits[c]:
                raise SimulationError(
                    f"the run stopped at t = {rows.t:.9g} s: contact {self.table.names[c]} closes, "
                    "and joints or drivers prescribe the motion of its bodies: nothing that it "
                    "pushes with can stop them"
                )
        return movable

    def _overlap(self, k: int, depth: float) -> Mistake:
        """What is said of a contact whose gap is negative at the start."""
        unit = "rad" if self.table.turns[k] else "m"
        remedy = "move them apart by that along the normal"
        if unit == "rad":
            remedy = "turn them back by that about the axis, or change the bound"
        elif self.table.movable[k]:
            remedy += ", or have them moved until they touch (touch = true)"
        least = TOUCHING_AT_START * self.table.length[k]
        return Mistake(
            self.table.names[k], MISSING, f"its bodies overlap by {depth:.6g} {unit} at the start",
            remedy=f"{remedy}; a gap of up to {least:g} {unit} counts as touching",
        )  # fmt: skip

    def apply(self, integration: Integration) -> None:
        """Go on behind the end of a mode."""
        work = integration.work
        crossed = work.switches[at.CROSSED].copy()
        work.switches[at.CROSSED] = 0.0
        work.status = Status.RUNNING
        which = [(c, part) for c, pair in enumerate(self.table.switches.tolist())
                 for part, k in enumerate(pair) if crossed[k] != 0.0]  # fmt: skip
        work.switches[at.COUNT][self.table.switches.ravel()] = 0.0  # it is counted here
        if self.repeats:
            self._repeat(integration)
            return
        self._refuse_endless(integration, [self.table.names[c] for c, _ in which])
        self._resolve(integration, which, TOUCHING * self.table.length)

    def repeat_of(self, other: Jumps) -> None:
        """Decide what another decided at its last instant, at states nearby.

        Raises:
            SimulationError: contacts that share what they carry slide.
        """
        assert isinstance(other, ContactJumps)
        assert other.decided is not None
        modes = other.decided.modes
        shares = [
            name for name, mode, near in zip(self.table.names, modes.mode, modes.near, strict=True)
            if mode == 1.0 and near.any()
        ]  # fmt: skip
        if shares:
            raise SimulationError(
                f"contacts {', '.join(shares)} share what they carry, and slide: what each of them "
                "takes is a choice, of which derivatives are not known; let fewer points touch"
            )
        self.decided, self.repeats = other.decided, True

    def follow(self, integration: Integration) -> None:
        """Where steps have become too short for the run to come to an end: slip jams, or it ends.

        Raises:
            SimulationError: it ends.
        """
        steps, t = integration.statistics.steps, integration.t
        (before, since), span = self._stood, self._span_of(integration)
        if t - since > SLOW * span or steps < before:
            self._stood = (steps, t)
        elif steps - before > MOST_STEPS:
            u, modes = self._state_of(integration), self._evaluator.states[self.table.mode]
            slip = np.linalg.norm(self._outputs(t, u)[:, SLIP], axis=1)
            sliding = np.where(modes == 1.0, slip, np.inf)
            closed = np.flatnonzero(modes > 0.5).tolist()
            self._jammed = nearly_jams(self.table, ContactRows(self.table, t, u), closed)
            if self._jammed:
                self._stood, integration.work.status = (steps, t), Status.JUMPED
                return
            names = [self.table.names[c] for c in closed]
            slowest = (
                f"the slowest slip is {sliding.min():.2g} m/s; " if np.any(modes == 1.0) else ""
            )
            raise SimulationError(
                f"the run stopped at t = {t:.9g} s: {steps - before} steps brought it on by "
                f"{t - since:.2g} s, with contacts {', '.join(names)} closed; {slowest}slip that "
                "turns while it is next to nothing asks for steps as short. Integrator radau may "
                "pass; a larger mu_s, above mu, lets it begin at once; or end the run by an event"
            )

    def _refuse_endless(self, integration: Integration, names: list[str]) -> None:
        """SimulationError where changes of contacts follow each other ever faster."""
        latest, t = self._latest, integration.t
        latest.append((t, ", ".join(names)))
        passed = t - latest[0][0]
        if len(latest) < MOST_CHANGES or passed > WITHIN * self._span_of(integration):
            return
        every = sorted({name for _, some in latest for name in some.split(", ")})
        raise SimulationError(
            f"the run stopped at t = {t:.9g} s: contacts {', '.join(every)} changed "
            f"{MOST_CHANGES} times within {passed:.2g} s, ever faster. Smaller e of these contacts "
            "ends bounces sooner (e = 0: at once); or end the run by an event before"
        )

    def notes(self, integration: Integration) -> list[str]:
        """A note where more happened than is kept."""
        if self.count <= MOST_RECORDS:
            return []
        words = f"contacts changed {self.count} times; the first {MOST_RECORDS} changes are kept"
        return [information(words)]

    def set_state(
        self,
        integration: Integration,
        bodies: Mapping[int, Floats],
        states: Mapping[int, Floats],
        title: str,
    ) -> tuple[Floats, float]:
        """As of ``Jumps``: joints carry it, and what then approaches collides.

        Raises:
            SimulationError: the joints do not allow such velocities.
        """
        evaluator, t, u = self._evaluator, integration.t, self._state_of(integration)
        rows, own = ContactRows(self.table, t, u), evaluator.states.copy()
        if not rows.follow(rows_to(u, bodies)):
            raise self._impossible(t, title, bodies)
        for first, numbers in states.items():
            own[first : first + len(numbers)] = numbers
        after = rows.with_velocities(rows.v)
        v = u[-len(rows.v) :]
        work = 0.5 * float(rows.v @ rows.M @ rows.v - v @ rows.M @ v)
        self._go_on(integration, u, rows, np.zeros_like(v), own, work)
        self.settle(integration)
        return after, work

    def settle(self, integration: Integration) -> None:
        """Find velocities and modes anew, where joints have ended or velocities were set."""
        self._resolve(integration, [], TOUCHING * self.table.length)

    def _gaps(self, integration: Integration) -> Floats:
        u = self._state_of(integration)
        outputs = self.table.outputs(integration.t, u)
        gaps: Floats = np.where(outputs[:, REACH] < 0.0, APART, outputs[:, GAP])
        return gaps

    @IGNORE_FLOAT_ERRORS
    def _resolve(
        self, integration: Integration, ended: list[tuple[int, int]], touching: Floats
    ) -> None:
        """Velocities and modes at the present state.

        Args:
            integration: of the run.
            ended: contacts with which of their switches has changed its sign.
            touching: (m,) gap, m or rad, below which each contact touches.
        """
        evaluator, table, t = self._evaluator, self.table, integration.t
        u, before = self._state_of(integration), evaluator.states[table.mode].copy()
        outputs = self._outputs(t, u)
        rows = ContactRows(table, t, u)
        # of those that hold what ends is the force, or the reach of their surfaces
        beyond = {
            c
            for c, part in ended
            if part == 0 and before[c] > 0.5 and outputs[c, REACH] < outputs[c, NORMAL]
        }
        ended = [(c, part) for c, part in ended if c not in beyond]
        near = (outputs[:, GAP] < touching) & (outputs[:, REACH] >= 0.0)
        closed = [c for c in range(table.count) if c not in beyond
                  and (before[c] > 0.5 or near[c] or (c, 0) in ended)]  # fmt: skip
        sliding, leaving, stopped = self._what_ended(rows, outputs, before, ended)
        closed = self._movable(rows, closed)
        opening = {c for c, _ in ended if before[c] < 0.5 and rows.closing[c] > 0.0}
        impact = collide(table, rows, closed)
        table.find_grips(t, rows.with_velocities(rows.v))
        jammed, self._jammed = self._jammed, ""
        try:
            if jammed:
                raise JamError(jammed)
            modes = find_modes(table, rows, closed, sliding, leaving)
        except JamError as error:
            impact, modes = self._unjam(rows, closed, impact, str(error))
        held = [c for c in closed if modes.mode[c] > 0.5]
        others = [c for c in closed if modes.mode[c] < 0.5]
        rows.change(rows.lifted(rows.closing, held, others))
        gaps = np.where(np.abs(outputs[:, GAP]) < touching, outputs[:, GAP], 0.0)
        moved = self._apart(rows, gaps, held, others, opening)
        states = evaluator.states.copy()
        states[table.mode], states[table.way], states[table.near] = (
            modes.mode, modes.way, modes.near
        )  # fmt: skip
        work = float(np.sum(impact.work))
        self.decided = Decided(impact, stopped, modes, held, others)
        self.lose |= abs(work) > LOSSLESS * impact.exchanged
        self._go_on(integration, u, rows, moved, states, work)
        after = rows.with_velocities(rows.v)
        for c in np.flatnonzero(np.abs(impact.impulses[:, 0]) > 0.0).tolist():
            self._note(c, t, "impact", u, after, float(impact.work[c]))
        for c, seconds in impact.rest.items():
            self._note(c, t + seconds, "rest")
        for c, (old, new) in enumerate(
            zip(before.astype(int), modes.mode.astype(int), strict=True)
        ):
            if (kind := CHANGES.get((int(old), int(new)), "")) and (old or not table.alone[c]):
                self._note(c, t, kind, u)

    def _unjam(
        self, rows: ContactRows, closed: list[int], impact: Impact, name: str
    ) -> tuple[Impact, Modes]:
        """Impacts and modes where a contact jams: an impulse may stop its slip.

        Raises:
            SimulationError: none does.
        """
        table = self.table
        stopped = unjam(table, rows, closed, impact)
        try:
            if stopped is not None:
                table.find_grips(rows.t, rows.with_velocities(rows.v))
                return stopped, find_modes(table, rows, closed, {}, [])
        except JamError as error:
            name = str(error)
        raise SimulationError(
            f"the run stopped at t = {rows.t:.9g} s: contact {name} jams: its friction presses "
            "the bodies together by more than it lets them give way, and no motion with "
            "Coulomb's law goes on from here"
        )

    def _apart(
        self, rows: ContactRows, gaps: Floats, held: list[int], others: list[int], opening: set[int]
    ) -> Floats:
        """(6 n,) changes of positions that close the gaps of what holds, and part what overlaps.

        What opens from rest, or opened already, would stop the run again where its gap is as deep
        as a switch passes.
        """
        length = self.table.length
        rounding = POSITION_ROUNDING * length
        slow = [c for c in others if rows.closing[c] < AT_REST * length[c] or c in opening]
        deep = [c for c in slow if gaps[c] < -0.5 * rounding[c]]
        return rows.lifted(gaps, [*held, *deep], others, 2.0 * rounding)

    def _outputs(self, t: float, u: Floats) -> Floats:
        evaluator = self._evaluator
        report = evaluator.report(t, u)
        self.table.find_grips(t, u)
        return self.table.outputs(t, u, report[evaluator.model.report_layout["Lam"]])

    def _what_ended(
        self, rows: ContactRows, outputs: Floats, before: Floats, ended: list[tuple[int, int]]
    ) -> tuple[dict[int, Floats], list[int], list[int]]:
        """Contacts that begin to slide, with directions, whose normal force vanishes, that stop."""
        sliding: dict[int, Floats] = {}
        stopped: list[int] = []
        leaving = [c for c, part in ended if part == 0 and before[c] > 0.5]
        for c, part in ended:
            if part == 0:
                continue
            if before[c] > 1.5:
                force = rows.frames[c, self.table.across(c)] @ outputs[c, FRICTION]
                size = length_of(force)
                if size > 0.0:
                    sliding[c] = self.table.slip_against(c, force)
            elif length_of(rows.slip[c, self.table.across(c)]) < STOPPED * self.table.length[c]:
                stopped.append(c)
        self._stop(rows, stopped, before)
        return sliding, leaving, stopped

    @IGNORE_FLOAT_ERRORS
    def _repeat(self, integration: Integration) -> None:
        """What was decided, at the present state: velocities and directions follow smoothly.

        Shares of what contacts carry stay: where they stick no motion depends on them.
        """
        decided, table, evaluator = self.decided, self.table, self._evaluator
        assert decided is not None
        u = self._state_of(integration)
        table.find_grips(integration.t, u)
        rows, states = ContactRows(table, integration.t, u), evaluator.states.copy()
        self._stop(rows, decided.stopped, states[table.mode])
        impact = repeat(table, rows, decided.impact)
        rows.change(rows.lifted(rows.closing, decided.held, []))
        modes = decided.modes
        states[table.mode], states[table.way], states[table.near] = (
            modes.mode,
            modes.way,
            modes.near,
        )
        for c in np.flatnonzero(modes.mode == 1.0).tolist():
            slip, frame = rows.slip[c, table.across(c)], rows.frames[c, table.across(c)]
            if length_of(slip) > STOPPED * table.length[c]:
                states[table.way[c]] = table.length[c] * slip / length_of(slip) @ frame
        moved = np.zeros(len(rows.v))
        self._go_on(integration, u, rows, moved, states, float(np.sum(impact.work)))

    def _stop(self, rows: ContactRows, contacts: list[int], mode: Floats) -> None:
        """Stop slips, rounding of zero, without a change of what contacts hold in their modes.

        At a dead centre it passes through zero while the mechanism moves on.
        """
        u, holds = np.zeros_like(rows.slip), np.zeros_like(rows.slip, dtype=bool)
        holds[mode == 1.0, 0] = holds[mode == 2.0] = True
        for c in contacts:
            which = rows.rows_of([c])
            free = np.einsum("ri,ij,rj->r", rows.G[which], rows.inverse, rows.G[which])
            if np.diag(rows.W)[which].max() >= DEAD * free.max():
                across = self.table.across(c)
                u[c, across], holds[c] = rows.slip[c, across], True
        if u.any():
            held, x = np.flatnonzero(holds), np.zeros(len(rows.G))
            A = rows.W[np.ix_(held, held)]
            x[held] = np.linalg.lstsq(A, -u.ravel()[held], rcond=1e-12)[0]
            rows.kick(x)

    def _go_on(
        self, integration: Integration, u: Floats, rows: ContactRows, moved: Floats, states: Floats,
        work: float,
    ) -> None:  # fmt: skip
        """Make positions (by rounding), velocities and states those behind the instant."""
        evaluator, work_state = self._evaluator, integration.work
        dv = rows.v - u[-len(rows.v) :]
        y = evaluator.coordinates.with_jump(integration.y, dv, states, work)
        evaluator.coordinates.displace(y, moved)
        work_state.state[at.Y] = y
        integration.restart()
        evaluator.states = states
        work_state.switches[at.SIDE][self.table.switches.ravel()] = 1.0
        evaluator.functions[RHS](
            integration.t, y, np.zeros_like(y), evaluator.system, evaluator.loops
        )

    def _note(
        self, c: int, t: float, kind: str, u: Any = None, after: Any = None, work: float = 0.0
    ) -> None:
        name = self.table.names[c]
        self._record(
            EventRecord(name=name, t=t, direction=0, kind=kind, u=u, u_after=after, work=work)
        )
